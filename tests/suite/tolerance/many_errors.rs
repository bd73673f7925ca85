//! Thousands of errors, the sweep that tells all of them, and analyses that are told to stop.

use super::hard_cases::scene as reference_scene;
use super::reference::{assert_close, lenses, tolerances};
use crate::merit::bundled;
use aplanat::lens::{
    ErrorDistribution, Perturbation, PerturbationKind, Tolerance, ToleranceGrade, ToleranceSheet,
};
use aplanat::tolerance::{
    Compensation, ErrorModel, FocusTreatment, QuadraticForm, RayEffects, SecondDerivatives,
    ToleranceError, ToleranceRequest, ToleranceScene, graded_sheet, sensitivities,
};
use std::sync::atomic::{AtomicUsize, Ordering};

fn never() -> bool {
    false
}

/// A zoom lens with the errors of a class, and every group of its surfaces that moves or tilts.
fn zoom(groups: bool) -> (ToleranceScene, ToleranceSheet) {
    let lens = bundled("zoom_nikkor_28_80");
    let scene = ToleranceScene::new(&lens, 0, 0.1).unwrap();
    let mut sheet = graded_sheet(&lens, &scene.lens, ToleranceGrade::Commercial);
    let last = lens.surfaces.len() - 1;
    let distribution = ErrorDistribution::NormalCut;
    for first in (0..last).filter(|_| groups) {
        for (kind, half_range) in
            [(PerturbationKind::ElementDecenterY, 0.01), (PerturbationKind::ElementTiltX, 1e-4)]
        {
            let group = |last| Perturbation { kind, first, last };
            let error = |last| Tolerance { error: group(last), half_range, distribution };
            sheet.errors.extend((first + 1..=last).map(error));
        }
    }
    (scene, sheet)
}

fn model(scene: &ToleranceScene, sheet: &ToleranceSheet) -> ErrorModel {
    ErrorModel::new(scene, sheet, SecondDerivatives::Neglected, &never).unwrap()
}

/// Ten thousand errors of a zoom lens: each tolerance is the sum of several with a part of its variance,
/// so that the expectation is that of the few.
#[test]
fn ten_thousand_errors_of_a_zoom_lens_are_as_cheap_as_its_rays() {
    let (scene, few) = zoom(true);
    let parts = 10_000_usize.div_ceil(few.errors.len());
    let part = |t: &Tolerance| Tolerance { half_range: t.half_range / (parts as f64).sqrt(), ..*t };
    let errors = (0..parts).flat_map(|_| few.errors.iter().map(part)).collect();
    let many = ToleranceSheet::of_errors(errors);
    assert!(many.errors.len() >= 10_000 && few.errors.len() > 300);
    let [made, same] = [&many, &few].map(|sheet| model(&scene, sheet));
    for i in 0..2 {
        let [form, few_form] = [&made.forms[i], &same.forms[i]];
        let expected = few_form.expectation(&few).unwrap();
        let found = form.expectation(&many).unwrap();
        assert_close(found, expected, 1e-9 * expected, "expectation");
        assert_eq!(form.first.len(), many.errors.len());
        let values: Vec<f64> = many.errors.iter().map(|t| 0.5 * t.half_range).collect();
        let sums: Vec<f64> =
            few.errors.iter().map(|t| 0.5 * t.half_range * (parts as f64).sqrt()).collect();
        let (found, expected) = (form.at(&values), few_form.at(&sums));
        assert_close(found, expected, 1e-9 * expected, "one lens");
    }
}

/// The sweep gives the form of second-order jets but for the second derivatives of rays, and with these
/// the same form.
#[test]
fn the_sweep_gives_the_form_of_jets() {
    for number in [0, 2] {
        let scene = reference_scene(number, (2, 6));
        let all = tolerances(&lenses()[number], ErrorDistribution::Normal);
        let sheet = ToleranceSheet::of_errors(all.into_iter().step_by(3).collect());
        let errors: Vec<Perturbation> = sheet.errors.iter().map(|t| t.error).collect();
        let exact = sensitivities(&scene.lens, &scene.beam, scene.options, &errors).unwrap();
        let compensation = Compensation::new(&scene, &sheet).unwrap();
        let forms = [SecondDerivatives::Traced, SecondDerivatives::Neglected].map(|second| {
            let effects = RayEffects::new(&scene, &errors, second, &never).unwrap();
            [FocusTreatment::Fixed, FocusTreatment::Refocused]
                .map(|focus| QuadraticForm::new(&effects, focus, &compensation))
        });
        let [traced, swept] = &forms;
        for (i, own) in exact.iter().enumerate() {
            for (plane, jet) in [own.mean_square(), own.mean_square_focused()].iter().enumerate() {
                let form = &traced[plane];
                let scale = jet.first.abs().max((jet.value * jet.second).abs().sqrt());
                assert_close(form.nominal, jet.value, 1e-10 * jet.value, "nominal");
                // What symmetry makes 0 is rounding.
                let zero = 1e-12 * jet.value;
                assert_close(form.first[i], jet.first, 1e-8 * scale + zero, "first");
                let floor = 1e-8 * own.mean_square().second.abs() + zero;
                assert_close(form.second.of(i, i), jet.second, floor, "second");
            }
        }
        for (plane, share) in [(0, 1e-3), (1, 5e-3)] {
            let [exact, found] =
                [&traced[plane], &swept[plane]].map(|form| form.expectation(&sheet).unwrap());
            assert_close(found, exact, share * exact, "expectation");
        }
    }
}

/// Wherever it is stopped, an analysis ends without a result or with fewer lenses.
#[test]
fn an_analysis_stops_in_every_part() {
    let (scene, mut sheet) = zoom(false);
    sheet.errors.truncate(12);
    let request = ToleranceRequest { seed: 1, samples: 4, limit: None };
    let model = ErrorModel::new(&scene, &sheet, SecondDerivatives::Neglected, &|| true);
    let stopped = model.map(|own| own.pupils);
    assert!(matches!(stopped, Err(ToleranceError::Stopped)), "{stopped:?}");
    let lens = bundled("zoom_nikkor_28_80");
    let scene_too = ToleranceScene::new_until(&lens, 0, 0.1, &|| true);
    assert!(matches!(scene_too, Err(ToleranceError::Stopped)));
    // The number of times that the parts of an analysis ask, and one that is stopped at each of some.
    let run = |most: usize| {
        let asked = AtomicUsize::new(0);
        let stop = || asked.fetch_add(1, Ordering::Relaxed) >= most;
        let model = ErrorModel::new(&scene, &sheet, SecondDerivatives::Traced, &stop);
        let model_asked = asked.load(Ordering::Relaxed);
        let found = model.and_then(|model| model.analyze(&scene, &sheet, request, &stop));
        (found.map(|found| found.samples), model_asked, asked.into_inner())
    };
    let (all, of_model, total) = run(usize::MAX);
    assert_eq!(all, Ok(4));
    assert!(of_model > sheet.errors.len() && total > of_model + 100, "{of_model} {total}");
    for most in [0, 2, of_model - 1, of_model + 1, of_model + 50] {
        assert_eq!(run(most).0, Err(ToleranceError::Stopped), "{most}");
    }
    assert!(run(total - 2).0.unwrap() < 4);
}
