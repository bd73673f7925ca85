//! Spots and wavefronts of surfaces that focus perfectly, seen out of focus.

use super::{FOCAL, assert_near, beam, field, paraboloid, system, thin_lens};
use crate::aperture::image;
use crate::merit::bundled;
use crate::reference::lenses;
use aplanat::analysis::{
    airy_radius, diffraction_gate, energy_irradiance, illumination, path_differences,
    perfect_contrast, spot,
};
use aplanat::effects::{self, EffectOverrides, TracePurpose, build_ray_model};
use aplanat::lens::{FieldPoint, Lens, Shape, Surface, System};
use aplanat::picture::{ImageFrame, omitted_effects};
use aplanat::pupil::{Accuracy, Aiming, RayModel};

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-11, max_rays: 400_000 };
const UM: f64 = 0.5875618;

fn model(systems: Vec<(f64, f64, System<f64>)>, diameter: f64, edge: f64) -> RayModel {
    RayModel::from_systems(systems, 0, beam(diameter, edge), Aiming::Paraxial).unwrap()
}

/// A ray at the height h of a paraboloid mirror meets the axis in its focus at the angle u with
/// tan u = 4 f h/(4 f² − h²).
fn slope(height: f64) -> f64 {
    4.0 * FOCAL * height / (4.0 * FOCAL * FOCAL - height * height)
}

/// The mean of tan² u over the disc of radius R: 4 a/R² (a/(a − R²) − 1 + ln(1 − R²/a)) with
/// a = 4 f².
fn mean_square_slope(radius: f64) -> f64 {
    let (a, square) = (4.0 * FOCAL * FOCAL, radius * radius);
    4.0 * a / square * (a / (a - square) - 1.0 + (-square / a).ln_1p())
}

#[test]
fn the_spot_of_a_paraboloid_out_of_focus_is_its_cone() {
    let (radius, defocus) = (25.0, 0.2);
    let model = model(vec![(UM, 1.0, paraboloid(defocus))], 2.0 * radius, 0.0);
    let got = spot(&model, field(0.0, 0.0), ACCURACY).unwrap();
    assert_near(got.rms.value, defocus * mean_square_slope(radius).sqrt(), 1e-12);
    assert_near(got.radius.value, defocus * slope(radius), 2e-9);
    assert_near(got.light.value, std::f64::consts::PI * radius * radius, 1e-12);
}

#[test]
fn a_spot_weighs_its_wavelengths() {
    // The first wavelength is in focus, the second is not: only the share of the second counts.
    let (radius, defocus) = (25.0, 0.2);
    let blurred = defocus * mean_square_slope(radius).sqrt();
    for (first, second) in [(3.0, 1.0), (1.0, 3.0), (0.0, 2.0)] {
        let systems = vec![(UM, first, paraboloid(0.0)), (0.6, second, paraboloid(defocus))];
        let got = spot(&model(systems, 2.0 * radius, 0.0), field(0.0, 0.0), ACCURACY).unwrap();
        let share: f64 = second / (first + second);
        assert_near(got.rms.value, share.sqrt() * blurred, 1e-12);
        assert_near(got.channels[1].unwrap().rms.value, blurred, 1e-12);
    }
}

#[test]
fn the_radius_of_a_spot_does_not_depend_on_the_azimuth_of_its_field() {
    let model = model(vec![(UM, 1.0, paraboloid(0.05))], 50.0, 1.0);
    let at = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        spot(&model, field(sin, cos), ACCURACY).unwrap().radius
    };
    // The farthest ray lies in the plane of symmetry, where an edge ray is traced first.
    let exact = at(0.0);
    for step in 1..60 {
        let got = at(f64::from(step) * 1.37);
        let error = (got.value - exact.value).abs();
        let stated = got.error + exact.error + 1e-9 * exact.value;
        assert!(error <= stated, "step {step}: {got:?} instead of {exact:?}");
        assert!(error <= 1e-6 * exact.value, "step {step}: {got:?} instead of {exact:?}");
    }
}

#[test]
fn the_airy_radius_is_the_first_zero_of_the_diffraction_pattern() {
    // J₁(π r/(λ N)) = 0 at π r/(λ N) = 3.8317; f/4 gives 2.8668 µm in yellow light.
    let thin = system(thin_lens(FOCAL, FOCAL).to_vec(), 0);
    let radius = airy_radius(&model(vec![(UM, 1.0, thin)], 25.0, 0.0)).unwrap();
    assert_near(radius, 3.831705970207512 / std::f64::consts::PI * UM * 1e-3 * 4.0, 1e-3);
}

#[test]
fn the_wavefront_in_glass_counts_the_index() {
    // An ellipsoid of eccentricity 1/n focuses parallel light into its far focus, in the glass.
    let (index, focus, defocus, radius) = (1.5, 150.0, 0.05, 20.0);
    let curvature = index / ((index - 1.0) * focus);
    let shape = Shape::Conic { curvature, conic: -1.0 / (index * index) };
    let front = Surface { shape, index, thickness: focus + defocus, ..image() };
    let model = model(vec![(UM, 1.0, system(vec![front], 0))], 2.0 * radius, 0.0);
    let points = [[0.0, 0.3], [0.5, 0.5], [0.0, -1.0]];
    let found = path_differences(&model, field(0.0, 0.0), 0, &points).unwrap();
    for (p, found) in points.iter().zip(found) {
        let height = radius * p[0].hypot(p[1]);
        let (sag, _) = shape.sag(height * height).unwrap();
        let cosine = (focus - sag) / (focus - sag).hypot(height);
        let sphere = focus + defocus;
        let side = (sphere * sphere - defocus * defocus * (1.0 - cosine * cosine)).sqrt();
        let longer = defocus * (1.0 - cosine) - (sphere - side);
        let exact = index * longer / (UM * 1e-3);
        assert!(exact.abs() > 0.005, "{exact} waves is too little to see");
        assert!((found.unwrap() - exact).abs() < 1e-8, "{p:?}: {found:?} instead of {exact}");
    }
}

/// The model of a lens with the effects that exact spots call for.
fn planned_model(lens: &Lens) -> RayModel {
    let measured = effects::measure_effects(lens, 0).unwrap();
    let plan = effects::plan(&measured, TracePurpose::Spot(1e-6), &EffectOverrides::default());
    build_ray_model(lens, 0, &plan).unwrap()
}

#[test]
fn the_error_of_the_illumination_covers_its_error() {
    let references = lenses().into_iter().map(|lens| (lens.id().to_owned(), lens.clipped_model()));
    // The light of these varies over their pupils so much that low orders are not exact.
    let uneven = ["wide_nikkor_28_f35", "more/microscope_us4505553"]
        .map(|name| (name.to_owned(), planned_model(&bundled(name))));
    let (mut compared, mut inexact) = (0, 0);
    for (name, model) in references.chain(uneven) {
        let at = |accuracy| {
            illumination(&model, model.primary, accuracy)
                .into_iter()
                .filter_map(|light| light.relative.filter(|share| share.value > 0.0))
        };
        let exact: Vec<_> = at(ACCURACY).collect();
        let rough = [0.3, 1e-1, 1e-2, 1e-4].map(|tolerance| Accuracy { tolerance, ..ACCURACY });
        // Rays that run out leave the result of a low order.
        let short = Accuracy { max_rays: 1, ..ACCURACY };
        for accuracy in rough.into_iter().chain([short]) {
            for (rough, exact) in at(accuracy).zip(&exact).skip(1) {
                let error = (rough.value - exact.value).abs();
                let stated = rough.error + exact.error.max(ACCURACY.tolerance * exact.value);
                assert!(error <= stated, "{name}: {error:e}, stated {stated:e}");
                compared += 1;
                inexact += usize::from(error > 1e-9);
            }
        }
    }
    println!("{compared} illuminations, {inexact} of them with an error above 1e-9");
    assert!(compared >= 75 && inexact >= 12, "{compared}, {inexact}");
}

#[test]
fn light_of_a_field_has_no_weight() {
    // A weight of a field belongs to means over fields: the spot of the field itself has none.
    let model = model(vec![(UM, 1.0, paraboloid(0.1))], 50.0, 0.5);
    let heavy = FieldPoint { weight: 7.0, ..field(0.0, 0.5) };
    let [light, heavy] = [field(0.0, 0.5), heavy].map(|f| spot(&model, f, ACCURACY).unwrap());
    assert_eq!((light.rms, light.light), (heavy.rms, heavy.light));
}

/// Denser media everywhere bend rays as before and make every path longer.
#[test]
fn paths_grow_with_the_indices_of_all_media() {
    let lens = bundled("double_gauss_rudolph_50");
    let plain = lens.resolve(0, UM).unwrap();
    let points = [[0.0, 0.9], [0.4, -0.6], [-0.7, 0.1]];
    let paths = |index: f64| {
        let mut system = plain.clone();
        system.index_before *= index;
        system.surfaces.iter_mut().for_each(|surface| surface.index *= index);
        let model = model(vec![(UM, 1.0, system)], 12.0, 8.0);
        path_differences(&model, field(3.0, 8.0), 0, &points).unwrap()
    };
    for (thin, dense) in paths(1.0).into_iter().zip(paths(1.33)) {
        let (thin, dense) = (thin.unwrap(), dense.unwrap());
        assert!(thin.abs() > 0.05, "{thin}");
        assert!((dense / thin - 1.33).abs() < 1e-7, "{dense} {thin}");
    }
}

#[test]
fn the_farthest_ray_of_a_spot_is_known_to_the_tolerance() {
    let lens = bundled("double_gauss_rudolph_50");
    let model = RayModel::from_lens(&lens, 0).unwrap();
    for point in &model.fields[..2] {
        let radius = |tolerance: f64| {
            spot(&model, *point, Accuracy { tolerance, ..ACCURACY }).unwrap().radius
        };
        let exact = radius(1e-6);
        for tolerance in [1e-2, 1e-4] {
            let found = radius(tolerance);
            assert!(found.error <= 3.0 * tolerance * found.value, "{} {found:?}", point.y);
            let off = (found.value - exact.value).abs();
            assert!(off <= found.error + exact.error, "{} {found:?} {exact:?}", point.y);
        }
    }
}

/// Rays show a paraboloid as perfect, so what diffraction changes at its focus is one minus the
/// overlap of two discs; a finer pixel asks for a higher frequency, where that is more.
#[test]
fn the_change_by_diffraction_of_a_perfect_lens_is_in_closed_form() {
    let model = model(vec![(UM, 1.0, paraboloid(0.0))], 10.0, 0.0);
    let f_number = model.first_order.working_f_number.unwrap().abs();
    let exact = |frequency: f64| 1.0 - perfect_contrast(frequency * UM * 1e-3 * f_number);
    let axis = field(0.0, 0.0);
    for highest in [20.0, 40.0] {
        let gate = diffraction_gate(&model, axis, 0, highest, 1e-3).unwrap();
        let change = gate.change.unwrap().value;
        assert!((change / exact(highest) - 1.0).abs() < 0.01, "{change} {}", exact(highest));
        let pitch = 0.5 / highest;
        let frame = ImageFrame { pixels: [8, 8], pitch, center: [0.0; 2], inverted: true };
        let left_out = omitted_effects(&model, &frame, 1e-3);
        assert_eq!(left_out[0].effect, "diffraction");
        let change = left_out[0].change.unwrap();
        assert!((change / exact(highest) - 1.0).abs() < 0.01, "{change} {}", exact(highest));
    }
}

/// The share of the beam at a point of the stop is the area that a small piece of the stop has where
/// its rays cross the first vertex plane, against that of an equal piece at the chief ray.
#[test]
fn the_share_of_a_beam_is_the_area_between_neighbouring_rays() {
    let lens = bundled("wide_nikkor_28_f35");
    let model = RayModel { aiming: Aiming::Stop, ..RayModel::from_lens(&lens, 0).unwrap() };
    // Both fields are 30 degrees off the axis, one of them beside the y axis.
    for (x, y) in [(0.0, 30.0), (18.0, 24.0)] {
        let launch = model.launch(field(x, y), model.primary).unwrap();
        let at = |p: [f64; 2]| {
            let ray = launch.ray(p).unwrap();
            let foot = ray.point - ray.direction * (ray.point.z / ray.direction.z);
            [foot.x, foot.y]
        };
        let area = |[x, y]: [f64; 2]| {
            let side = |a: [f64; 2], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
            let u = side(at([x + 1e-3, y]), at([x - 1e-3, y]));
            let v = side(at([x, y + 1e-3]), at([x, y - 1e-3]));
            u[0] * v[1] - u[1] * v[0]
        };
        for p in [[0.0, 0.0], [0.0, 0.7], [0.6, 0.5], [-0.8, -0.3], [0.5, -0.7]] {
            let exact = area(p) / area([0.0, 0.0]);
            let found = launch.beam_share(p);
            assert!((found / exact - 1.0).abs() < 1e-5, "{x} {y} {p:?}: {found} {exact}");
        }
    }
}

/// A lens of revolution sees a field turned about its axis as it was: nothing depends on the azimuth
/// of its rays, aimed at the stop or not.
#[test]
fn the_light_of_a_turned_field_is_the_same() {
    let lens = bundled("wide_nikkor_28_f35");
    let model = RayModel { aiming: Aiming::Stop, ..RayModel::from_lens(&lens, 0).unwrap() };
    let accuracy = Accuracy { tolerance: 1e-4, ..Accuracy::default() };
    let at = |x: f64, y: f64| {
        energy_irradiance(&model, field(x, y), model.primary, accuracy).unwrap().value
    };
    let straight = at(0.0, 15.0);
    for (x, y) in [(9.0, 12.0), (-12.0, 9.0)] {
        let turned = at(x, y);
        assert!((turned / straight - 1.0).abs() < 2e-3, "{x} {y}: {turned} {straight}");
    }
}
