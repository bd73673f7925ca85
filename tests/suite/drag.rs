//! Handles of a lens: what is locked is held exactly, what cannot be held stops by name.

use aplanat::files::{bundled_lenses, json};
use aplanat::lens::{Aperture, Lens, LensSection, Medium, Object, Parameter, Quantity, Variable};
use aplanat::paraxial::{
    Beam, DragError, DragOutcome, DragSettings, DragStop, FirstOrder, FirstOrderLock, FreeNumbers,
    Handle, HandleDrag, HandlePlaces, HandleUnit, LockError, first_order, short_name,
};
use std::sync::Arc;

use FirstOrderLock::{BackFocus, FocalLength, Focus, Magnification, Track};

pub(crate) fn bundled(name: &str) -> Lens {
    let found = bundled_lenses().iter().find(|bundled| bundled.name == name).unwrap();
    json::read(found.text, name).unwrap()
}

fn first(lens: &Lens, zoom: usize) -> FirstOrder<f64> {
    let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um).unwrap();
    first_order(&system, &Beam::for_lens(lens, zoom)).unwrap()
}

fn track(lens: &Lens, zoom: usize) -> f64 {
    lens.resolve(zoom, lens.wavelengths[lens.primary()].um).unwrap().total_track()
}

fn locked(locks: &[FirstOrderLock]) -> DragSettings {
    DragSettings { locks: locks.to_vec(), ..DragSettings::default() }
}

fn drag(lens: &Lens, handle: Handle, locks: &[FirstOrderLock]) -> HandleDrag {
    HandleDrag::new(&Arc::new(lens.clone()), handle, 0, &locked(locks), None).unwrap()
}

/// A locked quantity as first-order optics computes it.
pub(crate) fn quantity(lens: &Lens, zoom: usize, lock: FirstOrderLock) -> f64 {
    let data = first(lens, zoom);
    match lock {
        FocalLength => data.efl.unwrap(),
        BackFocus => data.paraxial_image.unwrap(),
        Focus => data.image_defocus.unwrap(),
        Magnification => data.magnification.unwrap(),
        Track => track(lens, zoom),
    }
}

/// The largest relative deviation of the locked quantities from those of the lens before.
fn deviation(before: &Lens, after: &Lens, locks: &[FirstOrderLock]) -> f64 {
    let mut worst: f64 = 0.0;
    for zoom in 0..before.zoom_positions() {
        let size = first(before, zoom).efl.unwrap().abs();
        for lock in locks {
            let (old, new) = (quantity(before, zoom, *lock), quantity(after, zoom, *lock));
            let scale = if *lock == Magnification { old.abs() } else { size.max(old.abs()) };
            let off = (new - old).abs() / scale;
            worst = worst.max(if off.is_nan() { f64::INFINITY } else { off });
        }
    }
    worst
}

/// The handles that change the first-order data, and a value of each a little away from its own.
fn moves(lens: &Lens) -> Vec<(Handle, f64)> {
    let size = first(lens, 0).efl.unwrap().abs();
    let handles = Handle::all(lens, 0).into_iter();
    let moved = handles.filter_map(|handle| {
        let value = handle.value(lens, 0)?;
        let by = match handle {
            Handle::Curvature(_) | Handle::Bending { .. } => 0.05 / size,
            Handle::Vertex(_) | Handle::Element { .. } | Handle::ImagePlane => 0.004 * size,
            _ => return None,
        };
        Some((handle, value + by))
    });
    moved.collect()
}

fn settings_of(lens: &Lens) -> Vec<Vec<FirstOrderLock>> {
    let mut sets = vec![vec![FocalLength], vec![FocalLength, BackFocus], vec![Focus, Track]];
    if lens.object != Object::Infinity {
        sets.push(vec![Magnification, Track]);
    }
    sets
}

#[test]
fn locks_are_held_on_every_lens_of_the_library() {
    let (mut held, mut whole) = (0, 0);
    for bundled in bundled_lenses() {
        let lens = json::read(bundled.text, bundled.name).unwrap();
        for locks in settings_of(&lens) {
            let moves = moves(&lens);
            let every = moves.len().div_ceil(6);
            for (handle, value) in moves.into_iter().step_by(every) {
                let found = drag(&lens, handle, &locks).to(value);
                let off = deviation(&lens, &found.lens, &locks);
                assert!(off < 1e-9, "{}, {handle}, {locks:?}: {off:e}", lens.name);
                assert_eq!(found.stop.is_none(), found.value == value, "{}: {handle}", lens.name);
                held += 1;
                whole += usize::from(found.value == value);
            }
        }
    }
    assert!(held > 300 && whole * 10 > held * 8, "{whole} of {held}");
}

#[test]
fn an_image_solve_counts_as_what_it_gives() {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.image_solve = Some(-0.05);
    for locks in [vec![Track], vec![FocalLength, BackFocus], vec![FocalLength, Focus, Track]] {
        let found = drag(&lens, Handle::Curvature(1), &locks).to(lens.surfaces[1].curvature + 2e-3);
        assert_eq!(found.stop, None);
        assert!(deviation(&lens, &found.lens, &locks) < 1e-9, "{locks:?}");
    }
}

#[test]
fn a_handle_that_comes_back_gives_the_lens_that_it_started_from() {
    let lens = bundled("double_gauss_nikkor_s_50");
    let drag = drag(&lens, Handle::Curvature(2), &[FocalLength, BackFocus]);
    let (there, again) = (drag.to(drag.start() + 1e-3), drag.to(drag.start() + 1e-3));
    assert_eq!(there, again);
    assert!(!there.moved.is_empty());
    assert_eq!(drag.to(drag.start()).lens, lens);
    let moved = Parameter::new(2, Quantity::Curvature);
    assert_eq!(there.lens.get(moved), Some(drag.start() + 1e-3), "the handle has the very value");
    assert!(there.moved.iter().all(|number| number.parameter != moved));
}

#[test]
fn more_free_numbers_change_less() {
    let mut lens = bundled("cooke_triplet_100_f27");
    let some = [0, 3, 5].map(|surface| Parameter::new(surface, Quantity::Curvature));
    lens.variables = some.map(|parameter| Variable { parameter, min: None, max: None }).into();
    let change = |free: FreeNumbers| {
        let settings = DragSettings { locks: vec![FocalLength], free };
        let drag =
            HandleDrag::new(&Arc::new(lens.clone()), Handle::Curvature(1), 0, &settings, None);
        let found = drag.unwrap().to(lens.surfaces[1].curvature + 1e-3);
        let steps = |quantity| if quantity == Quantity::Curvature { 0.3 / 100.0 } else { 1.0 };
        let parts = found.moved.iter().map(|m| (m.after - m.before) / steps(m.parameter.quantity));
        (parts.map(|z| z * z).sum::<f64>().sqrt(), found)
    };
    let ((all, _), (few, found)) = (change(FreeNumbers::All), change(FreeNumbers::Variables));
    assert!(0.0 < all && all < few, "{all} {few}");
    assert!(found.moved.iter().all(|number| some.contains(&number.parameter)));
}

#[test]
fn what_cannot_be_held_stops_the_handle_by_name() {
    // A plano-convex lens: nothing but the plane and two gaps could make up for its curvature.
    let mut lens = bundled("singlet_la1131");
    let variables = [0, 1].map(|surface| Parameter::new(surface, Quantity::Thickness));
    lens.variables = variables.map(|parameter| Variable { parameter, min: None, max: None }).into();
    let settings = DragSettings { locks: vec![FocalLength], free: FreeNumbers::Variables };
    let start = Arc::new(lens.clone());
    let bent = usize::from(lens.surfaces[0].curvature == 0.0);
    let drag = HandleDrag::new(&start, Handle::Curvature(bent), 0, &settings, None).unwrap();
    let found = drag.to(2.0 * drag.start());
    let Some(DragStop::Locks { locks, .. }) = &found.stop else { panic!("{:?}", found.stop) };
    assert_eq!(locks, &[FocalLength]);
    let text = found.stop.as_ref().unwrap().to_string();
    assert!(text.starts_with("the focal length cannot be held: "), "{text}");
    assert!(deviation(&lens, &found.lens, &[FocalLength]) < 1e-9);

    let refused = |lens: &Lens, lock| {
        let start = Arc::new(lens.clone());
        HandleDrag::new(&start, Handle::Curvature(0), 0, &locked(&[lock]), None).unwrap_err()
    };
    let far = refused(&lens, Magnification);
    assert_eq!(far, DragError::Lock(Magnification, LockError::ObjectAtInfinity));
    for row in &mut lens.surfaces {
        row.curvature = 0.0;
    }
    let none = refused(&lens, FocalLength);
    assert_eq!(none.to_string(), "the focal length cannot be held: the lens has no focal length");
    let beyond = refused(&lens, BackFocus);
    assert_eq!(beyond.to_string(), "the back focus cannot be held: the image is at infinity");
}

#[test]
fn a_vertex_stops_at_its_neighbours_and_a_variable_at_its_bound() {
    let mut lens = bundled("cooke_triplet_100_f27");
    let stopped = |found: DragOutcome| found.stop.unwrap().to_string();
    let gap = lens.surfaces[1].thickness;
    let found = drag(&lens, Handle::Vertex(2), &[]).to(-3.0);
    assert_eq!((found.value, found.lens.surfaces[1].thickness), (0.0, 0.0));
    assert_eq!(stopped(found), "the gap after surface 2 is used up");
    let found = drag(&lens, Handle::Vertex(2), &[]).to(1e9);
    assert_eq!(stopped(found), "the gap after surface 3 is used up");
    let parameter = Parameter::new(1, Quantity::Thickness);
    lens.variables = vec![Variable { parameter, min: Some(gap - 0.5), max: None }];
    let found = drag(&lens, Handle::Vertex(2), &[]).to(gap - 2.0);
    assert_eq!(found.value, gap - 0.5);
    assert_eq!(stopped(found), "the thickness after surface 2 is at the bound of its variable");
}

#[test]
fn extreme_values_never_give_an_unusable_lens() {
    for bundled in bundled_lenses() {
        let lens = json::read(bundled.text, bundled.name).unwrap();
        let handles = Handle::all(&lens, 0);
        let every = handles.len().div_ceil(9);
        for handle in handles.into_iter().step_by(every) {
            let start = Arc::new(lens.clone());
            let Ok(drag) = HandleDrag::new(&start, handle, 0, &locked(&[FocalLength]), Some(5.0))
            else {
                panic!("{}: {handle}", lens.name);
            };
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e9, -1e9, 0.0] {
                let found = drag.to(value);
                found.lens.check().unwrap();
                assert!(found.value.is_finite() || found.stop.is_some(), "{handle} to {value}");
                assert!(found.stop.is_some() || found.value == value, "{handle} to {value}");
            }
        }
    }
}

#[test]
fn the_tangent_is_the_derivative_of_the_drag() {
    let lens = bundled("double_gauss_nikkor_s_50");
    for (handle, h) in [(Handle::Curvature(3), 1e-5), (Handle::Vertex(4), 1e-3)] {
        let drag = drag(&lens, handle, &[FocalLength, BackFocus]);
        let (up, down) = (drag.to(drag.start() + h).lens, drag.to(drag.start() - h).lens);
        for (parameter, slope) in drag.tangent().unwrap() {
            let difference =
                (up.get(parameter).unwrap() - down.get(parameter).unwrap()) / (2.0 * h);
            let size = if parameter.quantity == Quantity::Curvature { 1e-3 } else { 0.1 };
            let scale = if matches!(handle, Handle::Curvature(_)) { 100.0 } else { 1.0 };
            assert!(
                (slope - difference).abs() < 2e-4 * size * scale + 1e-3 * slope.abs(),
                "{parameter}"
            );
        }
    }
}

#[test]
fn beam_field_and_stop_take_the_value_that_was_asked_for() {
    let lens = bundled("tessar_50_f28");
    let edge = Beam::for_lens(&lens, 0).edge;
    let wide = drag(&lens, Handle::FieldHeight, &[FocalLength]).to(edge * 1.25).lens;
    assert_eq!(Beam::for_lens(&wide, 0).edge, edge * 1.25);
    assert_eq!(wide.fields.values.len(), lens.fields.values.len());
    let size = drag(&lens, Handle::StopSize, &[]);
    let small = size.to(0.5 * size.start()).lens;
    assert!((first(&small, 0).stop_semi_diameter / (0.5 * size.start()) - 1.0).abs() < 1e-12);
    let fast = bundled("cooke_triplet_100_f27");
    let size = drag(&fast, Handle::StopSize, &[]);
    let small = size.to(0.5 * size.start()).lens;
    assert!((first(&small, 0).stop_semi_diameter / (0.5 * size.start()) - 1.0).abs() < 1e-12);
    assert_eq!(
        drag(&fast, Handle::BeamWidth, &[]).to(4.0).lens.aperture_at(0),
        Aperture::FNumber(4.0)
    );
}

#[test]
fn handles_follow_the_pointer() {
    for name in [
        "double_gauss_nikkor_s_50",
        "telescope_rc_f8",
        "microscope_us5000548_1",
        "zoom_nikkor_28_80",
    ] {
        let lens = bundled(name);
        let data = first(&lens, 0);
        let reach = 0.002 * data.efl.unwrap().abs();
        for handle in Handle::all(&lens, 0) {
            let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
            let section = LensSection::new(&system, &[]);
            let places =
                HandlePlaces { lens: &lens, zoom: 0, section: &section, first_order: &data };
            let Some([z, y]) = places.place(handle) else { continue };
            let drag = drag(&lens, handle, &[]);
            let start = drag.start();
            let unmoved = places.value_after(handle, start, [0.0, 0.0]).unwrap();
            assert!((unmoved - start).abs() <= 1e-9 * start.abs().max(1e-6), "{name}: {handle}");
            // Only what moves one handle and lets the others be: the place follows the pointer.
            let delta = match handle {
                Handle::Vertex(0) | Handle::Element { front: 0, .. } => continue,
                Handle::Vertex(_) | Handle::Curvature(_) | Handle::Element { .. } => {
                    [0.1 * reach, 0.0]
                }
                Handle::ImagePlane => [reach, 0.0],
                _ => continue,
            };
            let found = drag.to(places.value_after(handle, start, delta).unwrap());
            if found.stop.is_some() {
                continue;
            }
            let system = found.lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
            let section = LensSection::new(&system, &[]);
            let after = first(&found.lens, 0);
            let places =
                HandlePlaces { lens: &found.lens, zoom: 0, section: &section, first_order: &after };
            let [to_z, to_y] = places.place(handle).unwrap();
            let off = (to_z - z - delta[0]).abs().max((to_y - y - delta[1]).abs());
            assert!(off < 0.02 * delta[0], "{name}: {handle} is {off:e} beside the pointer");
        }
    }
}

/// Where the pointer leads a handle, in closed form.
#[test]
fn values_follow_the_pointer() {
    let lens = bundled("double_gauss_rudolph_50");
    let (system, data) =
        (lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap(), first(&lens, 0));
    let section = LensSection::new(&system, &[]);
    let places = HandlePlaces { lens: &lens, zoom: 0, section: &section, first_order: &data };
    let value = |handle: Handle, start: f64, delta: [f64; 2]| {
        places.value_after(handle, start, delta).unwrap()
    };
    assert_eq!(value(Handle::Rim(2), 9.0, [0.3, 0.5]), 9.5);
    assert_eq!(value(Handle::ImagePlane, 2.0, [-0.3, 0.5]), 1.7);
    let near = |found: f64, expected: f64| {
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    };
    let stop = data.stop_semi_diameter;
    near(value(Handle::StopSize, stop, [0.0, -1.0]), stop - 1.0);
    let [_, y] = places.place(Handle::FieldHeight).unwrap();
    let edge = 20.0_f64;
    near(value(Handle::FieldHeight, edge, [0.0, 0.0]), edge);
    let wider = value(Handle::FieldHeight, edge, [0.0, 0.25 * y]);
    near(wider.to_radians().tan(), 1.25 * edge.to_radians().tan());
    let mut heights = lens.clone();
    heights.fields.kind = aplanat::lens::FieldKind::ImageHeight;
    let of_heights = HandlePlaces { lens: &heights, ..places };
    near(of_heights.value_after(Handle::FieldHeight, 18.0, [0.0, 0.25 * y]).unwrap(), 1.25 * 18.0);
    let [_, y] = places.place(Handle::BeamWidth).unwrap();
    let factor =
        value(Handle::BeamWidth, 1.0, [0.0, 0.5 * y]) / value(Handle::BeamWidth, 1.0, [0.0; 2]);
    let fast = matches!(lens.aperture, Aperture::FNumber(_));
    near(factor, if fast { 1.0 / 1.5 } else { 1.5 });
}

#[test]
fn numbers_that_move_have_short_names() {
    let name = |surface, quantity| short_name(Parameter::new(surface, quantity));
    assert_eq!(name(2, Quantity::Curvature), "R3");
    assert_eq!(name(0, Quantity::Thickness), "t1");
    let gap = Parameter::at_zoom(4, Quantity::Thickness, 1);
    assert_eq!(short_name(gap), "t5 (zoom 2)");
}

/// The stop moves along the lens, and the beam of the axis stays what it was.
#[test]
fn a_stop_that_moves_to_another_surface_keeps_the_beam() {
    let mut lens = bundled("tessar_50_f28");
    let stop = lens.stop().unwrap();
    lens.aperture = Aperture::StopSemiDiameter(first(&lens, 0).stop_semi_diameter);
    let before = first(&lens, 0);
    for surface in [0, 2] {
        assert_ne!(surface, stop);
        let mut other = lens.clone();
        other.surfaces.iter_mut().enumerate().for_each(|(i, row)| row.stop = i == surface);
        other.aperture = Aperture::EntrancePupilDiameter(before.entrance_pupil.diameter.unwrap());
        let height = first(&other, 0).stop_semi_diameter;
        let handle = Handle::StopPosition;
        if handle.unit(&other, 0) != HandleUnit::Surface {
            continue;
        }
        // From the surface where it now is to the next one, and the beam is the same again.
        other.aperture = Aperture::StopSemiDiameter(height);
        let found = drag(&other, handle, &[]).to((surface + 1) as f64);
        assert_eq!((found.stop, found.lens.stop()), (None, Some(surface + 1)));
        let after = first(&found.lens, 0);
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
        assert!(near(after.f_number.unwrap(), before.f_number.unwrap()), "{surface}");
        let rim = found.lens.surfaces[surface + 1].semi_diameter.unwrap();
        assert!(rim >= after.stop_semi_diameter - 1e-9, "{rim}");
    }
}

/// One handle of the stop moves it and one opens it: they lie on opposite sides of the axis.
#[test]
fn the_handles_of_the_stop_are_apart() {
    let lens = bundled("double_gauss_rudolph_50");
    let (system, data) =
        (lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap(), first(&lens, 0));
    let section = LensSection::new(&system, &[]);
    let places = HandlePlaces { lens: &lens, zoom: 0, section: &section, first_order: &data };
    let [position, size] =
        [Handle::StopPosition, Handle::StopSize].map(|handle| places.place(handle).unwrap());
    assert_eq!(size[1], data.stop_semi_diameter);
    assert!(position[1] < 0.0 && (position[0] - size[0]).abs() < 1e-9, "{position:?} {size:?}");
}

/// What is drawn of a section: every glass with its index, and the highest rim.
#[test]
fn a_section_has_every_element_and_the_height_of_its_highest_rim() {
    for name in ["double_gauss_rudolph_50", "telescope_rc_f8", "zoom_nikkor_28_80"] {
        let lens = bundled(name);
        let um = lens.wavelengths[lens.primary()].um;
        let system = lens.resolve(0, um).unwrap();
        let section = LensSection::new(&system, &[]);
        let is_glass =
            |row: &aplanat::lens::Row| !matches!(row.medium, Medium::Air | Medium::Mirror);
        let glasses: Vec<usize> =
            (0..lens.surfaces.len()).filter(|i| is_glass(&lens.surfaces[*i])).collect();
        let found: Vec<(usize, f64)> = section.elements().collect();
        assert_eq!(found.iter().map(|(i, _)| *i).collect::<Vec<_>>(), glasses, "{name}");
        assert!(found.iter().all(|(i, n)| *n == system.surfaces[*i].index && *n > 1.3));
        let rims = lens.surfaces.iter().filter_map(|row| row.semi_diameter);
        assert_eq!(section.max_height(), rims.fold(0.0, f64::max), "{name}");
    }
}
