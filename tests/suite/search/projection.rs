//! The projection: a mutated lens focuses as the one before, the refusals, and the determinant of
//! the map.

use super::{generous, seeded};
use crate::merit::bundled;
use aplanat::files;
use aplanat::lens::{Lens, Parameter, ParameterKind, Quantity, Row, Variable, add_variables};
use aplanat::lens::{Medium, Object};
use aplanat::paraxial::{paraxial_ray, signed_indices};
use aplanat::search::{MutatedLens, MutatedPoint, MutationKind, Refusal, SearchRules, mutate};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Height and `nu` of the marginal ray at the image, at every zoom position.
fn kept(lens: &Lens) -> Vec<[f64; 2]> {
    let um = lens.wavelengths[lens.primary()].um;
    let at = |zoom: usize| {
        let system = lens.resolve(zoom, um).unwrap();
        let (height, slope) = match lens.object {
            Object::Infinity => (1.0, 0.0),
            Object::Finite(distance) => (distance, 1.0),
        };
        let ray = paraxial_ray(&system, height, slope);
        let last = system.surfaces.len() - 1;
        [ray.heights[last], ray.slopes[last] * signed_indices(&system)[last + 1]]
    };
    (0..lens.zoom_positions()).map(at).collect()
}

pub(super) fn assert_equivalent(before: &Lens, mutant: &MutatedLens) {
    for (was, is) in kept(before).iter().zip(kept(&mutant.lens)) {
        let start = match before.object {
            Object::Infinity => 1.0,
            Object::Finite(distance) => distance.abs(),
        };
        let height = (is[0] - was[0]).abs() / start;
        let slope = (is[1] / was[1] - 1.0).abs();
        assert!(height < 1e-9 && slope < 1e-9, "{}: {height:e} {slope:e}", mutant.change);
    }
    assert!(mutant.projection.unwrap().error < 1e-9);
}

#[test]
fn a_mutated_lens_focuses_as_before() {
    let mut made = 0;
    for entry in files::bundled_lenses() {
        let lens = bundled(entry.name);
        let mut random = seeded(11);
        for kind in MutationKind::MUTATIONS.repeat(6) {
            if let Ok(mutant) = mutate(kind, &lens, &generous(), &mut random) {
                assert_equivalent(&lens, &mutant);
                made += 1;
            }
        }
    }
    assert!(made > 600, "{made}");
}

#[test]
fn a_focus_solve_stays_in_effect() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.image_solve = Some(-0.05);
    lens.variables.clear();
    let mut random = seeded(12);
    for kind in MutationKind::MUTATIONS.repeat(5) {
        if let Ok(mutant) = mutate(kind, &lens, &generous(), &mut random) {
            assert_equivalent(&lens, &mutant);
        }
    }
}

/// Section 6 of the derivation measured 120 random additions, removals, gluings and splittings of
/// this double Gauss: all succeed, in 3 to 6 steps.
#[test]
fn every_mutation_of_the_double_gauss_is_projected_in_a_few_steps() {
    let lens = bundled("double_gauss_nikkor_s_50");
    let mut random = seeded(13);
    let kinds = [
        MutationKind::AddSinglet,
        MutationKind::RemoveSinglet,
        MutationKind::Glue,
        MutationKind::Split,
    ];
    let mut steps = Vec::new();
    for kind in kinds.repeat(30) {
        let mutant = mutate(kind, &lens, &generous(), &mut random).unwrap();
        steps.push(mutant.projection.unwrap().steps);
    }
    let (least, most) = (steps.iter().min().unwrap(), steps.iter().max().unwrap());
    println!("120 mutations: {least} to {most} steps");
    assert!(*least >= 1 && *most <= 6, "{least} to {most}");
}

#[test]
fn an_afocal_lens_has_no_projection() {
    let mut lens = bundled("singlet_la1131");
    lens.surfaces[0].curvature = 0.0;
    let refusal = mutate(MutationKind::AddSinglet, &lens, &generous(), &mut seeded(1)).unwrap_err();
    assert_eq!(refusal.refusal, Refusal::Afocal);
    let free = SearchRules { projection: false, ..generous() };
    assert!(mutate(MutationKind::AddSinglet, &lens, &free, &mut seeded(1)).is_ok());
}

#[test]
fn one_thickness_cannot_preserve_the_focal_length() {
    let mut lens = bundled("singlet_la1131");
    lens.surfaces[1].thickness -= 10.0;
    lens.surfaces.push(Row { thickness: 10.0, ..Row::default() });
    let rules = SearchRules { fixed_ends: [2, 0], ..generous() };
    let refusal = mutate(MutationKind::AddSinglet, &lens, &rules, &mut seeded(1)).unwrap_err();
    assert_eq!(refusal.refusal, Refusal::SingularProjection);
}

#[test]
fn parameters_at_their_bounds_refuse_the_projection() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    let values: Vec<_> = lens.variables.iter().map(|v| lens.get(v.parameter)).collect();
    for (variable, value) in lens.variables.iter_mut().zip(values) {
        (variable.min, variable.max) = (value, value);
    }
    let refusal = mutate(MutationKind::AddSinglet, &lens, &generous(), &mut seeded(3)).unwrap_err();
    assert_eq!(refusal.refusal, Refusal::ProjectionBounds);
    // With the same numbers held but for a few, those do it alone.
    for surface in [0, 4, 10] {
        let parameter = Parameter::new(surface, Quantity::Curvature);
        let variable = lens.variables.iter_mut().find(|v| v.parameter == parameter).unwrap();
        *variable = Variable { parameter, min: None, max: None };
    }
    let mutant = mutate(MutationKind::AddSinglet, &lens, &generous(), &mut seeded(3)).unwrap();
    assert_equivalent(&lens, &mutant);
    assert!(mutant.projection.unwrap().distance < 1e-12);
}

#[test]
fn a_curvature_may_cross_zero() {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.surfaces[1].curvature = 1e-7;
    let mut random = seeded(5);
    let mut crossed = 0;
    for _ in 0..40 {
        let mutant = mutate(MutationKind::Bend, &lens, &generous(), &mut random).unwrap();
        assert_equivalent(&lens, &mutant);
        crossed += usize::from(mutant.lens.surfaces[1].curvature < 0.0);
    }
    assert!((1..40).contains(&crossed), "{crossed}");
}

/// Every number that the projection of a lens without pickups may move.
fn numbers(lens: &Lens) -> Vec<Parameter> {
    let mut lens = lens.clone();
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    lens.variables.iter().map(|v| v.parameter).collect()
}

/// The logarithm of the determinant of what a flip does to all numbers, by central differences; each
/// number is measured in its own step.
fn stretch(lens: &Lens, seed: u64) -> f64 {
    let known = numbers(lens);
    let step = |p: &Parameter| if p.quantity == Quantity::Curvature { 1e-2 } else { 1.0 };
    let at = |moved: &Lens| {
        let mutant = mutate(MutationKind::Flip, moved, &generous(), &mut seeded(seed)).unwrap();
        let value = |p: &Parameter| mutant.lens.get(*p).unwrap() / step(p);
        known.iter().map(value).collect::<Vec<f64>>()
    };
    let mut jacobian = DMatrix::zeros(known.len(), known.len());
    for (column, parameter) in known.iter().enumerate() {
        let h = 1e-4;
        let moved = |by: f64| {
            let mut moved = lens.clone();
            moved.set(*parameter, lens.get(*parameter).unwrap() + by * step(parameter));
            at(&moved)
        };
        let (up, down) = (moved(h), moved(-h));
        for row in 0..known.len() {
            jacobian[(row, column)] = (up[row] - down[row]) / (2.0 * h);
        }
    }
    jacobian.lu().determinant().abs().ln()
}

/// A flip is its own way back, with as many places, so its ratio is the determinant of the map alone;
/// half of the seeds take the map to the nearest lens, the others its inverse.
#[test]
fn the_determinant_of_the_projection_agrees_with_differences() {
    for name in ["achromat_ac254_100", "tessar_50_f28", "heliar_100_f45", "cooke_triplet_100_f27"] {
        let mut lens = bundled(name);
        lens.variables.clear();
        let (mut compared, mut largest) = (0, 0.0f64);
        for seed in 0..12 {
            let mutant = mutate(MutationKind::Flip, &lens, &generous(), &mut seeded(seed)).unwrap();
            let Some(exact) = mutant.log_ratio else { continue };
            let error = (exact - stretch(&lens, seed)).abs();
            assert!(error < 1e-5 * (1.0 + exact.abs()), "{name}, seed {seed}: {exact} {error:e}");
            (compared, largest) = (compared + 1, largest.max(exact.abs()));
        }
        println!("{name}: {compared} determinants, logarithms up to {largest:.3}");
        assert!(compared >= 6 && largest > 1e-3, "{name}: {compared} {largest}");
    }
}

#[test]
fn mutations_preserve_the_focus_at_every_zoom_position() {
    let lens = bundled("zoom_nikkor_28_80");
    let mut random = seeded(7);
    let mut made = 0;
    for _ in 0..20 {
        let mutant = mutate(MutationKind::AddSinglet, &lens, &generous(), &mut random).unwrap();
        assert_equivalent(&lens, &mutant);
        let glass = mutant
            .new_glass
            .iter()
            .all(|row| matches!(mutant.lens.surfaces[*row].medium, Medium::Glass(_)));
        made += usize::from(glass);
    }
    assert_eq!(made, 20);
}

#[test]
fn the_lineage_shows_the_projection_of_a_lens() {
    let lens = bundled("double_gauss_nikkor_s_50");
    let mut random = seeded(3);
    let new = mutate(MutationKind::AddSinglet, &lens, &SearchRules::default(), &mut random);
    let point: MutatedPoint<Arc<Lens>> = new.unwrap().into();
    assert!(point.record.to_string().contains("; projected in"), "{}", point.record);
    let rules = SearchRules { projection: false, ..SearchRules::default() };
    let new = mutate(MutationKind::AddSinglet, &lens, &rules, &mut random);
    let point: MutatedPoint<Arc<Lens>> = new.unwrap().into();
    assert_eq!(point.record.projection, None);
}
