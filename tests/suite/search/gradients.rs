//! Lenses with gradient-index media in the structure search: every mutation preserves the focus and
//! gives a lens or a reason, and a search improves a lens.

use super::mutations::assert_lens;
use super::projection::assert_equivalent;
use super::{generous, seeded};
use crate::merit::bundled;
use aplanat::lens::{
    GradientIndex, Lens, Medium, Parameter, Pickup, ProfileLaw, Quantity, RADIAL_TERMS, Row,
    Variable,
};
use aplanat::math::Vec3;
use aplanat::search::lens_landscape::{
    LensLandscape, SearchPlan, finalize, run, with_open_apertures,
};
use aplanat::search::{
    Landscape, MutationKind, Refusal, SearchMethod, SearchRules, SearchRunOn, SearchSettings,
    mutate, propose,
};
use std::ops::ControlFlow;
use std::sync::Arc;

const EXAMPLES: [&str; 3] = ["grin_rod_melles_griot", "wood_lens_60", "axial_gradient_singlet_50"];

fn medium(radial: &[f64], axial: &[f64]) -> Medium {
    Medium::Grin(Box::new(GradientIndex {
        base: Medium::Index(1.62),
        law: ProfileLaw::Index,
        radial: radial.to_vec(),
        axial: axial.to_vec(),
    }))
}

/// A triplet whose last element has a gradient.
fn triplet(radial: &[f64], axial: &[f64]) -> (Lens, usize) {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.variables.clear();
    let row = (0..lens.surfaces.len()).rfind(|i| lens.surfaces[*i].medium != Medium::Air).unwrap();
    lens.surfaces[row].medium = medium(radial, axial);
    (lens, row)
}

fn busy() -> Lens {
    triplet(&[-2e-4], &[-0.004, 3e-4]).0
}

fn is_graded(lens: &Lens) -> bool {
    lens.surfaces.iter().any(|row| matches!(row.medium, Medium::Grin(_)))
}

/// A flagged number, bounded or not.
fn flag(lens: &mut Lens, surface: usize, quantity: Quantity, bounds: [Option<f64>; 2]) {
    let [min, max] = bounds;
    lens.variables.push(Variable { parameter: Parameter::new(surface, quantity), min, max });
}

/// The rules of a lens of millimetres.
fn small() -> SearchRules {
    SearchRules {
        glass_center: [0.1, 10.0],
        glass_edge: 0.05,
        air_center: [0.01, 10.0],
        ..generous()
    }
}

fn rules(name: &str) -> SearchRules {
    if name == EXAMPLES[0] { small() } else { generous() }
}

#[test]
fn no_grin_lens_is_refused_as_afocal() {
    for name in EXAMPLES {
        let lens = bundled(name);
        let mut random = seeded(21);
        let mut made = 0;
        for kind in MutationKind::MUTATIONS.repeat(8) {
            match mutate(kind, &lens, &rules(name), &mut random) {
                Ok(mutant) => {
                    assert_equivalent(&lens, &mutant);
                    assert_lens(&mutant.lens);
                    made += 1;
                }
                Err(refusal) => {
                    assert_ne!(refusal.refusal, Refusal::Afocal, "{name}: {refusal}");
                }
            }
        }
        assert!(made >= 12, "{name}: {made}");
    }
}

#[test]
fn a_hundred_mutations_keep_a_grin_lens_valid() {
    let mut starts: Vec<(Lens, SearchRules)> =
        EXAMPLES.map(|name| (bundled(name), rules(name))).into();
    starts.push((busy(), generous()));
    for (start, rules) in starts {
        let rules = SearchRules { elements: [1, 6], ..rules };
        let mut random = seeded(22);
        let (mut lens, mut made, mut graded) = (start.clone(), 0, 0);
        for _ in 0..2000 {
            // What becomes too steep to go on begins anew.
            if made % 20 == 0 {
                lens.clone_from(&start);
            }
            let Ok(mutant) = propose(&lens, &rules, &mut random) else { continue };
            assert_lens(&mutant.lens);
            assert_equivalent(&lens, &mutant);
            for variable in &mutant.lens.variables {
                assert!(mutant.lens.get(variable.parameter).is_some(), "{}", mutant.change);
            }
            (lens, made) = (mutant.lens, made + 1);
            graded += usize::from(is_graded(&lens));
            if made == 100 {
                break;
            }
        }
        println!("{}: {made} mutations, {graded} of lenses with gradients", start.name);
        assert!(made == 100 && graded > 40, "{}: {made} {graded}", start.name);
    }
}

/// The index on the axis of the gradient behind a row, at places from its front vertex.
fn along(lens: &Lens, row: usize) -> Vec<f64> {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
    let field = system.grin_profile(row).unwrap();
    let at = |i: i32| f64::from(i) / 8.0 * lens.surfaces[row].thickness;
    (0..=8).map(|i| field.index(Vec3::new(0.3, 0.1, at(i)))).collect()
}

/// Turns an element around without moving anything else.
fn flipped(lens: &Lens, row: usize) -> Lens {
    let rows = lens.surfaces.len();
    let rules = SearchRules { projection: false, ..generous() }.restricted_to(row, row + 1, rows);
    mutate(MutationKind::Flip, lens, &rules, &mut seeded(1)).unwrap().lens
}

#[test]
fn flipping_an_element_reverses_its_axial_grin() {
    for (radial, axial) in [
        (vec![-2e-4], vec![]),
        (vec![], vec![-0.004]),
        (vec![-2e-4, 1e-7], vec![-0.004, 3e-4, -2e-5, 1e-6]),
    ] {
        let (mut lens, row) = triplet(&radial, &axial);
        let [first, second] = [0, 1].map(|k| Quantity::Grin(RADIAL_TERMS + k));
        flag(&mut lens, row, first, [Some(-0.01), Some(0.0)]);
        let held = lens.get(Parameter::new(row, second));
        flag(&mut lens, row, second, [held, held]);
        let turned = flipped(&lens, row);
        for (there, here) in along(&turned, row).iter().rev().zip(along(&lens, row)) {
            assert!((there - here).abs() < 1e-14, "{there} {here}");
        }
        assert_eq!(turned.surfaces[row].curvature, -lens.surfaces[row + 1].curvature);
        for variable in &turned.variables {
            let value = turned.get(variable.parameter).unwrap();
            let inside = variable.min.is_none_or(|min| min <= value)
                && variable.max.is_none_or(|max| value <= max);
            assert!(inside, "{}", variable.parameter);
        }
        // A number that is held is held at what it is now.
        let held = turned.variable(Parameter::new(row, second)).unwrap();
        assert!(held.min == held.max && held.min == turned.get(held.parameter));
        let back = flipped(&turned, row);
        for (again, here) in along(&back, row).iter().zip(along(&lens, row)) {
            assert!((again - here).abs() < 1e-14, "{again} {here}");
        }
    }
}

#[test]
fn irreversible_flips_have_no_density_ratio() {
    let ratio = |axial: &[f64]| {
        let (lens, row) = triplet(&[-2e-4], axial);
        let rules = generous().restricted_to(row, row + 1, lens.surfaces.len());
        let turned = |seed| mutate(MutationKind::Flip, &lens, &rules, &mut seeded(seed));
        let ratios: Vec<_> = (0..20).filter_map(|seed| turned(seed).ok()).collect();
        assert!(!ratios.is_empty());
        ratios.into_iter().filter_map(|mutant| mutant.log_ratio).count()
    };
    assert!(ratio(&[]) > 0, "a gradient across the axis alone is turned back");
    assert_eq!(ratio(&[-0.004]), 0, "the gap may have another length then");
}

fn refused(kind: MutationKind, lens: &Lens) -> Refusal {
    mutate(kind, lens, &generous(), &mut seeded(1)).unwrap_err().refusal
}

#[test]
fn unsupported_operations_on_grin_media_are_refused_by_name() {
    let lens = bundled("axial_gradient_singlet_50");
    assert_eq!(refused(MutationKind::ExchangeGlass, &lens), Refusal::OnlyGradients);
    // The dispersion of a glass stays at its own end.
    let dispersive = |axial: f64, base: &str| {
        let mut lens = bundled("axial_gradient_singlet_50");
        let Medium::Grin(gradient) = &mut lens.surfaces[0].medium else { panic!() };
        gradient.base = Medium::Glass(base.to_owned());
        gradient.axial = vec![axial];
        lens
    };
    let flint = dispersive(-0.0122, "SCHOTT SF5");
    assert_eq!(refused(MutationKind::Flip, &flint), Refusal::GradientWithoutBase);
    assert!(
        mutate(MutationKind::Flip, &dispersive(0.0, "SCHOTT SF5"), &generous(), &mut seeded(1))
            .is_ok()
    );
    let mut followed = lens.clone();
    followed.variables.clear();
    followed.pickups.push(Pickup {
        parameter: Parameter::new(0, Quantity::Grin(RADIAL_TERMS)),
        source: Parameter::new(0, Quantity::Curvature),
        scale: -0.4,
        offset: 0.0,
    });
    assert_eq!(refused(MutationKind::Flip, &followed), Refusal::GradientHasPickup);
    // A secant with something added to it is no secant from its other end.
    let mut secant = lens.clone();
    let Medium::Grin(gradient) = &mut secant.surfaces[0].medium else { panic!() };
    (gradient.law, gradient.radial) = (ProfileLaw::Sech, vec![0.01]);
    assert_eq!(refused(MutationKind::Flip, &secant), Refusal::GradientWithoutBase);
    // Elsewhere in the lens the same is done.
    let (mut lens, _) = triplet(&[], &[-0.004]);
    lens.surfaces[0].medium = Medium::Glass("SCHOTT N-SK16".to_owned());
    assert!(mutate(MutationKind::ExchangeGlass, &lens, &generous(), &mut seeded(1)).is_ok());
}

/// The flagged coefficients of gradients, with their values.
fn flagged(lens: &Lens) -> Vec<(Quantity, f64)> {
    let of_medium = |q| matches!(q, Quantity::Grin(_) | Quantity::Index);
    let flagged = lens.variables.iter().filter(|v| of_medium(v.parameter.quantity));
    flagged.map(|v| (v.parameter.quantity, lens.get(v.parameter).unwrap())).collect()
}

#[test]
fn variable_coefficients_move_with_their_medium() {
    // Without the plane of the stop the second element faces the third.
    let (mut lens, row) = triplet(&[-2e-4], &[-0.004]);
    lens.surfaces.remove(row - 1);
    (lens.surfaces[0].stop, lens.surfaces[row - 2].thickness) = (true, 3.0);
    for quantity in [Quantity::Index, Quantity::Grin(0), Quantity::Grin(RADIAL_TERMS)] {
        flag(&mut lens, row - 1, quantity, [None, None]);
    }
    let all = flagged(&lens);
    let only =
        |first, last, lens: &Lens| generous().restricted_to(first, last, lens.surfaces.len());
    let graded = |lens: &Lens| {
        let is_one = |i: &usize| matches!(lens.surfaces[*i].medium, Medium::Grin(_));
        (0..lens.surfaces.len()).find(is_one).unwrap()
    };
    let at = graded(&lens);
    let glued = (0..40).find_map(|seed| {
        mutate(MutationKind::Glue, &lens, &only(at - 2, at + 1, &lens), &mut seeded(seed)).ok()
    });
    let glued = glued.unwrap().lens;
    assert_eq!(graded(&glued), at - 1);
    assert_eq!(flagged(&glued), all);
    let split = (0..40).find_map(|seed| {
        mutate(MutationKind::Split, &glued, &only(at - 2, at, &glued), &mut seeded(seed)).ok()
    });
    let split = split.unwrap().lens;
    assert_eq!((graded(&split), flagged(&split)), (at, all.clone()));
    // Of a group that loses the piece with the gradient nothing stays flagged; else everything.
    let mut lost = 0;
    for seed in 0..20 {
        match mutate(MutationKind::DropLayer, &glued, &generous(), &mut seeded(seed)) {
            Ok(mutant) => {
                let expected = if is_graded(&mutant.lens) { all.clone() } else { Vec::new() };
                assert_eq!(flagged(&mutant.lens), expected, "{}", mutant.change);
                lost += usize::from(expected.is_empty());
            }
            Err(refusal) => println!("{refusal}"),
        }
    }
    assert!((1..20).contains(&lost), "{lost}");
}

fn whole(lens: &Lens, rules: SearchRules) -> SearchRunOn<LensLandscape> {
    let (usual, method) = (SearchPlan::default().settings, SearchMethod::Restore);
    let settings =
        SearchSettings { method, gradients: Some(520), chains: 2, seed: 7, c: 0.3, ..usual };
    let plan = SearchPlan { settings, rules, ..SearchPlan::default() };
    run(lens, &plan, |_, _| ControlFlow::Continue(())).unwrap()
}

#[test]
fn a_search_from_a_lens_with_gradients_finds_a_better_one() {
    // One field of the rod, which costs most, is enough.
    let mut rod = bundled("grin_rod_melles_griot");
    rod.fields.values.truncate(1);
    for (mut lens, rules) in [
        (rod, SearchRules { elements: [1, 4], ..small() }),
        (bundled("wood_lens_60"), SearchRules { elements: [1, 4], ..SearchRules::default() }),
        (busy(), SearchRules::default()),
    ] {
        lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
        let run = whole(&lens, rules);
        let (start, best) = (run.start().loss, run.best().loss);
        println!("{}: {start:.3e} to {best:.3e}, {} born", lens.name, run.lineage().total());
        assert!(best.is_finite() && best < start, "{}: {start} {best}", lens.name);
        assert!(run.statistics().gradients >= 500);
        for node in run.lineage().nodes() {
            assert_lens(&node.point);
        }
        let mut tried = 0;
        for count in run.statistics().kinds.values() {
            tried += count.tried;
            assert!(!count.refused.contains_key(&Refusal::Afocal), "{}", lens.name);
        }
        assert!(tried > 5, "{}: {tried}", lens.name);
    }
}

#[test]
fn a_finalized_lens_keeps_its_gradient_indices() {
    let (mut lens, row) = triplet(&[-2e-4], &[-0.004]);
    lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
    let landscape = SearchPlan::default().landscape(&lens).unwrap();
    let done = finalize(&landscape, landscape.start()).unwrap();
    assert_eq!(done.gradients, [row]);
    assert_eq!(done.lens.surfaces[row].medium, lens.surfaces[row].medium);
    assert_eq!(done.glasses.len(), 2, "the model glasses are exchanged, and they alone");
    assert!(landscape.loss(&Arc::new(done.lens)).is_finite());
}

#[test]
fn apertures_are_not_opened_where_the_index_is_unknown() {
    let (lens, row) = triplet(&[-2e-4], &[-0.004]);
    let open = with_open_apertures(&lens, 30.0);
    let rims = |lens: &Lens| -> Vec<f64> {
        lens.surfaces.iter().filter_map(|row| row.semi_diameter).collect()
    };
    let (before, after) = (rims(&lens), rims(&open));
    // The plane of the stop in front of the gradient has gone.
    assert_eq!(open.surfaces.len() + 1, lens.surfaces.len());
    assert!(after[0] > before[0], "{after:?}");
    assert!(after[row - 1] <= before[row] && after[row] <= before[row + 1], "{after:?}");
    assert_lens(&open);
    // So no plate is opened to where its index would fall below 1.
    let plate = with_open_apertures(&bundled("wood_lens_60"), 40.0);
    assert_eq!(rims(&plate), [7.5, 8.0]);
    assert!(plate.resolve(0, 0.5875618).is_ok());
}

#[test]
fn the_bounds_of_the_gaps_beside_a_diaphragm_add_up_when_it_goes() {
    let mut lens = bundled("double_gauss_rudolph_50");
    let stop = lens.stop().unwrap();
    let gap = |row: usize| Parameter::new(row, Quantity::Thickness);
    let variable =
        |row: usize, min: Option<f64>, max: Option<f64>| Variable { parameter: gap(row), min, max };
    for (second, expected) in [(Some(1.5), Some(2.0)), (None, None)] {
        lens.variables =
            vec![variable(stop - 1, Some(0.5), Some(8.0)), variable(stop, second, Some(9.0))];
        let open = with_open_apertures(&lens, 12.0);
        assert_eq!(open.surfaces.len() + 1, lens.surfaces.len(), "the plane is gone");
        let sum = lens.surfaces[stop - 1].thickness + lens.surfaces[stop].thickness;
        assert!((open.surfaces[stop - 1].thickness - sum).abs() < 1e-12);
        let joined = open.variable(gap(stop - 1)).unwrap();
        assert_eq!((joined.min, joined.max), (expected, Some(17.0)));
    }
}

/// A plane behind the last element has no surface on its far side with which its gap could be joined.
#[test]
fn a_diaphragm_behind_the_lens_stays() {
    let mut lens = bundled("achromat_ac254_100");
    lens.surfaces.iter_mut().for_each(|row| row.stop = false);
    let image = lens.surfaces.last_mut().unwrap();
    let rest = image.thickness - 3.0;
    image.thickness = 3.0;
    let row = Row { thickness: rest, stop: true, semi_diameter: Some(9.0), ..Row::default() };
    lens.surfaces.push(row);
    lens.check().unwrap();
    let open = with_open_apertures(&lens, 20.0);
    assert_eq!((open.surfaces.len(), open.stop()), (lens.surfaces.len(), lens.stop()));
    assert_lens(&open);
}
