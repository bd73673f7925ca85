//! The distributions of the samplers, on the toy problem of thin singlets, where they can be
//! computed.

use aplanat::search::competing_clocks::{
    CompetingClocks, KnownDensity, Regeneration, RegenerationRate,
};
use aplanat::search::toy::ToyLandscape;
use aplanat::search::{Landscape, Random, SearchMethod, SearchRun, SearchSettings, Temperature};
use rand::SeedableRng as _;

fn warm() -> Temperature {
    Temperature::new(4.0).unwrap()
}

/// So hot that one singlet and two have much in common.
fn hot() -> Temperature {
    Temperature::new(40.0).unwrap()
}

/// The mean of a function over the gaps of so many singlets times their volume: midpoint rule.
fn integral(
    toy: &ToyLandscape,
    singlets: usize,
    cells: usize,
    function: impl Fn(&Vec<f64>) -> f64,
) -> f64 {
    let ranges = toy.ranges(singlets);
    let place = |index: usize, i: usize| {
        let cell = (index / cells.pow(i as u32)) % cells;
        ranges[i][0] + (ranges[i][1] - ranges[i][0]) * (cell as f64 + 0.5) / cells as f64
    };
    let count = cells.pow(singlets as u32);
    let point = |index: usize| (0..singlets).map(|i| place(index, i)).collect();
    let sum: f64 = (0..count).map(|index| function(&point(index))).sum();
    sum * ranges.iter().map(|range| range[1] - range[0]).product::<f64>() / count as f64
}

fn target(toy: &ToyLandscape, gaps: &Vec<f64>) -> f64 {
    warm().density(toy.loss(gaps))
}

#[test]
fn the_toy_gradient_agrees_with_differences() {
    let toy = ToyLandscape::one_or_two_singlets();
    for gaps in [vec![43.0], vec![12.0, 31.0], vec![40.0, 2.0]] {
        let slope = toy.loss_gradient(&gaps).unwrap();
        for i in 0..gaps.len() {
            let at = |step: f64| {
                let mut moved = gaps.clone();
                moved[i] += step;
                toy.loss(&moved)
            };
            let difference = (at(1e-4) - at(-1e-4)) / 2e-4;
            assert!((slope.gradient[i] - difference).abs() < 1e-7 * (1.0 + difference.abs()));
        }
    }
}

#[test]
fn no_density_is_lost_by_gradient_steps() {
    // What arrives everywhere is what was anywhere: the way back and its determinant are right.
    for (singlets, toy, cells) in
        [(1, ToyLandscape::one_singlet(), 20_000), (2, ToyLandscape::two_singlets(), 400)]
    {
        let all = integral(&toy, singlets, cells, |gaps| target(&toy, gaps));
        let arrived = integral(&toy, singlets, cells, |gaps| toy.arrival_density(gaps, warm()));
        assert!((arrived / all - 1.0).abs() < 2e-3, "{singlets}: {arrived} of {all}");
        let drawn = integral(&toy, singlets, 50, |gaps| toy.draw_density(gaps));
        assert!((drawn - 1.0).abs() < 1e-12);
    }
}

#[test]
fn the_exact_rate_satisfies_the_balance_equation() {
    // Arrivals and regenerations make up for what leaves: π (1 + κ) = πP + C μ with C = ∫ π κ.
    let toy = ToyLandscape::one_singlet();
    let c = 6.0;
    let kappa = |gaps: &Vec<f64>| {
        let density = target(&toy, gaps);
        toy.arrival_density(gaps, warm()) / density - 1.0 + c * toy.draw_density(gaps) / density
    };
    let leaving = integral(&toy, 1, 20_000, |gaps| target(&toy, gaps) * kappa(gaps));
    assert!((leaving / c - 1.0).abs() < 1e-3, "{leaving}");
    assert!((0..200).all(|i| kappa(&vec![30.0 + 0.2 * f64::from(i)]) > 0.0));
}

#[test]
fn competing_clocks_give_the_expected_occupation_times() {
    // With endless heat the printed rate is C everywhere: a time of 1/(1 + C) on average, and the
    // part C/(1 + C) of all places regenerates.
    let toy = ToyLandscape::one_singlet();
    let hot = Temperature::new(f64::INFINITY).unwrap();
    let (c, count) = (0.5, 100_000);
    let random = Random::seed_from_u64(3);
    let clocks =
        CompetingClocks::new(&toy, hot, RegenerationRate::AsPrinted(c), Regeneration::Draw, random)
            .unwrap();
    let (mut time, mut square, mut ended) = (0.0, 0.0, 0);
    for sample in clocks.take(count) {
        time += sample.weight;
        square += sample.weight * sample.weight;
        ended += usize::from(sample.regenerates);
    }
    let count = count as f64;
    let error = 4.0 / count.sqrt();
    assert!((time / count - 1.0 / 1.5).abs() < error, "{}", time / count);
    assert!((square / count - 2.0 / 1.5f64.powi(2)).abs() < 3.0 * error, "an exponential law");
    assert!((ended as f64 / count - 0.5 / 1.5).abs() < error);
}

#[test]
fn a_rate_of_zero_never_ends_a_descent() {
    let toy = ToyLandscape::one_singlet();
    let random = Random::seed_from_u64(5);
    let clocks = CompetingClocks::new(
        &toy,
        warm(),
        RegenerationRate::AsPrinted(0.0),
        Regeneration::Draw,
        random,
    )
    .unwrap();
    let samples: Vec<_> = clocks.take(500).collect();
    assert!(samples.iter().all(|sample| sample.weight.is_finite() && !sample.regenerates));
}

/// Many chains of Metropolis and Hastings on a toy: for each the mean of a function of its points,
/// the first fifth of them left out.
fn walked(
    (toy, start): (&ToyLandscape, Vec<f64>),
    temperature: Temperature,
    [chains, rounds]: [usize; 2],
    function: impl Fn(&Vec<f64>) -> f64,
) -> Vec<f64> {
    let mut settings = SearchSettings {
        method: SearchMethod::Metropolis,
        temperature: Some(temperature),
        chains,
        gradients: None,
        longest: 10_000,
        ..SearchSettings::default()
    };
    settings.metropolis.epsilon = 8.0;
    settings.metropolis.mutation = 0.3;
    let mut run = SearchRun::new(toy, start, &settings).unwrap();
    let mut sums = vec![0.0; chains];
    for round in 0..rounds {
        run.round(toy);
        if round >= rounds / 5 {
            for (sum, chain) in sums.iter_mut().zip(run.chains()) {
                *sum += function(chain.position().unwrap().0);
            }
        }
    }
    sums.iter().map(|sum| sum / (0.8 * rounds as f64)).collect()
}

/// The deviation of the mean of independent numbers from its expectation, in standard errors.
fn deviation(values: &[f64], expected: f64) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    println!("{mean} ± {} for {expected}", (square / count).sqrt());
    (mean - expected) / (square / count).sqrt()
}

#[test]
fn metropolis_samples_its_target_within_a_structure() {
    let toy = ToyLandscape::one_singlet();
    let spread = |gaps: &Vec<f64>| (gaps[0] - 50.0).powi(2);
    let all = integral(&toy, 1, 20_000, |gaps| target(&toy, gaps));
    let expected = integral(&toy, 1, 20_000, |gaps| spread(gaps) * target(&toy, gaps)) / all;
    let found = walked((&toy, vec![45.0]), warm(), [300, 600], spread);
    assert!(deviation(&found, expected).abs() < 3.5);
    // A tenth more is told apart.
    assert!(deviation(&found, 1.1 * expected).abs() > 3.5);
}

#[test]
fn metropolis_jumps_between_structures_as_often_as_it_should() {
    let ranges = [[5.0, 10.0], [0.0, 60.0]];
    let toy =
        ToyLandscape { alone: ranges[1], pair: ranges, ..ToyLandscape::one_or_two_singlets() };
    let volume =
        |singlets, cells| integral(&toy, singlets, cells, |gaps| hot().density(toy.loss(gaps)));
    let (one, two) = (volume(1, 20_000), volume(2, 400));
    let alone = |gaps: &Vec<f64>| if gaps.len() == 1 { 1.0 } else { 0.0 };
    let found = walked((&toy, vec![7.5, 25.0]), hot(), [200, 1500], alone);
    let expected = one / (one + two);
    assert!(deviation(&found, expected).abs() < 3.5);
    assert!(deviation(&found, 1.2 * expected).abs() > 3.5);
}
