//! From a loss to a density, and from densities to the probability that a descent ends.

use aplanat::search::{Temperature, Termination};

const RULES: [Termination; 3] = [Termination::Ratio, Termination::Relative, Termination::Clocks];

fn at(value: f64) -> Temperature {
    Temperature::new(value).unwrap()
}

#[test]
fn a_temperature_gives_the_start_a_density_of_one_half() {
    for loss in [1e-300, 0.7225, 3.0, 1e300] {
        let density = Temperature::at_half_density(loss).density(loss);
        assert!((density - 0.5).abs() < 1e-15, "{loss}: {density}");
    }
    assert_eq!(Temperature::at_half_density(-3.0).density(-3.0), 2.0);
    for loss in [0.0, f64::INFINITY, f64::NAN] {
        assert_eq!(Temperature::at_half_density(loss).value(), 1.0);
    }
}

#[test]
fn a_density_follows_the_printed_formula() {
    assert_eq!(at(2.0).density(3.0), (-1.5f64).exp());
    assert_eq!(at(0.0).density(3.0), 0.0);
    assert_eq!(at(0.0).density(0.0), 1.0);
    assert_eq!(at(f64::INFINITY).density(1e308), 1.0);
    for temperature in [0.0, 1.0, f64::INFINITY].map(at) {
        for worthless in [f64::NAN, f64::INFINITY] {
            assert_eq!(temperature.density(worthless), 0.0);
        }
    }
    assert!(Temperature::new(-1.0).is_none() && Temperature::new(f64::NAN).is_none());
}

#[test]
fn probabilities_follow_the_printed_formulas() {
    let (temperature, c) = (at(1.3), 0.05);
    for (before, after) in [(0.9, 0.9), (0.9, 1.1), (0.9, 0.88), (0.9, 0.5), (4.0, 3.9)] {
        let [old, new] = [before, after].map(|loss| temperature.density(loss));
        let ratio = ((old - new + c) / (old + c)).max(0.0);
        let relative = ((old - new + c * old) / (old + c * old)).max(0.0);
        let rate = ((old - new) / old + c).max(0.0);
        let expected = [ratio, relative, rate / (1.0 + rate)];
        for (rule, expected) in RULES.into_iter().zip(expected) {
            let chance = rule.chance(temperature, c, before, after);
            assert!((chance - expected).abs() < 1e-14, "{rule:?}: {chance} for {expected}");
        }
    }
}

#[test]
fn a_stationary_descent_at_density_one_half_lasts_eleven_moves() {
    let chance = Termination::Ratio.chance(Temperature::at_half_density(0.7), 0.05, 0.7, 0.7);
    assert!((1.0 / chance - 11.0).abs() < 1e-9);
}

#[test]
fn far_below_the_constant_only_the_ratio_rule_ends_a_descent() {
    // A mutation of fifteen times the loss, and a move that takes a third of it away.
    let temperature = Temperature::at_half_density(1.0);
    let chance = |rule: Termination| rule.chance(temperature, 0.05, 15.0, 10.0);
    assert!(chance(Termination::Ratio) > 0.95, "{}", chance(Termination::Ratio));
    assert_eq!((chance(Termination::Relative), chance(Termination::Clocks)), (0.0, 0.0));
}

#[test]
fn at_zero_temperature_only_the_order_of_losses_matters() {
    for rule in RULES {
        let chance = |before, after| rule.chance(at(0.0), 0.25, before, after);
        assert_eq!(chance(2.0, 1.0), 0.0, "{rule:?}");
        assert_eq!(chance(0.0, -1.0), 0.0);
        let worse = if rule == Termination::Clocks { 1.25 / 2.25 } else { 1.0 };
        assert_eq!(chance(1.0, 2.0), worse);
        assert_eq!(chance(0.0, 1.0), worse);
        assert!((chance(1.0, 1.0) - 0.2).abs() < 1e-15);
    }
}

#[test]
fn at_infinite_temperature_ends_do_not_depend_on_losses() {
    for rule in RULES {
        let chance = |before, after| rule.chance(at(f64::INFINITY), 0.25, before, after);
        for (before, after) in [(1.0, 1.0), (1.0, 1e300), (1e300, -1e300)] {
            assert!((chance(before, after) - 0.2).abs() < 1e-15, "{rule:?}");
        }
    }
}

#[test]
fn termination_probabilities_are_valid_for_extreme_losses() {
    let losses = [
        0.0,
        5e-324,
        1e-300,
        1.0,
        1e300,
        f64::MAX,
        -1.0,
        -1e300,
        f64::MIN,
        f64::INFINITY,
        f64::NAN,
        f64::NEG_INFINITY,
    ];
    let temperatures = [0.0, 5e-324, 1e-300, 1.0, 1e300, f64::INFINITY];
    let pairs: Vec<(f64, f64)> =
        losses.into_iter().flat_map(|before| losses.map(|after| (before, after))).collect();
    for rule in RULES {
        for temperature in temperatures.map(at) {
            for c in [0.0, 5e-324, 0.05, 1e300] {
                let wrong = pairs.iter().find(|(before, after)| {
                    let chance = rule.chance(temperature, c, *before, *after);
                    !(0.0..=1.0).contains(&chance)
                });
                assert!(wrong.is_none(), "{rule:?} at {temperature}, {c}: {wrong:?}");
            }
        }
    }
}

#[test]
fn a_temperature_round_trips() {
    for value in [0.0, 0.1 + 0.2, 1e-300, f64::MAX, f64::INFINITY] {
        let text = serde_json::to_string(&at(value)).unwrap();
        assert_eq!(serde_json::from_str::<Temperature>(&text).unwrap(), at(value), "{text}");
    }
    for wrong in ["-1.0", "\"hot\"", "null", "\"NaN\""] {
        assert!(serde_json::from_str::<Temperature>(wrong).is_err(), "{wrong}");
    }
}
