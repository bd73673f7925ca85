//! Where the rays of a drawing begin.

use super::{FOCAL, lens, row, thin_rows};
use aplanat::analysis::ray_layout;
use aplanat::lens::{Aperture, FieldKind, Lens, Object, Row};
use aplanat::pupil::RayModel;

/// A stop, and a thin lens behind it: 120 mm up to the image.
fn stopped(object: Object) -> Lens {
    let stop = Row { stop: true, ..row(0.0, 20.0, 1.0) };
    let rows = [stop].into_iter().chain(thin_rows(FOCAL)).collect();
    Lens { object, ..lens(rows, Aperture::EntrancePupilDiameter(10.0), &[0.0, 5.0]) }
}

/// The z and the height over the axis at which every ray begins.
fn starts(lens: &Lens) -> Vec<[f64; 2]> {
    let layout = ray_layout(&RayModel::from_lens(lens, 0).unwrap(), 5);
    assert!(layout.errors.is_empty() && layout.rays.len() == 10, "{:?}", layout.errors);
    layout.rays.iter().map(|ray| [ray.path.points[0].z, ray.path.points[0].y]).collect()
}

#[test]
fn rays_begin_in_front_of_the_lens_or_at_the_object() {
    // 15 % of the total track in front of the first surface.
    for z in starts(&stopped(Object::Infinity)).iter().map(|start| start[0]) {
        assert!((z + 0.15 * 120.0).abs() < 1e-9, "{z}");
    }
    let far = Lens { aperture: Aperture::ObjectNa(0.01), ..stopped(Object::Finite(500.0)) };
    assert!(starts(&far).iter().all(|start| (start[0] + 18.0).abs() < 1e-9), "{:?}", starts(&far));
    // A near object is where its rays begin, all at one height.
    let mut near = Lens { aperture: Aperture::ObjectNa(0.2), ..stopped(Object::Finite(11.0)) };
    near.fields.kind = FieldKind::ObjectHeight;
    for (i, [z, y]) in starts(&near).into_iter().enumerate() {
        let height = if i < 5 { 0.0 } else { 5.0 };
        assert!((z + 11.0).abs() < 1e-9 && (y.abs() - height).abs() < 1e-9, "{z} {y}");
    }
    // Light that converges towards an object behind the first surface comes from in front of it.
    let mut behind = stopped(Object::Finite(-60.0));
    behind.fields.kind = FieldKind::ObjectHeight;
    for [z, _] in starts(&behind) {
        assert!((z + 18.0).abs() < 1e-9, "{z}");
    }
}
