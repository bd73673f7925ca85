//! The expected spot of lenses that are made as a term of a merit function: against sensitivities by
//! second-order jets of other rays, and its hard cases.

use super::reference::assert_close;
use crate::merit::{bundled, check, step, vary};
use aplanat::lens::{
    AdjustedPart, Compensator, ErrorCorrelation, ErrorDistribution, Lens, Perturbation,
    PerturbationKind, Quantity, Tolerance, ToleranceGrade, ToleranceSheet,
};
use aplanat::merit::{DerivativeLevel, Goal, LimitTreatment, Merit, PupilEdge, Term, WeightedTerm};
use aplanat::tolerance::{
    ErrorModel, SecondDerivatives, Sensitivity, ToleranceScene, graded_sheet, sensitivities,
};

const GRADED: Term = Term::AsBuilt { grade: Some(ToleranceGrade::Commercial) };
const OWN: Term = Term::AsBuilt { grade: None };

fn goal(term: Term) -> Goal {
    Goal {
        terms: vec![WeightedTerm::new(term, 1.0)],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::Frozen,
    }
}

/// A lens with a variable, for a merit function has to have one.
fn lens(name: &str) -> Lens {
    let mut lens = bundled(name);
    lens.variables.clear();
    vary(&mut lens, 0, Quantity::Curvature);
    lens
}

fn value(lens: &Lens, term: Term, tolerance: f64) -> f64 {
    let merit = Merit::new(lens, &goal(term), tolerance).unwrap();
    merit.value(&merit.values(lens)).unwrap()
}

/// What errors of making add to the spot of a lens, of rays by which its spot is good to a tolerance: the same ones
/// for all errors.
fn growth(lens: &Lens, term: Term, tolerance: f64) -> f64 {
    value(lens, term, tolerance) - value(lens, Term::Spot, tolerance)
}

/// Rays that are the same for tolerances that come to the same.
const SAME_RAYS: f64 = 1e-4;
/// Rays of which no more are needed.
const EXACT: f64 = 1e-9;

/// A lens with the rays by which jets judge it, and its spot.
struct JetLens {
    lens: Lens,
    scene: ToleranceScene,
    spot: f64,
}

impl JetLens {
    fn new(lens: &Lens) -> Self {
        let scene = ToleranceScene::new(lens, 0, EXACT).unwrap();
        Self { lens: lens.clone(), scene, spot: value(lens, Term::Spot, EXACT) }
    }

    /// What errors of making add to the spot by the term.
    fn growth(&self, sheet: &ToleranceSheet) -> f64 {
        let made = Lens { tolerances: Some(sheet.clone()), ..self.lens.clone() };
        value(&made, OWN, EXACT) - self.spot
    }

    /// `Σ σ² ⟨|ε|²⟩` of the rays of a scene, and less `⟨s·ε⟩²/⟨|s|²⟩`, which refocusing takes away.
    fn growth_by_jets(&self, sheet: &ToleranceSheet) -> [f64; 2] {
        let scene = &self.scene;
        let errors: Vec<Perturbation> = sheet.errors.iter().map(|t| t.error).collect();
        let found = sensitivities(&scene.lens, &scene.beam, scene.options, &errors).unwrap();
        let fields = scene.beam.fields.iter();
        let weights: Vec<f64> = fields
            .flat_map(|field| {
                let weights = field.colours.iter().flat_map(|colour| &colour.weights);
                weights.map(|weight| field.weight * weight)
            })
            .collect();
        let mean = |found: &Sensitivity, of: &dyn Fn([f64; 2], [f64; 2]) -> f64| -> f64 {
            let pairs = found.rays.iter().zip(&weights);
            pairs.map(|(ray, weight)| weight * of(ray.displacement, ray.slope)).sum()
        };
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let mut sums = [0.0; 2];
        for (tolerance, found) in sheet.errors.iter().zip(&found) {
            let square = mean(found, &|e, _| dot(e, e));
            let along = mean(found, &|e, s| dot(e, s)).powi(2) / mean(found, &|_, s| dot(s, s));
            let variance = tolerance.deviation().powi(2);
            sums[0] += variance * square;
            sums[1] += variance * (square - along);
        }
        sums
    }
}

fn graded(lens: &Lens) -> ToleranceSheet {
    let scene = ToleranceScene::new(lens, 0, 1e-3).unwrap();
    graded_sheet(lens, &scene.lens, ToleranceGrade::Commercial)
}

/// What errors do is judged on fewer rays than the spot: the error of the term counts that.
#[test]
fn the_error_of_the_term_covers_that_of_fewer_rays() {
    for name in ["cooke_triplet_100_f27", "phone_us7558005_1", "double_gauss_canon_ef50_f18"] {
        let lens = lens(name);
        let exact = value(&lens, GRADED, 1e-8);
        for tolerance in [1e-2, 1e-3, 1e-4] {
            let merit = Merit::new(&lens, &goal(GRADED), tolerance).unwrap();
            let found = merit.terms(&merit.values(&lens)).unwrap().remove(0);
            let spot_rays: usize = merit.spot_samplings().iter().map(|spot| spot.rays).sum();
            let apart = (found.value - exact).abs();
            assert!(apart <= found.error, "{name} to {tolerance}: {apart} beside {}", found.error);
            assert!(
                found.error <= 3.0 * tolerance * exact && found.reached,
                "{name}: {}",
                found.error
            );
            assert!(found.rays > spot_rays && found.rays < 2 * spot_rays, "{name}: {}", found.rays);
        }
    }
}

/// Every kind of error by itself, on a double Gauss with cemented elements; a group of two of them.
#[test]
fn each_kind_of_error_adds_to_the_term_what_jets_say() {
    let mut all = lens("double_gauss_rudolph_50");
    all.surfaces[2].conic = -0.4;
    // The axis and the edge of the field.
    all.fields.values.remove(1);
    let mut one = all.clone();
    one.wavelengths = vec![all.wavelengths[all.primary()]];
    let [all, one] = [all, one].map(|lens| JetLens::new(&lens));
    for kind in PerturbationKind::ALL {
        // Dispersion and index need the colours; what moves a surface does not tell them apart.
        let of_colours = matches!(
            kind,
            PerturbationKind::Abbe | PerturbationKind::Index | PerturbationKind::Curvature
        );
        let lens = if of_colours { &all } else { &one };
        let (first, last) = if kind.moves_a_body() { (2, 6) } else { (2, 2) };
        let error = Perturbation { kind, first, last };
        let half_range = if kind.is_angle() { 1e-3 } else { 1e-2 };
        let distribution = ErrorDistribution::Uniform;
        let free = ToleranceSheet::of_errors(vec![Tolerance { error, half_range, distribution }]);
        let held = ToleranceSheet { focus_travel: Some(0.0), ..free.clone() };
        let [fixed, refocused] = lens.growth_by_jets(&free);
        for (sheet, expected) in [(free, refocused), (held, fixed)] {
            // What refocusing takes away nearly wholly is a difference.
            let scale = expected.abs() + 1e-5 * fixed;
            assert_close(lens.growth(&sheet), expected, 1e-6 * scale, kind.name());
        }
    }
}

/// A whole class of tolerances, of lenses with and without cemented elements and aspheres, one of them in all its
/// colours.
#[test]
fn a_class_of_tolerances_adds_to_the_term_what_jets_say() {
    for name in ["tessar_50_f28", "cooke_triplet_100_f27", "double_gauss_rudolph_50"] {
        let mut lens = lens(name);
        if name != "tessar_50_f28" {
            lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
        }
        let own = JetLens::new(&lens);
        let [_, expected] = own.growth_by_jets(&graded(&lens));
        assert_close(value(&lens, GRADED, EXACT) - own.spot, expected, 1e-6 * expected, name);
    }
}

/// A sheet in which every error stands many times with a part of its variance.
#[test]
fn ten_thousand_tolerances_are_as_many_as_their_sum() {
    let mut lens = lens("double_gauss_rudolph_50");
    let once = graded(&lens);
    let small = |t: &Tolerance| Tolerance { half_range: t.half_range / 130_f64.sqrt(), ..*t };
    let errors: Vec<Tolerance> =
        once.errors.iter().flat_map(|t| std::iter::repeat_n(small(t), 130)).collect();
    assert!(errors.len() > 10_000, "{}", errors.len());
    let expected = growth(&lens, GRADED, SAME_RAYS);
    lens.tolerances = Some(ToleranceSheet::of_errors(errors));
    assert_close(growth(&lens, OWN, SAME_RAYS), expected, 1e-9 * expected, "sum");
}

/// Between a free focus and a fixed one; a tolerance of zero adds nothing.
#[test]
fn a_focus_of_bounded_travel_wins_back_a_part() {
    let lens = lens("double_gauss_rudolph_50");
    let sheet = graded(&lens);
    let at = |focus_travel: Option<f64>| {
        let tolerances = Some(ToleranceSheet { focus_travel, ..sheet.clone() });
        growth(&Lens { tolerances, ..lens.clone() }, OWN, SAME_RAYS)
    };
    let travels = [None, Some(10.0), Some(0.1), Some(0.02), Some(0.0)].map(at);
    assert_close(travels[1], travels[0], 1e-9 * travels[0], "wide");
    assert!(travels.windows(2).all(|pair| pair[1] >= pair[0] * (1.0 - 1e-9)), "{travels:?}");
    assert!(travels[4] > travels[3] && travels[3] > travels[2], "{travels:?}");
    assert!(travels[2] > 2.0 * travels[0], "{travels:?}");
    let mut none = lens;
    let errors = sheet.errors.iter().map(|t| Tolerance { half_range: 0.0, ..*t }).collect();
    none.tolerances = Some(ToleranceSheet::of_errors(errors));
    let nothing = growth(&none, OWN, SAME_RAYS);
    assert!(nothing.abs() < 1e-12 * travels[0], "{nothing}");
}

/// The derivatives of errors that depend on the lens: rolls about a centre of curvature, groups,
/// gaps that take up others, a focus at its stop.
#[test]
fn the_term_has_the_derivative_of_its_value_for_every_error() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
    lens.variables.clear();
    for surface in [1, 2, 5, 8] {
        vary(&mut lens, surface, Quantity::Curvature);
        vary(&mut lens, surface, Quantity::Thickness);
    }
    vary(&mut lens, 2, Quantity::Conic);
    vary(&mut lens, 3, Quantity::Asphere(1));
    let error = |kind: PerturbationKind, first: usize, last: usize, half_range: f64| Tolerance {
        error: Perturbation { kind, first, last },
        half_range,
        distribution: ErrorDistribution::Parabolic,
    };
    let errors = vec![
        error(PerturbationKind::ElementRollX, 2, 3, 2e-3),
        error(PerturbationKind::ElementRollY, 1, 4, 1e-3),
        error(PerturbationKind::ElementTiltX, 1, 8, 1e-3),
        error(PerturbationKind::ThicknessAdjusted, 2, 2, 0.1),
        error(PerturbationKind::Asphere, 3, 3, 1e-6),
        error(PerturbationKind::Conic, 2, 2, 0.02),
        error(PerturbationKind::Irregularity, 5, 5, 1e-3),
        error(PerturbationKind::AsphereSlope, 5, 5, 1e-4),
        error(PerturbationKind::Thickness, 4, 4, 0.05),
    ];
    lens.tolerances =
        Some(ToleranceSheet { errors, focus_travel: Some(0.03), ..ToleranceSheet::default() });
    for pupil in [PupilEdge::Frozen, PupilEdge::Moving] {
        check(&lens, OWN, pupil, |quantity| 0.3 * step(quantity));
    }
}

/// Elements that share all of their decentres and tilts move as one group would, and the term has the
/// derivative of its value for errors that share a part, lever arms and gaps included.
#[test]
fn correlated_errors_are_those_of_a_group() {
    let mut lens = lens("double_gauss_rudolph_50");
    lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
    let error = |kind: PerturbationKind, first: usize, last: usize, half_range: f64| Tolerance {
        error: Perturbation { kind, first, last },
        half_range,
        distribution: ErrorDistribution::Normal,
    };
    let decenter = PerturbationKind::ElementDecenterY;
    let apart = vec![error(decenter, 2, 3, 0.05), error(decenter, 4, 6, 0.05)];
    let pair = |coefficient: f64| ErrorCorrelation { errors: vec![0, 1], coefficient };
    let with = |errors: Vec<Tolerance>, correlations: Vec<ErrorCorrelation>| {
        let sheet = ToleranceSheet { correlations, ..ToleranceSheet::of_errors(errors) };
        growth(&Lens { tolerances: Some(sheet), ..lens.clone() }, OWN, EXACT)
    };
    let group = with(vec![error(decenter, 2, 6, 0.05)], Vec::new());
    let [none, half, all] =
        [0.0, 0.5, 1.0].map(|coefficient| with(apart.clone(), vec![pair(coefficient)]));
    assert_close(all, group, 1e-9 * group, "group");
    assert_close(2.0 * half, none + all, 1e-9 * group, "half");
    lens.variables.clear();
    for surface in [1, 2, 5] {
        vary(&mut lens, surface, Quantity::Curvature);
        vary(&mut lens, surface, Quantity::Thickness);
    }
    let errors = vec![
        error(PerturbationKind::ElementRollX, 2, 3, 2e-3),
        error(PerturbationKind::ElementTiltX, 1, 8, 1e-3),
        error(PerturbationKind::Thickness, 4, 4, 0.05),
        error(PerturbationKind::Thickness, 2, 2, 0.05),
    ];
    let correlations = vec![pair(0.6), ErrorCorrelation { errors: vec![2, 3], coefficient: -1.0 }];
    lens.tolerances = Some(ToleranceSheet { correlations, ..ToleranceSheet::of_errors(errors) });
    check(&lens, OWN, PupilEdge::Frozen, |quantity| 0.3 * step(quantity));
}

#[test]
fn a_lens_that_the_term_does_not_apply_to_is_refused() {
    let refusal = |lens: &Lens, term: Term| {
        let error = Merit::new(lens, &goal(term), 1e-3).unwrap_err();
        assert!(error.to_string().contains("as_built"), "{error}");
        error.to_string()
    };
    let mut plain = lens("cooke_triplet_100_f27");
    plain.tolerances = None;
    assert!(refusal(&plain, OWN).contains("no tolerances"));
    let mut tilted = plain.clone();
    tilted.surfaces[2].tilt = [1.0, 0.0];
    assert!(refusal(&tilted, GRADED).contains("tilted"));
    let mut grin = bundled("grin_rod_melles_griot");
    vary(&mut grin, 0, Quantity::Thickness);
    assert!(refusal(&grin, GRADED).contains("GRIN"));
    let error = Perturbation::of_surface(PerturbationKind::ThicknessAdjusted, 6);
    let distribution = ErrorDistribution::Normal;
    let errors = vec![Tolerance { error, half_range: 0.1, distribution }];
    plain.tolerances = Some(ToleranceSheet::of_errors(errors));
    assert!(refusal(&plain, OWN).contains("not possible"));
    let compensators = vec![Compensator { part: AdjustedPart::SensorTiltX, travel: 0.01 }];
    plain.tolerances = Some(ToleranceSheet { compensators, ..ToleranceSheet::default() });
    assert!(refusal(&plain, OWN).contains("compensators besides focus"));
}

/// The Gauss-Newton matrix has the growth as one residual and gives the same gradient.
#[test]
fn the_normal_matrix_of_the_term_is_that_of_the_spot_and_one_residual() {
    let lens = lens("tessar_50_f28");
    let at = |term: Term| {
        let merit = Merit::new(&lens, &goal(term), 1e-6).unwrap();
        merit.evaluate(&merit.values(&lens), DerivativeLevel::Normal).unwrap()
    };
    let (made, nominal) = (at(GRADED), at(Term::Spot));
    let (growth, slope) = (made.value - nominal.value, made.gradient[0] - nominal.gradient[0]);
    let expected = nominal.normal[(0, 0)] + slope * slope / (4.0 * growth);
    assert_close(made.normal[(0, 0)], expected, 1e-9 * expected, "normal");
}

/// First derivatives and growths by the sweep, which traces only rays that symmetry does not give, are
/// those by jets of all rays, error by error.
#[test]
fn one_sweep_back_gives_the_derivatives_by_every_error() {
    for name in ["double_gauss_rudolph_50", "phone_us7558005_1"] {
        let lens = lens(name);
        let scene = ToleranceScene::new(&lens, 0, 1e-4).unwrap();
        let sheet = graded_sheet(&lens, &scene.lens, ToleranceGrade::Precision);
        let errors: Vec<Perturbation> = sheet.errors.iter().map(|t| t.error).collect();
        let by_jets = sensitivities(&scene.lens, &scene.beam, scene.options, &errors).unwrap();
        let held = scene.clone().with_held_pupils();
        let never = || false;
        let swept = ErrorModel::new(&held, &sheet, SecondDerivatives::Neglected, &never).unwrap();
        let form = &swept.forms[0];
        for (i, jet) in by_jets.iter().enumerate() {
            let exact = jet.mean_square();
            let scale = exact.first.abs().max((exact.value * exact.second).abs().sqrt());
            let what = format!("{name} {:?}", jet.error);
            assert_close(form.first[i], exact.first, 1e-9 * scale, &what);
            let fields = scene.beam.fields.iter();
            let weights = fields.flat_map(|field| {
                let weights = field.colours.iter().flat_map(|colour| &colour.weights);
                weights.map(|weight| field.weight * weight)
            });
            let square = |[x, y]: [f64; 2]| x * x + y * y;
            let pairs = weights.zip(&jet.rays);
            let growth: f64 = pairs.map(|(weight, ray)| weight * square(ray.displacement)).sum();
            assert_close(0.5 * form.second.of(i, i), growth, 1e-9 * growth, &what);
        }
    }
}
