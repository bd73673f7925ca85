//! Numbers of surfaces that differ between zoom positions: a lens at one of them is the lens with that
//! number in its place, everywhere.

use crate::drag::{bundled, quantity as first_order_quantity};
use crate::merit::{check, step, vary, vary_at};
use aplanat::analysis::spot;
use aplanat::files;
use aplanat::lens::{
    Aperture, Edit, Lens, Medium, Object, Parameter, Quantity, Row, ZoomNumber, ZoomPosition,
    apply_edit, at_zoom,
};
use aplanat::merit::{Goal, PupilEdge, Term};
use aplanat::paraxial::{DragSettings, FirstOrderLock, Handle, HandleDrag};
use aplanat::pupil::{Accuracy, RayModel};
use aplanat::search::SearchRules;
use aplanat::search::lens_landscape::{DescentSettings, LensLandscape};
use std::sync::Arc;

/// A double Gauss at two positions between which a number of every kind differs.
fn lens() -> Lens {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.variables.clear();
    lens.surfaces[0].medium = Medium::Model { nd: 1.5725, vd: 57.5 };
    lens.surfaces[9].asphere = vec![1e-7];
    let number = |surface, quantity, value| ZoomNumber { surface, quantity, value };
    let row = |i: usize| &lens.surfaces[i];
    let numbers = vec![
        number(4, Quantity::Thickness, 1.1 * row(4).thickness),
        number(0, Quantity::Curvature, 1.02 * row(0).curvature),
        number(0, Quantity::Index, 1.58),
        number(3, Quantity::Conic, -0.05),
        number(9, Quantity::Asphere(0), -2e-7),
        number(8, Quantity::SemiDiameter, 0.9 * row(8).semi_diameter.unwrap()),
    ];
    let near = ZoomPosition { numbers, ..ZoomPosition::default() };
    lens.zoom = vec![ZoomPosition::default(), near];
    lens.check().unwrap();
    lens
}

/// The lens in which the numbers of a position are those of the lens.
fn written_out(lens: &Lens, zoom: usize) -> Lens {
    let mut single = lens.clone();
    for own in &lens.zoom[zoom].numbers {
        assert!(single.set(Parameter::new(own.surface, own.quantity), own.value));
    }
    single.zoom.clear();
    single
}

#[test]
fn a_position_is_the_lens_with_its_numbers() {
    let lens = lens();
    for zoom in 0..2 {
        let single = written_out(&lens, zoom);
        for line in &lens.wavelengths {
            let system = lens.resolve(zoom, line.um).unwrap();
            assert_eq!(system, single.resolve(0, line.um).unwrap());
            assert_eq!(system, at_zoom(&lens, zoom).resolve(0, line.um).unwrap());
        }
        let models = [(&lens, zoom), (&single, 0)];
        let models = models.map(|(lens, zoom)| RayModel::from_lens(lens, zoom).unwrap());
        for field in &models[0].fields {
            let [a, b] = models.each_ref().map(|model| spot(model, *field, Accuracy::default()));
            assert_eq!(a.unwrap().rms.value, b.unwrap().rms.value);
        }
    }
}

#[test]
fn a_merit_function_has_derivatives_by_numbers_of_positions() {
    let mut lens = lens();
    for (surface, quantity) in [
        (0, Quantity::Curvature),
        (0, Quantity::Index),
        (3, Quantity::Conic),
        (9, Quantity::Asphere(0)),
        (8, Quantity::SemiDiameter),
    ] {
        vary(&mut lens, surface, quantity);
        vary_at(&mut lens, Parameter::at_zoom(surface, quantity, 1));
    }
    vary(&mut lens, 2, Quantity::Curvature);
    for term in [Term::FocalLength(60.0), Term::GlassEdge(3.0)] {
        check(&lens, term, PupilEdge::Frozen, step);
    }
    lens.wavelengths.retain(|line| line.primary);
    check(&lens, Term::Spot, PupilEdge::Moving, step);
}

#[test]
fn a_drag_holds_the_focal_length_of_every_position() {
    let mut lens = lens();
    lens.image_solve = None;
    let locks = vec![FirstOrderLock::FocalLength];
    let settings = DragSettings { locks, ..DragSettings::default() };
    let handle = Handle::Curvature(0);
    for zoom in 0..2 {
        let shared = Arc::new(lens.clone());
        let drag = HandleDrag::new(&shared, handle, zoom, &settings, None).unwrap();
        let start = handle.value(&lens, zoom).unwrap();
        assert_eq!(start, lens.get(lens.parameter_at(zoom, 0, Quantity::Curvature)).unwrap());
        let moved = drag.to(1.01 * start).lens;
        let parameter = lens.parameter_at(zoom, 0, Quantity::Curvature);
        assert!((moved.get(parameter).unwrap() / start - 1.01).abs() < 1e-12);
        for at in 0..2 {
            let [old, new] = [&lens, &moved]
                .map(|lens| first_order_quantity(lens, at, FirstOrderLock::FocalLength));
            assert!((new / old - 1.0).abs() < 1e-9, "{zoom}, {at}: {old} and {new}");
        }
    }
}

#[test]
fn numbers_of_positions_follow_their_rows() {
    let lens = lens();
    let inserted = apply_edit(&lens, &Edit::InsertRow { at: 2, row: Row::default() }).unwrap();
    assert_eq!(inserted.zoom[1].number(10, Quantity::Asphere(0)), Some(-2e-7));
    assert_eq!(apply_edit(&inserted, &Edit::RemoveRow(2)).unwrap(), lens);

    let double = apply_edit(&lens, &Edit::Scale(2.0)).unwrap();
    for zoom in 0..2 {
        let other = apply_edit(&written_out(&lens, zoom), &Edit::Scale(2.0)).unwrap();
        let um = lens.wavelengths[0].um;
        assert_eq!(double.resolve(zoom, um).unwrap(), other.resolve(0, um).unwrap());
    }

    let last = lens.surfaces.len() - 1;
    let reversal = Edit::ReverseRows { first: 0, last };
    let mut straight = lens.clone();
    straight.object = Object::Finite(400.0);
    let turned = apply_edit(&straight, &reversal).unwrap();
    let there = apply_edit(&written_out(&straight, 1), &reversal).unwrap();
    let um = lens.wavelengths[0].um;
    assert_eq!(turned.resolve(1, um).unwrap(), there.resolve(0, um).unwrap());
}

#[test]
fn a_number_that_a_row_loses_is_lost_at_every_position() {
    let lens = lens();
    let medium = Medium::Glass("SCHOTT N-BK7".to_owned());
    let glass = apply_edit(&lens, &Edit::SetMedium { surface: 0, medium }).unwrap();
    assert_eq!(glass.zoom[1].number(0, Quantity::Index), None);
    assert_eq!(glass.zoom[1].numbers.len() + 1, lens.zoom[1].numbers.len());

    // The size of a stop that is the aperture is one number, not two.
    let stop = lens.stop().unwrap();
    let mut limited = lens.clone();
    limited.aperture = Aperture::EntrancePupilDiameter(9.0);
    limited.zoom[1].set_number(stop, Quantity::SemiDiameter, 5.0);
    limited.check().unwrap();
    limited.aperture = Aperture::StopSemiDiameter(6.0);
    let text = limited.check().unwrap_err().to_string();
    assert!(text.contains("expected the aperture of the position"), "{text}");
    let aperture = Edit::SetAperture(Aperture::StopSemiDiameter(6.0));
    limited.aperture = Aperture::EntrancePupilDiameter(9.0);
    let edited = apply_edit(&limited, &aperture).unwrap();
    assert_eq!(edited.zoom[1].number(stop, Quantity::SemiDiameter), None);
}

#[test]
fn wrong_numbers_of_positions_are_refused_by_name() {
    let with = |number: ZoomNumber| {
        let mut lens = lens();
        lens.zoom[1].numbers.push(number);
        lens.check().unwrap_err().to_string()
    };
    let number = |surface, quantity, value| ZoomNumber { surface, quantity, value };
    let twice = with(number(3, Quantity::Conic, 0.0));
    assert!(twice.contains("two numbers for the conic constant of surface 4"), "{twice}");
    let missing = with(number(1, Quantity::Index, 1.5));
    assert!(missing.contains("index after surface 2"), "{missing}");
    let negative = with(number(1, Quantity::SemiDiameter, -1.0));
    assert!(negative.contains("semi-diameter of surface 2"), "{negative}");
    let far = with(number(99, Quantity::Conic, 1.0));
    assert!(far.contains("zoom position 1 names surface 100"), "{far}");
    let infinite = with(number(1, Quantity::Conic, f64::INFINITY));
    assert!(infinite.contains("conic constant of surface 2 at zoom position 1"), "{infinite}");
}

#[test]
fn files_have_the_numbers_of_positions() {
    let lens = lens();
    let text = serde_json::to_string(&lens).unwrap();
    assert_eq!(serde_json::from_str::<Lens>(&text).unwrap(), lens);
    let um = lens.wavelengths[0].um;
    let folder = std::env::temp_dir();
    for (extension, lost) in [
        ("zmx", [(0, Quantity::Index), (9, Quantity::Asphere(0))]),
        ("seq", [(0, Quantity::Index), (8, Quantity::SemiDiameter)]),
    ] {
        let file = folder.join(format!("aplanat-{}-zoom.{extension}", std::process::id()));
        // What the format cannot hold would change the rays, and is refused.
        let refused = files::save(&lens, &file).unwrap_err().to_string();
        assert!(refused.contains("zoom 1"), "{refused}");
        let mut kept = lens.clone();
        for (surface, quantity) in lost {
            kept.zoom[1].remove_number(surface, quantity);
        }
        files::save(&kept, &file).unwrap();
        let back = files::open(&file).unwrap().lens;
        std::fs::remove_file(&file).unwrap();
        for zoom in 0..2 {
            let [a, b] = [&kept, &back].map(|lens| lens.resolve(zoom, um).unwrap());
            for (a, b) in a.surfaces.iter().zip(&b.surfaces) {
                let close = |a: f64, b: f64| (a - b).abs() <= 1e-12 * a.abs().max(1e-6);
                assert!(close(a.curvature(), b.curvature()), "{extension}: {zoom}");
                assert!(close(a.thickness, b.thickness), "{extension}: {zoom}");
                assert!(close(a.index, b.index), "{extension}: {zoom}");
            }
        }
    }
}

#[test]
fn a_search_refuses_what_its_mutations_do_not_know() {
    let rules = SearchRules::default();
    let found = LensLandscape::new(
        &lens(),
        &Goal::with_limits(&lens(), &rules.goal_limits(), None, 0.98).unwrap(),
        &rules,
        &DescentSettings::default(),
    );
    let text = found.unwrap_err().to_string();
    assert!(text.contains("the curvature of surface 1"), "{text}");
}
