//! First-order data of thin lenses.

use super::{FOCAL, assert_near, beam, field, lens, system, thin_lens, thin_rows};
use aplanat::lens::{Aperture, FieldKind, Object, Surface, System};
use aplanat::paraxial::{Beam, FirstOrder, first_order};

/// A thin lens with the stop `behind` it and the image plane `distance` behind the stop.
fn with_stop(behind: f64, distance: f64) -> System<f64> {
    let [front, rear] = thin_lens(FOCAL, behind);
    let stop = Surface { thickness: distance, ..crate::aperture::image() };
    system(vec![front, rear, stop], 2)
}

fn data(system: &System<f64>, beam: &Beam) -> FirstOrder<f64> {
    first_order(system, beam).unwrap()
}

#[test]
fn the_f_number_is_focal_length_over_diameter() {
    let thin = system(thin_lens(FOCAL, FOCAL).to_vec(), 0);
    let far = data(&thin, &beam(25.0, 0.0));
    assert_near(far.f_number.unwrap(), 4.0, 1e-14);
    assert_near(far.working_f_number.unwrap(), 4.0, 1e-14);
    // At unit magnification the working f-number is twice as large: N (1 − m).
    let near = Beam { object: Object::Finite(2.0 * FOCAL), ..beam(25.0, 0.0) };
    let near = data(&thin, &near);
    assert_near(near.f_number.unwrap(), 4.0, 1e-14);
    assert_near(near.working_f_number.unwrap(), 8.0, 1e-14);
    // An f-number as the aperture is the one that comes out.
    let asked = Beam { aperture: Aperture::FNumber(2.8), ..beam(0.0, 0.0) };
    let asked = data(&thin, &asked);
    assert_near(asked.f_number.unwrap(), 2.8, 1e-14);
    assert_near(asked.entrance_pupil.diameter.unwrap(), FOCAL / 2.8, 1e-14);
}

#[test]
fn the_chief_ray_of_an_image_height_lands_there() {
    let edge = 7.0;
    for (object, image) in [(Object::Infinity, FOCAL), (Object::Finite(300.0), 150.0)] {
        let beam = Beam { object, field: FieldKind::ImageHeight, edge, ..beam(10.0, 0.0) };
        let chief = data(&with_stop(20.0, image - 20.0), &beam).chief.unwrap();
        assert!(chief.heights[2].abs() < 1e-14, "{}", chief.heights[2]);
        assert_near(*chief.heights.last().unwrap(), edge, 1e-13);
    }
}

#[test]
fn a_telecentric_chief_ray_starts_at_the_object_point() {
    // The stop in the back focal plane, the object in the front one: parallel to the axis in front
    // of the lens, at −h/f behind it.
    let height = 3.0;
    let beam = Beam {
        object: Object::Finite(FOCAL),
        aperture: Aperture::ObjectNa(0.1),
        field: FieldKind::ObjectHeight,
        edge: height,
    };
    let found = data(&with_stop(FOCAL, FOCAL), &beam);
    assert_eq!(found.entrance_pupil.position, None);
    let chief = found.chief.unwrap();
    assert_eq!((chief.start_slope, chief.heights[0]), (0.0, height));
    assert_near(chief.slopes[1], -height / FOCAL, 1e-13);
    assert_near(chief.heights[3], -height, 1e-13);
}

#[test]
fn the_edge_of_the_field_is_its_farthest_point() {
    let aperture = Aperture::EntrancePupilDiameter(10.0);
    let mut lens = lens(thin_rows(FOCAL).to_vec(), aperture, &[0.0, 2.0]);
    for (x, y, edge) in [(3.0, 4.0, 5.0), (-6.0, 0.0, 6.0), (0.0, -4.0, -4.0), (1.0, 0.0, 2.0)] {
        lens.fields.values.push(field(x, y));
        assert_eq!(Beam::for_lens(&lens, 0).edge, edge, "({x}, {y})");
        lens.fields.values.pop();
    }
}
