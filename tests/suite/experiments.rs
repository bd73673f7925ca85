//! Every experiment at small effort: its claims hold, its data and plots exist, it can be stopped;
//! and the checks can fail.

use aplanat::experiments::{
    self, ALL, DataTable, Effort, ExperimentError, ExperimentOutcome, TableCell,
};
use std::collections::BTreeSet;
use std::ops::ControlFlow;

/// Runs an experiment and checks what all of them have in common.
fn outcome(id: &str) -> ExperimentOutcome {
    let mut last = 0.0;
    let study = experiments::find(id).unwrap();
    let found = (study.run)(Effort::Small, &mut |progress| {
        assert!(progress.done >= last && progress.done <= 1.0, "{id}: {progress:?} after {last}");
        last = progress.done;
        ControlFlow::Continue(())
    });
    let outcome = found.unwrap_or_else(|ended| panic!("{id}: {ended}"));
    for claim in &outcome.claims {
        println!("{id}: {} {:e} ± {:.1e} {}", claim.says, claim.value, claim.error, claim.unit);
    }
    let failed: Vec<_> = outcome.failed().collect();
    assert!(failed.is_empty(), "{id}: {failed:#?}");
    assert!(!outcome.claims.is_empty() && !outcome.tables.is_empty(), "{id} shows nothing");
    assert!(!outcome.pictures.is_empty() && outcome.rays > 0, "{id} draws nothing");
    for table in &outcome.tables {
        let ragged = table.rows.iter().any(|row| row.len() != table.columns.len());
        assert!(!table.rows.is_empty() && !ragged, "{id}: table {}", table.name);
    }
    for picture in &outcome.pictures {
        let inked = picture.canvas.pixels().iter().filter(|level| **level < 0xff).count();
        assert!(inked > 1000, "{id}: picture {} is empty", picture.name);
    }
    outcome
}

/// A column of a table, as numbers.
fn column(table: &DataTable, name: &str) -> Vec<f64> {
    let place = table.columns.iter().position(|column| *column == name).unwrap();
    let number = |row: &Vec<TableCell>| match &row[place] {
        TableCell::Number(value) => *value,
        TableCell::Word(word) => panic!("{name} is `{word}`"),
    };
    table.rows.iter().map(number).collect()
}

#[test]
fn experiment_ids_are_unique() {
    let ids: BTreeSet<&str> = ALL.iter().map(|study| study.id).collect();
    assert_eq!(ids.len(), ALL.len());
    assert!(experiments::find("no such figure").is_none());
}

#[test]
fn an_experiment_stops_on_request() {
    for study in ALL {
        let mut asked = 0;
        let ended = (study.run)(Effort::Small, &mut |_| {
            asked += 1;
            if asked < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        assert_eq!((ended.unwrap_err(), asked), (ExperimentError::Stopped, 3), "{}", study.id);
    }
}

#[test]
fn the_stop_closes_with_the_unbiased_gradient_alone() {
    let outcome = outcome("3.3");
    let [unbiased, biased] =
        ["unbiased_radius_mm", "biased_radius_mm"].map(|name| column(&outcome.tables[0], name));
    assert!(unbiased.windows(2).all(|pair| pair[1] < pair[0]));
    assert!(unbiased[unbiased.len() - 1] < 0.1 * unbiased[0]);
    assert!(biased.iter().all(|radius| *radius == biased[0]) && biased[0] == unbiased[0]);
}

#[test]
fn the_pupil_gains_corners_and_loses_area() {
    let outcome = outcome("3.4");
    let [corners, area, bitmap] =
        ["corners", "area_mm2", "bitmap_area_mm2"].map(|name| column(&outcome.tables[0], name));
    let last = corners.len() - 1;
    assert!(corners[0] == 0.0 && corners[last] > 0.0 && area[last] < 0.9 * area[0]);
    assert!(area.iter().zip(&bitmap).all(|(a, b)| (a / b - 1.0).abs() < 2e-3));
}

#[test]
fn image_derivatives_include_terms_missing_from_biased_ones() {
    let outcome = outcome("3.5");
    let names = ["by_stop_boundary_mm", "by_stop_difference_mm", "by_stop_biased_mm"];
    let [boundary, difference, biased] = names.map(|name| column(&outcome.tables[0], name));
    assert!(biased.iter().all(|v| *v == 0.0) && difference.iter().all(|v| *v > 0.1));
    assert!(boundary.iter().zip(&difference).all(|(a, b)| (a / b - 1.0).abs() < 1e-3));
}

#[test]
fn the_unbiased_front_dominates_the_biased_designs() {
    let outcome = outcome("3.6");
    assert!(outcome.lenses.len() > 4);
    assert!(outcome.lenses.iter().all(|(_, lens)| lens.check().is_ok()));
}

#[test]
fn a_fast_lens_has_less_noise_by_candle_light() {
    let outcome = outcome("3.7");
    let shares = ["darkest_share", "brightest_share"].map(|name| column(&outcome.tables[1], name));
    assert!(shares.iter().all(|shares| (shares.iter().sum::<f64>() - 1.0).abs() < 1e-12));
    let numbers = column(&outcome.tables[0], "grey_number");
    assert!(numbers[0] < numbers[1], "{numbers:?}");
}

#[test]
fn a_fast_lens_resolves_moving_targets_better() {
    let outcome = outcome("3.8");
    let [dark, bright] =
        ["dark_moving", "bright_moving"].map(|name| column(&outcome.tables[1], name));
    assert!(dark[0] < bright[0], "{} {}", dark[0], bright[0]);
}

#[test]
fn unbiased_gradients_reduce_vignetting_in_the_corner() {
    let outcome = outcome("3.9");
    let [biased, unbiased] =
        ["biased_irradiance", "unbiased_irradiance"].map(|name| column(&outcome.tables[0], name));
    assert!(unbiased[unbiased.len() - 1] > biased[biased.len() - 1]);
}

#[test]
fn a_zoom_lens_gets_sharper_at_every_position() {
    let outcome = outcome("3.10");
    let [start, now] = ["start_blur_mm", "blur_mm"].map(|name| column(&outcome.tables[0], name));
    assert!(start.iter().zip(&now).all(|(start, now)| now < start));
}

/// The rows of a table in which a column has this word.
fn rows_with(table: &DataTable, name: &str, word: &str) -> DataTable {
    let place = table.columns.iter().position(|column| *column == name).unwrap();
    let rows = table.rows.iter().filter(|row| row[place] == TableCell::Word(word.to_owned()));
    DataTable { rows: rows.cloned().collect(), ..table.clone() }
}

#[test]
fn restore_finds_better_lenses_than_metropolis() {
    let outcome = outcome("4.4");
    let curves = &outcome.tables[1];
    for sampler in ["RESTORE", "Metropolis-Hastings"] {
        let own = rows_with(curves, "sampler", sampler);
        let [least, median, most] = ["least", "median", "most"].map(|name| column(&own, name));
        assert!(median.windows(2).all(|pair| pair[1] <= pair[0]), "{sampler}");
        let ordered = |i: usize| least[i] <= median[i] && median[i] <= most[i];
        assert!((0..median.len()).all(ordered), "{sampler}");
    }
}

#[test]
fn restore_finds_better_lenses_than_brute_force() {
    let outcome = outcome("4.5");
    let ends = rows_with(&outcome.tables[0], "sampler", "brute force");
    // The last move may exceed them, by a step that was halved again and again.
    assert!(column(&ends, "gradients").iter().all(|gradients| *gradients <= 200.0 + 32.0));
    assert!(outcome.lenses.iter().all(|(_, lens)| lens.check().is_ok()));
}

#[test]
fn fractions_of_better_lenses_are_counted_with_projection_and_without() {
    let outcome = outcome("4.6");
    let shares = column(&outcome.tables[0], "share");
    assert!(shares.iter().all(|share| (0.0..=1.0).contains(share)), "{shares:?}");
}

#[test]
fn designs_with_mutations_join_the_front_of_the_sweep() {
    let outcome = outcome("4.7");
    assert!(outcome.lenses.iter().all(|(_, lens)| lens.check().is_ok()));
}

#[test]
fn a_search_sharpens_the_lens_of_1962() {
    let outcome = outcome("teaser");
    let found = rows_with(&outcome.tables[0], "design", "found");
    assert_eq!(column(&found, "rms_mm").len(), 4);
}

#[test]
fn the_exact_rate_samples_the_target_and_the_printed_one_does_not() {
    let outcome = outcome("4.1");
    let [time, count] =
        ["distance_by_time", "distance_by_count"].map(|name| column(&outcome.tables[0], name));
    // The exact rate is the first process on each toy.
    for first in [0, time.len() / 2] {
        assert!(time[first] < 0.02 && count[first] > 0.04, "{} {}", time[first], count[first]);
        assert!(time[first + 1..time.len() / 2 + first].iter().all(|other| *other > time[first]));
    }
}

#[test]
fn the_adjoint_keeps_as_much_for_many_steps_as_for_few() {
    let outcome = outcome("5.3");
    let [tape, rays, steps] =
        ["tape_bytes", "ray_bytes", "steps"].map(|name| column(&outcome.tables[0], name));
    assert!(tape[3] > 7.0 * tape[0] && steps[3] > 7.0 * steps[0]);
    assert!(rays.iter().all(|bytes| *bytes == rays[0]));
}

#[test]
fn a_display_forms_one_image_per_beam() {
    let outcome = outcome("5.4");
    let [correlation, light] =
        ["correlation", "light"].map(|name| column(&outcome.tables[0], name));
    assert!(correlation.len() == 2 && light.iter().all(|light| *light > 0.9 && *light < 1.001));
}

#[test]
fn finer_fields_form_sharper_images() {
    let outcome = outcome("5.5");
    let tricubic = rows_with(&outcome.tables[0], "field", "tricubic");
    let quality = column(&tricubic, "quality_db");
    assert!(quality.windows(2).all(|pair| pair[1] > pair[0]), "{quality:?}");
    let loss = column(&outcome.tables[0], "loss_quality_db");
    assert!(loss.len() == 6 && loss.iter().all(|quality| *quality > 5.0), "{loss:?}");
    assert!(outcome.reasons.is_empty(), "every gain is reached: {:?}", outcome.reasons);
}

#[test]
fn a_coarse_multifocal_display_forms_an_image_on_three_screens() {
    let outcome = outcome("5.6");
    assert_eq!(column(&outcome.tables[0], "quality_db").len(), 3);
}

#[test]
fn caustics_are_rings_near_and_far() {
    let outcome = outcome("5.7");
    let radius = column(&outcome.tables[1], "radius_mm");
    assert!(radius.windows(2).all(|pair| pair[1] > pair[0]), "{radius:?}");
}

#[test]
fn known_grin_lenses_are_recovered() {
    let outcome = outcome("5.8");
    let relative = column(&outcome.tables[0], "relative");
    let shape = column(&outcome.tables[0], "without_offset");
    assert!(relative[0] < 1e-4 && shape.iter().zip(&relative).all(|(a, b)| a <= b));
}

#[test]
fn a_fibre_focuses_better_than_the_parabolic_one() {
    let outcome = outcome("5.9");
    let [ours, theirs] =
        ["spot_mm", "parabola_spot_mm"].map(|name| column(&outcome.tables[0], name));
    // In the parabolic fibre a ray at height h is h cos(z/η(h)) away from the axis.
    let blur = |z: f64| {
        let heights = (0..40).map(|i| 0.95 * (f64::from(i) + 0.5) / 40.0);
        let squares = heights.map(|h| (h * (z / (2.0 - h * h).sqrt()).cos()).powi(2));
        (squares.sum::<f64>() / 40.0).sqrt()
    };
    for (k, theirs) in theirs.iter().enumerate() {
        let planes = (0..3000).map(|i| (2 * k + 1) as f64 * (1.4 + 3e-4 * f64::from(i)));
        let best = planes.map(blur).fold(f64::INFINITY, f64::min);
        assert!((theirs / best - 1.0).abs() < 1e-3, "{theirs} {best}");
    }
    assert!(ours.iter().zip(&theirs).all(|(ours, theirs)| 1000.0 * ours < *theirs));
}

#[test]
fn curved_rays_find_a_strong_plume_where_straight_lines_do_not() {
    let outcome = outcome("5.10");
    let column = |name| column(&outcome.tables[0], name);
    let (adjoint, chords) = (column("adjoint_of_contrast"), column("chords_of_contrast"));
    let (last, gradients) = (column("chords_last_of_contrast"), column("gradients_of_contrast"));
    println!("5.10: {adjoint:?} {chords:?} {last:?} {gradients:?}");
    // The best iterate of straight lines is no worse than their last one.
    assert!((0..2).all(|i| chords[i] <= last[i] && gradients[i].is_finite()));
    let deflection = column("deflection_deg");
    assert!(deflection[0] < 0.1 && deflection[1] > 10.0, "{deflection:?}");
}
