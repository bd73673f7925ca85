//! The brightest point of a diffraction image in space: that of all of the blur.

use crate::pictures::bundled;
use aplanat::analysis::{point_spread, strehl};
use aplanat::lens::{Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System};
use aplanat::paraxial::Beam;
use aplanat::pupil::{Accuracy, Aiming, RayModel};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-5, max_rays: 400_000 };

/// A model whose image plane lies some mm farther along the axis.
fn refocused(model: &RayModel, by: f64) -> RayModel {
    let mut systems = Vec::new();
    for channel in &model.channels {
        let mut system = channel.system.clone();
        let last = system.surfaces.len() - 2;
        system.surfaces[last].thickness += by;
        systems.push((channel.um, channel.weight, system));
    }
    RayModel::from_systems(systems, model.primary, model.beam, model.aiming).unwrap()
}

/// The oblique beam of a triplet has several maxima along the axis, among which the best one at the given image
/// plane is not the nearest.
#[test]
fn the_brightest_point_does_not_depend_on_the_image_plane() {
    let lens = bundled("tessar_50_f28");
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let field = *model.fields.last().unwrap();
    let at = [-0.2, 0.0, 0.2].map(|by| {
        let found = strehl(&refocused(&model, by), field, model.primary, ACCURACY).unwrap();
        assert!(found.is_brightest && found.reached, "{found:?}");
        (found.best.value, found.best_at[2] + by)
    });
    for (value, z) in at {
        assert!(value > 0.117 && (value - at[1].0).abs() < 1e-3, "{at:?}");
        // A tenth of the length of the peak.
        assert!((z - at[1].1).abs() < 4e-3, "{at:?}");
    }
}

/// Among points at random around the image none is brighter.
#[test]
fn no_point_of_the_blur_is_brighter() {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
    let mut searched = 0;
    for name in ["tessar_50_f28", "achromat_ac254_100"] {
        let model = RayModel::from_lens(&bundled(name), 0).unwrap();
        for field in model.fields.clone() {
            let found = strehl(&model, field, model.primary, ACCURACY).unwrap();
            if !found.is_brightest {
                continue;
            }
            searched += 1;
            for _ in 0..12 {
                let by = random.random_range(-0.4..0.4);
                let there = refocused(&model, by);
                let place = |_| [0, 1].map(|_| random.random_range(-0.02..0.02));
                let points: Vec<[f64; 2]> = (0..60).map(place).collect();
                let spread = point_spread(&there, field, model.primary, &points, ACCURACY).unwrap();
                for seen in spread.intensities {
                    let most = found.best.value + found.best.error + seen.error;
                    assert!(seen.value <= most, "{name} {by} {seen:?} {found:?}");
                }
            }
        }
    }
    assert!(searched >= 5, "{searched}");
}

/// The light of a ring, off the axis: uphill from the image plane of the whole aperture a maximum of 0.182 is found.
/// The shadow of the secondary mirror takes a tenth of the light away, and another point is the brightest then.
#[test]
fn the_brightest_point_of_a_telescope_is_found() {
    let accuracy = Accuracy { tolerance: 1e-3, ..ACCURACY };
    let with_shadow = bundled("telescope_rc_f8");
    let mut whole = with_shadow.clone();
    assert!(whole.surfaces[0].obstruction.take().is_some());
    for (lens, expected) in [(whole, 0.2421), (with_shadow, 0.2013)] {
        let model = RayModel::from_lens(&lens, 0).unwrap();
        let found = strehl(&model, model.fields[1], model.primary, accuracy).unwrap();
        assert!(found.is_brightest && found.reached, "{found:?}");
        assert!((found.best.value - expected).abs() < 2e-3, "{found:?}");
    }
}

/// A blur of many waves is not searched, and its best point is called a local one.
#[test]
fn a_blur_that_is_too_large_has_a_locally_best_point() {
    let model = RayModel::from_lens(&bundled("cooke_triplet_100_f27"), 0).unwrap();
    let field = *model.fields.last().unwrap();
    let accuracy = Accuracy { tolerance: 1e-2, max_rays: 20_000 };
    let found = strehl(&model, field, model.primary, accuracy).unwrap();
    assert!(!found.is_brightest && found.best_name() == "locally best", "{found:?}");
}

/// Light that runs against the axis is focused in front of an image plane that lies too far behind the mirror's focus.
#[test]
fn the_depth_of_the_brightest_point_is_that_along_the_axis() {
    let mirror = Surface {
        shape: Shape::new(-1.0 / 2000.0, -1.0, &[], 0).unwrap(),
        mirror: true,
        semi_diameter: 50.0,
        ..Surface::plane(-1000.1, 1.0)
    };
    let surfaces = vec![mirror, Surface::plane(0.0, 1.0)];
    let system = System { index_before: 1.0, surfaces, stop: Some(0) };
    let aperture = Aperture::EntrancePupilDiameter(100.0);
    let beam = Beam { object: Object::Infinity, aperture, field: FieldKind::Angle, edge: 1.0 };
    let model =
        RayModel::from_systems(vec![(0.5, 1.0, system)], 0, beam, Aiming::Paraxial).unwrap();
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let found = strehl(&model, axis, 0, ACCURACY).unwrap();
    assert!((found.best.value - 1.0).abs() < 1e-6, "{found:?}");
    assert!((found.best_at[2] - 0.1).abs() < 1e-4, "{found:?}");
}
