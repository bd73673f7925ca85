//! Hard cases of contrast: a number with its error, or a refusal by name.

use super::images::image_lenses;
use super::merit::bundled;
use aplanat::analysis::{
    AnalysisError, PupilCurve, PupilFunction, diffraction_mtf, geometric_mtf, lit_region,
    point_spread, polychromatic_diffraction_mtf,
};
use aplanat::lens::{
    Aperture, ApertureShape, FieldKind, FieldPoint, Object, Shape, Surface, SurfaceAperture, System,
};
use aplanat::paraxial::Beam;
use aplanat::pupil::{Accuracy, Aiming, RayModel};
use std::f64::consts::{FRAC_PI_2, PI};

const UM: f64 = 0.5;

/// A quarter of a ring between two radii, moved away from the axis by half the width of an arm along both axes.
fn quarter([inner, outer]: [f64; 2], half_width: f64, turned: usize) -> PupilCurve {
    // Where the circles meet the arms.
    let end = |radius: f64| (half_width / radius).asin();
    let turn = FRAC_PI_2 * turned as f64;
    let arc = |radius: f64, backwards: bool| {
        let (from, to) = (turn + end(radius), turn + FRAC_PI_2 - end(radius));
        let (from, to) = if backwards { (to, from) } else { (from, to) };
        let point = |j: usize| {
            let t = (0.5 * PI * j as f64 / 39.0).sin().powi(2);
            let (sin, cos) = (from + t * (to - from)).sin_cos();
            [radius * sin, radius * cos]
        };
        ((0..40).map(point).collect::<Vec<_>>(), true)
    };
    let (out, back) = (arc(outer, false), arc(inner, true));
    let side = |a: [f64; 2], b: [f64; 2]| (vec![a, b], true);
    let sides = [side(out.0[39], back.0[0]), side(back.0[39], out.0[0])];
    PupilCurve::from_arcs(&[out, sides[0].clone(), back, sides[1].clone()])
}

/// Case 4: a ring with the four arms of a spider is four pieces whose amplitudes add. Their contrast is the overlap
/// of the whole with itself, here by intervals along lines.
#[test]
fn a_ring_with_a_spider_is_the_overlap_of_its_pieces() {
    let ([inner, outer], half_width) = ([0.03, 0.1], 0.004);
    let pieces = (0..4).map(|turned| quarter([inner, outer], half_width, turned)).collect();
    let pupil = PupilFunction::uniform(pieces, UM, |_| 0.0).unwrap();
    // The lit intervals of a line across x at a height.
    let lit = |y: f64| -> Vec<[f64; 2]> {
        let end = |radius: f64| (radius * radius - y * y).max(0.0).sqrt();
        let (hole, rim) = (end(inner), end(outer));
        let from = hole.max(half_width);
        if y.abs() < half_width || y.abs() >= outer || from >= rim {
            return Vec::new();
        }
        vec![[-rim, -from], [from, rim]]
    };
    let overlap = |dx: f64, dy: f64| -> f64 {
        let count = 20_000;
        let step = 2.0 * outer / count as f64;
        let line = |i: usize| {
            let y = -outer + step * (i as f64 + 0.5);
            let mut length = 0.0;
            for [a, b] in lit(y) {
                for [c, d] in lit(y - dy) {
                    length += (b.min(d + dx) - a.max(c + dx)).max(0.0);
                }
            }
            length * step
        };
        (0..count).map(line).sum()
    };
    let whole = overlap(0.0, 0.0);
    for [x, y] in [[0.03, 0.0], [0.0, 0.11], [0.02, 0.05], [0.13, 0.01], [0.09, 0.12]] {
        let exact = overlap(x, y) / whole;
        let found = pupil.transfer([x, y].map(|shift| shift / (UM * 1e-3)), 0.0, 1e-7);
        let off = (found.re - exact).abs();
        assert!(off < 2e-4 && found.im.abs() < 1e-9, "{x} {y}: {found:?} {exact}");
    }
}

/// The same as a lens: the edge of the pupil is not known, which is said, and its rays have a contrast.
#[test]
fn a_lens_with_a_spider_is_refused_by_name_and_has_a_contrast_of_rays() {
    let mut lens = bundled("achromat_ac254_100");
    let spider = SurfaceAperture::obscuration(ApertureShape::Spider { arms: 4, width: 1.0 });
    lens.surfaces[0].apertures.push(spider);
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let accuracy = Accuracy { tolerance: 1e-2, ..Accuracy::default() };
    let refused = diffraction_mtf(&model, axis, model.primary, &[20.0], accuracy).map(drop);
    assert_eq!(refused, Err(AnalysisError::IrregularPupil));
    let rays = geometric_mtf(&model, axis, model.primary, &[5.0], accuracy).unwrap();
    let value = rays.points[0].tangential.modulus;
    assert!(value.value > 0.5 && value.value <= 1.0 && value.error < 0.1, "{value:?}");
}

/// Case 6: beyond the cutoff of a wavelength its contrast is 0 without any error, and the sum over wavelengths is
/// that of the others.
#[test]
fn contrast_beyond_a_cutoff_is_exactly_zero_and_others_remain() {
    let lens = &image_lenses()[0];
    let (_, model, field) = lens.fields().unwrap().remove(0);
    let widest = 2.0 * (0.5 / model.first_order.working_f_number.unwrap()).atan().sin();
    let longest = |a: &usize, b: &usize| model.channels[*a].um.total_cmp(&model.channels[*b].um);
    let red = (0..model.channels.len()).max_by(longest).unwrap();
    let cutoff = widest / (1e-3 * model.channels[red].um);
    let accuracy = Accuracy { tolerance: 1e-4, ..Accuracy::default() };
    // Just above that of the longest wavelength and below those of the others.
    let nu = [1.01 * cutoff, 3.0 * cutoff];
    let dark = diffraction_mtf(&model, field, red, &nu, accuracy).unwrap();
    for point in &dark.points {
        for value in [point.tangential, point.sagittal] {
            assert_eq!([value.re, value.im, value.modulus.value, value.modulus.error], [0.0; 4]);
        }
    }
    let sum = polychromatic_diffraction_mtf(&model, field, &nu, accuracy).unwrap();
    assert_eq!(sum.points[1].tangential.modulus.value, 0.0);
    assert_eq!(sum.points[1].tangential.modulus.error, 0.0);
    let weights: f64 = model.channels.iter().map(|channel| channel.weight).sum();
    let mut expected = 0.0;
    for (i, channel) in model.channels.iter().enumerate() {
        let one = diffraction_mtf(&model, field, i, &nu[..1], accuracy).unwrap();
        expected += channel.weight / weights * one.points[0].tangential.re;
    }
    let found = sum.points[0].tangential;
    assert!((found.re - expected).abs() < 1e-12 && expected > 0.0, "{found:?} {expected}");
}

/// A paraboloid at f/50 behind a second rim at some distance, in light from a small angle: two discs beside each
/// other.
fn two_rims(second: f64, gap: f64) -> RayModel {
    let mirror = Surface {
        shape: Shape::new(-1.0 / 2000.0, -1.0, &[], 0).unwrap(),
        mirror: true,
        semi_diameter: 10.0,
        ..Surface::plane(-1000.0, 1.0)
    };
    let front = Surface { semi_diameter: second, ..Surface::plane(gap, 1.0) };
    let surfaces = vec![front, mirror, Surface::plane(0.0, 1.0)];
    let system = System { index_before: 1.0, surfaces, stop: Some(1) };
    let aperture = Aperture::EntrancePupilDiameter(20.0);
    let beam = Beam { object: Object::Infinity, aperture, field: FieldKind::Angle, edge: 1.0 };
    RayModel::from_systems(vec![(UM, 1.0, system)], 0, beam, Aiming::Paraxial).unwrap()
}

/// Case 8: rims that are nearly equal over a wide azimuth, and one that cuts off an arc of a fraction of a degree.
#[test]
fn rims_that_nearly_coincide_leave_the_common_part_of_two_discs() {
    // Light from 0.01 degrees: the second rim is displaced by 1e-4 of its radius.
    let field = FieldPoint { x: 0.0, y: 0.01, weight: 1.0 };
    let gap = 5.0;
    let apart = gap * (0.01f64).to_radians().tan();
    let accuracy = Accuracy { tolerance: 1e-6, max_rays: 400_000 };
    // Equal rims cross on the line of symmetry of the shift; the last cuts an arc of 0.1 degrees.
    let narrow = (0.05f64).to_radians().cos();
    let cut = (100.0 + apart * apart - 2.0 * 10.0 * apart * narrow).sqrt();
    for (second, what) in [(10.0, "equal"), (10.0 - 1e-5, "nearly equal"), (cut, "an arc")] {
        let model = two_rims(second, gap);
        let region = lit_region(&model, field, 0).unwrap();
        assert!(region.orders() > 0, "{what}");
        let nu = [10.0, 25.0];
        let found = diffraction_mtf(&model, field, 0, &nu, accuracy).unwrap();
        // The pupil of a perfect image: cosines of the radii over the focal length, even to 1e-4.
        let disc = PupilFunction::uniform(vec![PupilCurve::circle([0.0; 2], 0.01)], UM, |_| 0.0);
        let disc = disc.unwrap();
        for (nu, point) in nu.iter().zip(&found.points) {
            let exact = disc.transfer([0.0, *nu], 0.0, 1e-9).re;
            let coma = 2e-3;
            let off = (point.tangential.modulus.value - exact).abs();
            assert!(off < coma && off.is_finite(), "{what} {nu}: {point:?} {exact}");
            assert!(point.tangential.modulus.error < 1e-5, "{what} {nu}: {point:?}");
        }
        let spread = point_spread(&model, field, 0, &[[0.0; 2]], accuracy).unwrap();
        assert!(spread.strehl.value > 0.99, "{what}: {spread:?}");
    }
}
