//! Hard cases of wavefronts, contrast, ghosts and pictures: a number with its error, or a refusal by name.

use crate::pictures::{bundled, render, samples};
use crate::reference::{number, read};
use aplanat::analysis::{
    AnalysisError, Coating, ReferenceForm, diffraction_mtf, geometric_mtf, ghosts,
    path_differences, point_spread, strehl, wavefront,
};
use aplanat::lens::{Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System};
use aplanat::paraxial::Beam;
use aplanat::picture::{
    Coloring, ExactRenderer, ExactSettings, ImageFrame, Pattern, QuickRenderer, Scene, SceneLayer,
    picture_model, quick_error,
};
use aplanat::pupil::{Accuracy, Aiming, RayModel};
use std::f64::consts::PI;

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-8, max_rays: 400_000 };
const AXIS: FieldPoint = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
const UM: f64 = 0.5;

fn model_of(surfaces: Vec<Surface<f64>>, diameter: f64) -> RayModel {
    let system = System { index_before: 1.0, surfaces, stop: Some(0) };
    let aperture = Aperture::EntrancePupilDiameter(diameter);
    let beam = Beam { object: Object::Infinity, aperture, field: FieldKind::Angle, edge: 1.0 };
    RayModel::from_systems(vec![(UM, 1.0, system)], 0, beam, Aiming::Paraxial).unwrap()
}

/// A paraboloid of focal length 1000 mm, with its image plane behind the focus by some mm.
fn paraboloid(diameter: f64, obstruction: f64, defocus: f64) -> RayModel {
    let mirror = Surface {
        shape: Shape::new(-1.0 / 2000.0, -1.0, &[], 0).unwrap(),
        mirror: true,
        obstruction,
        semi_diameter: 0.5 * diameter,
        ..Surface::plane(-1000.0 - defocus, 1.0)
    };
    model_of(vec![mirror, Surface::plane(0.0, 1.0)], diameter)
}

/// Case 1: a plate has no focus, and leaves a plane wave plane at any angle.
#[test]
fn an_afocal_lens_is_measured_against_a_plane_wave() {
    let plate =
        vec![Surface::plane(20.0, 1.7), Surface::plane(50.0, 1.0), Surface::plane(0.0, 1.0)];
    let model = model_of(plate, 10.0);
    let field = FieldPoint { y: 17.0, ..AXIS };
    let found = wavefront(&model, field, 0, ACCURACY).unwrap();
    assert_eq!(found.reference, ReferenceForm::Plane);
    assert!(found.rms.value < 1e-8, "{found:?}");
    let all = path_differences(&model, field, 0, &[[0.0, 1.0], [0.7, -0.3]]).unwrap();
    assert!(all.iter().all(|waves| waves.unwrap().abs() < 1e-8), "{all:?}");
}

/// Case 3: the chief ray of a mirror with a hole is lost; its contrast is that of a ring.
#[test]
fn a_lost_chief_ray_leaves_wavefront_and_contrast() {
    let ring = &read("images.json")["annular"][0];
    let share = number(&ring["obscuration"]);
    let model = paraboloid(20.0, 10.0 * share, 0.0);
    let found = wavefront(&model, AXIS, 0, ACCURACY).unwrap();
    assert!(found.rms.value < 1e-6, "{found:?}");
    // f/50: the pupil in cosines is even to 1e-4.
    let cutoff = 1e3 / (UM * 50.0);
    for exact in ring["otf"].as_array().unwrap() {
        let nu = number(&exact["fraction_of_cutoff"]) * cutoff;
        let curve = diffraction_mtf(&model, AXIS, 0, &[nu], ACCURACY).unwrap();
        let value = curve.points[0].sagittal.modulus.value;
        assert!((value - number(&exact["value"])).abs() < 2e-4, "{value} {exact}");
    }
}

/// Case 5: no light, and hardly any.
#[test]
fn a_pinhole_is_perfect_and_a_dark_field_says_so() {
    let model = paraboloid(2e-5, 0.0, 0.3);
    let found = strehl(&model, AXIS, 0, ACCURACY).unwrap();
    assert!((found.at_chief.value - 1.0).abs() < 1e-9, "{found:?}");
    let curve = diffraction_mtf(&model, AXIS, 0, &[0.0, 10.0], ACCURACY).unwrap();
    let moduli = [0, 1].map(|i| curve.points[i].tangential.modulus.value);
    assert_eq!(moduli, [1.0, 0.0]);
    let wide = point_spread(&model, AXIS, 0, &[[0.0, 1.0]], ACCURACY).unwrap();
    assert!(wide.intensities[0].value > 0.999, "{wide:?}");
    let lens = bundled("double_gauss_rudolph_50");
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let field = FieldPoint { y: 70.0, ..AXIS };
    for refused in [
        wavefront(&model, field, 0, ACCURACY).map(drop),
        strehl(&model, field, 0, ACCURACY).map(drop),
        geometric_mtf(&model, field, 0, &[10.0], ACCURACY).map(drop),
    ] {
        assert!(
            matches!(refused, Err(AnalysisError::NoLight | AnalysisError::NoRays(_))),
            "{refused:?}"
        );
    }
}

/// Case 7: the order rises by itself, or it is said that it does not suffice.
#[test]
fn sixty_waves_of_defocus_have_their_closed_form() {
    let diameter = 100.0;
    // The sagitta of the wave at the rim: 1 − cos θ with tan(θ/2) = r/2f.
    let half = 0.25 * diameter / 1000.0;
    let rim = 2.0 * half * half / (1.0 + half * half);
    for waves in [10.25, 60.25] {
        let model = paraboloid(diameter, 0.0, waves * UM * 1e-3 / rim);
        let found = point_spread(&model, AXIS, 0, &[], ACCURACY).unwrap();
        let ReferenceForm::ExitPupil(radius) = found.reference else { panic!("{found:?}") };
        // About a sphere through the mirror the wave is lower at the rim by the second order of the
        // defocus.
        let across = radius * radius - (waves * UM * 1e-3 / rim).powi(2) * rim * (2.0 - rim);
        let lower = (radius - across.sqrt()) / (UM * 1e-3);
        let exact = ((PI * (waves - lower)).sin() / (PI * (waves - lower))).powi(2);
        let off = (found.strehl.value - exact).abs();
        // The beam is even over the mirror, not over cosines: up to the square of the aperture.
        let limit = if found.reached { 2e-2 * exact } else { found.strehl.error };
        assert!(off <= limit, "{waves}: {found:?} {exact:e}");
    }
    // With too few rays it is not reached.
    let model = paraboloid(diameter, 0.0, 60.25 * UM * 1e-3 / rim);
    let few = Accuracy { tolerance: 1e-12, max_rays: 300 };
    let found = point_spread(&model, AXIS, 0, &[], few).unwrap();
    assert!(!found.reached, "{found:?}");
}

/// Case 10: fields beyond 60 degrees.
#[test]
fn fields_of_a_fisheye_have_numbers_or_reasons() {
    let model = RayModel::from_lens(&bundled("fisheye_minolta_16_f28"), 0).unwrap();
    let accuracy = Accuracy { tolerance: 1e-4, ..Accuracy::default() };
    let mut lit = 0;
    for y in [61.0, 75.0, 85.0, 90.0] {
        let field = FieldPoint { y, ..AXIS };
        if let Ok(found) = geometric_mtf(&model, field, model.primary, &[10.0], accuracy) {
            let value = found.points[0].tangential.modulus;
            assert!(
                (0.0..=1.0).contains(&value.value) && value.error.is_finite(),
                "{y}: {value:?}"
            );
            lit += 1;
        }
        if let Ok(found) = wavefront(&model, field, model.primary, accuracy) {
            assert!(found.rms.value.is_finite() && found.rms.value > 0.0, "{y}: {found:?}");
        }
    }
    assert!(lit >= 2, "{lit}");
}

fn flat(pattern: Pattern, half_size: [f64; 2], velocity: [f64; 2]) -> SceneLayer {
    SceneLayer { distance: None, center: [0.0; 2], half_size, velocity, pattern }
}

/// Case 12: a small light on the corner of four pixels gives each a quarter, and loses nothing.
#[test]
fn a_light_on_a_pixel_corner_is_shared() {
    let (model, bands) = picture_model(&bundled("achromat_ac254_100"), 0, Coloring::Gray).unwrap();
    let light = Pattern::Uniform { radiance: [1.0; 3], cover: 1.0 };
    let scene = Scene::new(vec![flat(light, [4e-4; 2], [0.0; 2])], [0.0; 3], 1.0).unwrap();
    let shot = |pixels: [usize; 2]| {
        let frame = ImageFrame { pixels, pitch: 0.15, center: [0.0; 2], inverted: true };
        let picture = render(&model, &bands, &scene, frame, samples(4096));
        let values: Vec<f64> = picture.values.iter().map(|v| v[0]).collect();
        let error = picture.errors.iter().map(|e| e[0] * e[0]).sum::<f64>().sqrt();
        (values, error)
    };
    let (four, error) = shot([2, 2]);
    let whole: f64 = four.iter().sum();
    for value in &four {
        assert!((value - 0.25 * whole).abs() < 5.0 * error, "{four:?} ± {error:e}");
    }
    let (nine, other) = shot([3, 3]);
    let sum: f64 = nine.iter().sum();
    assert!((sum - whole).abs() < 5.0 * error.hypot(other), "{sum} {whole} ± {error:e}");
    assert!(nine[4] > 0.99 * sum, "{nine:?}");
}

/// Case 13: a light of 1e9 beside a shadow of 1 takes nothing from it.
#[test]
fn the_shadow_beside_the_sun_keeps_its_level() {
    let (model, bands) =
        picture_model(&bundled("double_gauss_rudolph_50"), 0, Coloring::Gray).unwrap();
    let frame = ImageFrame { pixels: [8, 8], pitch: 0.05, center: [0.0; 2], inverted: true };
    let sun = Pattern::Uniform { radiance: [1e9; 3], cover: 1.0 };
    // Two degrees away: its image is two millimetres beside the frame.
    let sun = SceneLayer { center: [0.05, 0.0], ..flat(sun, [5e-3; 2], [0.0; 2]) };
    let bright = Scene::new(vec![sun], [1.0; 3], 1.0).unwrap();
    let even = Scene::new(Vec::new(), [1.0; 3], 1.0).unwrap();
    let [with, without] =
        [bright, even].map(|scene| render(&model, &bands, &scene, frame, samples(64)).values);
    assert_eq!(with, without);
}

/// Case 14: fewer pixels than a spot is wide, and light from outside of the frame.
#[test]
fn pictures_smaller_than_a_spot_count_light_from_outside() {
    let (model, bands) =
        picture_model(&bundled("double_gauss_rudolph_50"), 0, Coloring::Gray).unwrap();
    let wave = Pattern::Wave { contrast: 0.5, frequency: [120.0, 40.0], phase: 0.4 };
    let scene = Scene::new(vec![flat(wave, [f64::INFINITY; 2], [0.0; 2])], [0.0; 3], 1.0).unwrap();
    // The spot of this lens is 0.1 mm wide.
    for pixels in [[1, 1], [3, 2]] {
        let frame = ImageFrame { pixels, pitch: 0.01, center: [2.0, 6.0], inverted: true };
        let exact = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
        let picture = QuickRenderer::new(&model, &bands, &exact).unwrap().render();
        let error = quick_error(&exact, &picture, 1, 256);
        assert!(error.value < 0.05, "{pixels:?}: {error:?}");
        assert!(picture.values.iter().flatten().all(|v| v.is_finite() && *v > 0.0));
        let large = ImageFrame { pixels: [pixels[0] + 2, pixels[1] + 2], ..frame };
        let [small, large] =
            [frame, large].map(|frame| render(&model, &bands, &scene, frame, samples(1024)));
        let (inner, [columns, rows]) = (&large.values, large.frame.pixels);
        for row in 1..rows - 1 {
            for column in 1..columns - 1 {
                let i = (row - 1) * pixels[0] + column - 1;
                let off = inner[row * columns + column][0] - small.values[i][0];
                let error = large.errors[row * columns + column][0].hypot(small.errors[i][0]);
                assert!(off.abs() < 6.0 * error + 1e-3 * small.white, "{pixels:?} {i}: {off}");
            }
        }
    }
}

/// Case 16: a ghost in focus is infinitely bright by first-order optics, and not by real rays.
#[test]
fn a_ghost_in_focus_is_finite_by_real_rays() {
    let lens = bundled("double_gauss_rudolph_50");
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let primary = model.primary;
    let last = model.channels[primary].system.surfaces.len() - 2;
    let gap = model.channels[primary].system.surfaces[last].thickness;
    let found = ghosts(&model, (AXIS, primary), Coating::Bare, (45, 256)).unwrap();
    let near = found.0.ghosts.iter().find(|ghost| ghost.focus.is_some_and(|z| gap + z > 5.0));
    let ghost = near.unwrap().clone();
    let mut moved = model.clone();
    moved.channels[primary].system.surfaces[last].thickness += ghost.focus.unwrap();
    let (ranking, real) = ghosts(&moved, (AXIS, primary), Coating::Bare, (45, 1024)).unwrap();
    assert!(ranking.ghosts[0].irradiance > 1e3 && ranking.ghosts[0].radius < 1e-3);
    let pair = (ghost.first, ghost.second);
    let same = real.iter().find(|g| (g.paraxial.first, g.paraxial.second) == pair).unwrap();
    let patch = &same.patch;
    assert!(patch.irradiance.is_finite() && patch.radius > same.paraxial.radius, "{patch:?}");
    // Every ray has one end, and the share of light is one of what is reflected.
    for ghost in &real {
        assert!(ghost.patch.fates.total() >= 1000, "{ghost:?}");
        let flux = 0.5 * (ghost.patch.flux[0] + ghost.patch.flux[1]);
        assert!(flux.is_finite() && flux >= 0.0, "{ghost:?}");
    }
}

/// Case 19: a smear of several periods, longer than the frame.
#[test]
fn a_smear_longer_than_the_frame_leaves_its_closed_form() {
    let (model, bands) = picture_model(&bundled("achromat_ac254_100"), 0, Coloring::Gray).unwrap();
    let focal = model.first_order.efl.unwrap();
    // One period of 2 cycles/mm over the frame.
    let (columns, nu) = (16_usize, 2.0);
    let frame = ImageFrame {
        pixels: [columns, 2],
        pitch: 1.0 / nu / columns as f64,
        center: [0.0; 2],
        inverted: true,
    };
    let contrast = |periods: f64| {
        let wave = Pattern::Wave { contrast: 1.0, frequency: [nu * focal, 0.0], phase: 0.0 };
        let layer = flat(wave, [f64::INFINITY; 2], [periods / nu / focal, 0.0]);
        let scene = Scene::new(vec![layer], [0.0; 3], 1.0).unwrap();
        let settings = ExactSettings { seconds: 1.0, ..samples(4096) };
        let picture = render(&model, &bands, &scene, frame, settings);
        let mut sums = [0.0; 3];
        for (i, value) in picture.values.iter().enumerate() {
            let (sin, cos) = (2.0 * PI * ((i % columns) as f64 + 0.5) / columns as f64).sin_cos();
            let terms = [value[0], value[0] * cos, value[0] * sin];
            sums = [0, 1, 2].map(|k| sums[k] + terms[k]);
        }
        2.0 * sums[1].hypot(sums[2]) / sums[0]
    };
    let still = contrast(0.0);
    assert!(still > 0.9, "{still}");
    for periods in [0.5, 1.5, 7.25] {
        let exact = ((PI * periods).sin() / (PI * periods)).abs();
        let found = contrast(periods) / still;
        assert!((found - exact).abs() < 5e-3, "{periods}: {found} {exact}");
    }
}
