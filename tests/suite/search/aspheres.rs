//! Aspheric surfaces as mutations: a known aspheric optimum is found, and none is tried where none is
//! permitted.

use super::super::merit::bundled;
use super::{generous, seeded};
use aplanat::lens::{
    Aperture, FieldKind, FieldPoint, Fields, Lens, Medium, Parameter, Quantity, Variable,
    Wavelength, blank,
};
use aplanat::merit::{Goal, LimitTreatment, PupilEdge, Term, WeightedTerm};
use aplanat::search::lens_landscape::{LensLandscape, SearchPlan, run};
use aplanat::search::{
    Landscape as _, MutationKind, Refusal, SearchMethod, SearchRules, SearchRunOn, SearchSettings,
    mutate,
};
use std::ops::ControlFlow;

const INDEX: f64 = 1.5;

/// A plano-convex lens with its plane towards a distant object on the axis: it images without aberration
/// if the conic constant of its rear surface is minus the square of its index.
fn plano_convex() -> Lens {
    let mut lens = blank();
    let rows = &mut lens.surfaces;
    (rows[0].curvature, rows[0].thickness, rows[0].medium) = (0.0, 6.0, Medium::Index(INDEX));
    (rows[1].curvature, rows[1].thickness) = (-0.04, 50.0);
    rows.iter_mut().for_each(|row| row.semi_diameter = Some(14.0));
    lens.aperture = Aperture::EntrancePupilDiameter(20.0);
    lens.wavelengths = vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }];
    let axis = vec![FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }];
    lens.fields = Fields { kind: FieldKind::Angle, values: axis };
    let last = Parameter::new(1, Quantity::Thickness);
    lens.variables = vec![Variable { parameter: last, min: None, max: None }];
    lens
}

fn spots() -> Goal {
    let terms = vec![WeightedTerm::new(Term::Spot, 1.0)];
    let limits = LimitTreatment::Penalties;
    Goal { terms, pupil: PupilEdge::Moving, zoom_ratios: Vec::new(), limits }
}

/// Mutations of the aspheric kinds alone, behind the first surface.
fn only_aspheres(aspheres: usize) -> SearchRules {
    let about = |kind: &MutationKind| !kind.is_about_aspheres();
    let others = MutationKind::MUTATIONS.into_iter().filter(about);
    SearchRules {
        aspheres,
        fixed_ends: [1, 0],
        elements: [1, 2],
        weights: others.map(|kind| (kind, 0.0)).collect(),
        ..SearchRules::default()
    }
}

fn search(
    lens: &Lens,
    goal: Option<Goal>,
    rules: SearchRules,
    method: SearchMethod,
) -> (LensLandscape, SearchRunOn<LensLandscape>) {
    let settings =
        SearchSettings { method, gradients: Some(800), seed: 3, ..SearchSettings::default() };
    let mut plan = SearchPlan { goal, rules, settings, ..SearchPlan::default() };
    plan.local.semi_diameters = false;
    let found = run(lens, &plan, |_, _| ControlFlow::Continue(())).unwrap();
    (plan.landscape(lens).unwrap(), found)
}

#[test]
fn the_conic_without_spherical_aberration_is_found() {
    let method = SearchMethod::IteratedLocalSearch;
    let (landscape, found) = search(&plano_convex(), Some(spots()), only_aspheres(1), method);
    let gains = landscape.asphere_gains(landscape.start()).unwrap();
    assert_eq!(gains.len(), 1, "{gains:?}");
    let (best, start) = (found.best(), found.start());
    assert!(best.loss < 1e-4 * start.loss, "{} {}", best.loss, start.loss);
    let rear = &best.point.surfaces[1];
    // Terms beside the conic stay small where it suffices.
    let sag = |square: f64| {
        let (c, terms) = (rear.curvature, rear.asphere.iter().zip(2..));
        let conic = c * square / (1.0 + (1.0 - (1.0 + rear.conic) * c * c * square).sqrt());
        conic + terms.map(|(a, power)| a * square.powi(power)).sum::<f64>()
    };
    let ideal = |square: f64| {
        let (c, k) = (rear.curvature, -INDEX * INDEX);
        c * square / (1.0 + (1.0 - (1.0 + k) * c * c * square).sqrt())
    };
    for height in [4.0, 7.0, 10.0] {
        let off = sag(height * height) - ideal(height * height);
        assert!(off.abs() < 2e-4, "{height}: {off}, conic {}", rear.conic);
    }
    assert!(found.statistics().kinds[&MutationKind::AddAsphere].entered > 0);
    assert!(found.statistics().gradients_beside > 0);
    assert!(landscape.topology(&best.point).ends_with(", 1 aspheric"));
}

/// What the conic takes after the image plane has followed: of the third-order aberration `ρ³ + a ρ` the best
/// defocus leaves `1 − (∫ρ⁵)² / (∫ρ³ ∫ρ⁷)`, a ninth.
#[test]
fn the_gain_of_a_conic_is_predicted() {
    let mut lens = plano_convex();
    lens.aperture = Aperture::EntrancePupilDiameter(8.0);
    let plan = SearchPlan { goal: Some(spots()), rules: only_aspheres(1), ..SearchPlan::default() };
    let landscape = plan.landscape(&lens).unwrap();
    let gains = landscape.asphere_gains(landscape.start()).unwrap();
    assert_eq!(gains[0].parameter, Parameter::new(1, Quantity::Conic));
    assert!((gains[0].gain - 1.0 / 9.0).abs() < 0.006, "{gains:?}");
    let none = SearchPlan { rules: SearchRules { aspheres: 0, ..plan.rules.clone() }, ..plan };
    let spherical = none.landscape(&lens).unwrap();
    assert!(spherical.asphere_gains(spherical.start()).unwrap().is_empty());
}

#[test]
fn no_asphere_is_tried_where_none_is_permitted() {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.wavelengths = vec![Wavelength { um: 0.5875618, weight: 1.0, primary: true }];
    for method in [SearchMethod::IteratedLocalSearch, SearchMethod::Restore] {
        let (_, found) = search(&lens, None, SearchRules::default(), method);
        assert!(found.statistics().kinds.keys().all(|kind| !kind.is_about_aspheres()));
        for node in found.lineage().nodes() {
            assert!(
                node.point.surfaces.iter().all(|row| row.conic == 0.0 && row.asphere.is_empty())
            );
        }
    }
    // Checkpoints of earlier searches have rules without this number.
    let rules = serde_json::to_value(SearchRules::default()).unwrap();
    assert!(rules.get("aspheres").is_none() && rules.get("saddles").is_none());
}

#[test]
fn a_birth_changes_nothing_and_a_removal_makes_a_sphere() {
    let lens = bundled("cooke_triplet_100_f27");
    let rules = SearchRules { aspheres: 2, projection: false, ..generous() };
    let figured = mutate(MutationKind::AddAsphere, &lens, &rules, &mut seeded(4)).unwrap();
    assert_eq!(figured.lens.surfaces, lens.surfaces);
    assert_eq!(figured.lens.variables.len(), lens.variables.len() + 1);
    assert!(figured.change.to_string().contains("conic"), "{}", figured.change);
    let Some(parameter) = figured.lens.variables.last().map(|v| v.parameter) else { panic!() };
    let mut aspheric = figured.lens.clone();
    aspheric.set(parameter, -0.7);
    let plain = mutate(MutationKind::RemoveAsphere, &aspheric, &rules, &mut seeded(4)).unwrap();
    assert_eq!(plain.lens.surfaces, lens.surfaces);
    assert_eq!(plain.lens.variables, lens.variables);
    let refused = mutate(MutationKind::RemoveAsphere, &lens, &rules, &mut seeded(4)).unwrap_err();
    assert_eq!(refused.refusal, Refusal::NoAsphere);
}

#[test]
fn a_search_with_aspheres_is_the_same_on_any_number_of_threads() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let method = SearchMethod::IteratedLocalSearch;
        pool.install(|| search(&plano_convex(), Some(spots()), only_aspheres(1), method).1)
    };
    assert!(on(1) == on(2));
}
