//! That the model of the projection is what first-order optics says of a lens with gradients, its
//! derivatives those of its values.

use super::model::{MarginalRayModel, ProjectionCoordinate, scale};
use super::{SearchRules, curvature_range, free_parameters};
use crate::lens::{
    GradientIndex, Lens, Medium, Object, ProfileLaw, Quantity, ZoomNumber, ZoomPosition,
};
use crate::math::Dual;
use crate::paraxial::{paraxial_ray, signed_indices};
use crate::solve::ConstraintFunction as _;

fn bundled(name: &str) -> Lens {
    let found = crate::files::bundled_lenses().iter().find(|bundled| bundled.name == name).unwrap();
    crate::files::json::read(found.text, name).unwrap()
}

fn graded(law: ProfileLaw, radial: &[f64], axial: &[f64]) -> Medium {
    let base = Medium::Index(1.62);
    Medium::Grin(Box::new(GradientIndex {
        base,
        law,
        radial: radial.to_vec(),
        axial: axial.to_vec(),
    }))
}

/// A triplet two of whose elements are gradients, one of them along the axis.
fn triplet(law: ProfileLaw, object: Object) -> Lens {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.variables.clear();
    let radial = if law == ProfileLaw::Sech { 0.01 } else { -2e-4 };
    let glass: Vec<usize> =
        (0..lens.surfaces.len()).filter(|i| lens.surfaces[*i].medium != Medium::Air).collect();
    lens.surfaces[glass[0]].medium = graded(law, &[radial], &[]);
    lens.surfaces[glass[2]].medium = graded(law, &[0.5 * radial], &[-0.004, 3e-4]);
    lens.object = object;
    lens
}

/// The triplet at two lengths of a gradient.
fn zoom() -> Lens {
    let mut lens = triplet(ProfileLaw::Index, Object::Infinity);
    let row = (0..lens.surfaces.len())
        .rfind(|i| matches!(lens.surfaces[*i].medium, Medium::Grin(_)))
        .unwrap();
    let at = |by: f64| ZoomPosition {
        numbers: vec![ZoomNumber::thickness(row, lens.surfaces[row].thickness + by)],
        ..ZoomPosition::default()
    };
    lens.zoom = vec![at(0.0), at(1.5)];
    lens
}

/// A gradient that light passes on its way back from a mirror.
fn behind_a_mirror() -> Lens {
    let mut lens = bundled("telescope_rc_f8");
    lens.variables.clear();
    let mut plate = lens.surfaces[0].clone();
    let (mirror, gap) = (lens.surfaces[0].clone(), lens.surfaces[0].thickness);
    (plate.curvature, plate.conic, plate.stop) = (0.0, 0.0, false);
    plate.asphere.clear();
    plate.obstruction = None;
    plate.medium = graded(ProfileLaw::Index, &[-1e-8], &[1e-5]);
    plate.thickness = -300.0;
    let mut face = plate.clone();
    (face.medium, face.thickness) = (Medium::Air, 0.5 * gap + 300.0);
    lens.surfaces[0] = crate::lens::Row { thickness: 0.5 * gap, ..mirror };
    lens.surfaces.insert(1, plate);
    lens.surfaces.insert(2, face);
    lens
}

fn lenses() -> Vec<Lens> {
    let laws = [ProfileLaw::Index, ProfileLaw::Square, ProfileLaw::Sech];
    let mut all: Vec<Lens> = laws.map(|law| triplet(law, Object::Infinity)).into();
    all.push(triplet(ProfileLaw::Index, Object::Finite(700.0)));
    all.extend([zoom(), behind_a_mirror()]);
    all.extend(["grin_rod_melles_griot", "wood_lens_60", "axial_gradient_singlet_50"].map(bundled));
    all
}

/// A lens as a function of every curvature and gap, in the steps of the projection.
fn model(lens: &Lens) -> (MarginalRayModel, Vec<ProjectionCoordinate>) {
    let scale = scale(lens).unwrap();
    let coordinate = |new: crate::lens::Parameter| ProjectionCoordinate {
        old: new,
        new,
        sign: 1.0,
        value: lens.get(new).unwrap(),
        step: if new.quantity == Quantity::Curvature { 0.3 / scale } else { 0.01 * scale },
    };
    let coordinates: Vec<_> = free_parameters(lens).into_iter().map(coordinate).collect();
    let model = MarginalRayModel::new(lens, lens, &coordinates, scale, |c| (c.new, 1.0)).unwrap();
    (model, coordinates)
}

#[test]
fn what_is_kept_is_what_first_order_optics_says() {
    for lens in lenses() {
        let (model, coordinates) = model(&lens);
        let (length, um) = (scale(&lens).unwrap(), lens.wavelengths[lens.primary()].um);
        // Where the lens is, and where its numbers have moved.
        for z in [0.0, 0.02] {
            let mut moved = lens.clone();
            for c in &coordinates {
                assert!(moved.set(c.new, c.value + z * c.step));
            }
            let values = model.values(&vec![z; coordinates.len()]);
            for zoom in 0..lens.zoom_positions() {
                let system = moved.resolve(zoom, um).unwrap();
                let (height, slope) = match lens.object {
                    Object::Infinity => (1.0, 0.0),
                    Object::Finite(distance) => (1.0, 1.0 / distance),
                };
                let ray = paraxial_ray(&system, height, slope);
                let image = system.surfaces.len() - 1;
                let nu = ray.slopes[image] * signed_indices(&system)[image + 1] * length;
                let [found_nu, found_height] = [values[2 * zoom], values[2 * zoom + 1]];
                assert!((found_nu - nu).abs() < 1e-12 * nu.abs().max(1.0), "{}", lens.name);
                let off = found_height - ray.heights[image];
                assert!(off.abs() < 1e-11, "{}: {off:e}", lens.name);
            }
        }
    }
}

#[test]
fn the_derivatives_of_what_is_kept_agree_with_differences() {
    for lens in lenses() {
        let (model, coordinates) = model(&lens);
        let at: Vec<f64> = (0..coordinates.len()).map(|i| 1e-3 * (i as f64 + 1.0)).collect();
        let jacobian = model.jacobian(&at);
        let largest = jacobian.amax();
        let multipliers: Vec<f64> =
            (0..model.constraints()).map(|i| 0.7 - 0.4 * i as f64).collect();
        let h = 1e-4;
        let mut worst: f64 = 0.0;
        for column in 0..at.len() {
            let moved = |by: f64| {
                let mut there = at.clone();
                there[column] += by;
                there
            };
            let (up, down) = (model.values(&moved(h)), model.values(&moved(-h)));
            for row in 0..model.constraints() {
                let difference = (up[row] - down[row]) / (2.0 * h);
                worst = worst.max((jacobian[(row, column)] - difference).abs() / largest);
            }
            // Second derivatives, as duals carry them.
            let mut lifted: Vec<Dual<f64, 1>> = at.iter().map(|z| Dual::constant(*z)).collect();
            lifted[column].slope = [1.0];
            let exact = model.weighted_gradient(&lifted, &multipliers);
            let (up, down) = (
                model.weighted_gradient(&moved(h), &multipliers),
                model.weighted_gradient(&moved(-h), &multipliers),
            );
            for (i, exact) in exact.iter().enumerate() {
                let difference = (up[i] - down[i]) / (2.0 * h);
                worst = worst.max((exact.slope[0] - difference).abs() / largest);
            }
        }
        assert!(worst < 2e-8, "{}: {worst:e}", lens.name);
    }
}

#[test]
fn a_surface_may_be_curved_until_its_rim_is_too_steep() {
    let mut lens = bundled("cooke_triplet_100_f27");
    let rules = SearchRules { steepness: 0.6, ..SearchRules::default() };
    for rim in [3.0, 12.0] {
        lens.surfaces[1].semi_diameter = Some(rim);
        let (low, high) = curvature_range(&lens, 1, &rules);
        // The sine of the slope at the rim of a sphere is its curvature times the height.
        assert!((high * rim - 0.6).abs() < 1e-12 && low == -high, "{low} {high}");
    }
    lens.surfaces[1].semi_diameter = None;
    assert_eq!(curvature_range(&lens, 1, &rules), (f64::NEG_INFINITY, f64::INFINITY));
}
