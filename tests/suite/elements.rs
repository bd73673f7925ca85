//! A lens begun from nothing, and edits of whole elements: each one edit, with what it keeps.

use aplanat::files;
use aplanat::lens::{
    Aperture, Edit, ElementEdit, ElementForm, FieldKind, Fields, Lens, Medium, NewElement, Object,
    Row, StartingForm, StartingLens, WavelengthPreset, ZoomNumber, ZoomPosition, apply_edit,
};
use aplanat::paraxial::{Beam, FirstOrder, first_order, seidel};
use aplanat::session::{AnalysisSettings, Command, Session, analyze};

fn starting(form: StartingForm) -> StartingLens {
    StartingLens {
        form,
        focal_length: 35.0,
        aperture: Aperture::FNumber(4.0),
        fields: Fields::equal_area(FieldKind::Angle, 14.0, 3),
        wavelengths: WavelengthPreset::ALL[0].wavelengths(),
        object: Object::Infinity,
    }
}

fn first(lens: &Lens) -> FirstOrder<f64> {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
    first_order(&system, &Beam::for_lens(lens, 0)).unwrap()
}

fn singlet() -> Lens {
    starting(StartingForm::Element(ElementForm::Singlet)).lens().unwrap()
}

fn doublet() -> Lens {
    starting(StartingForm::Element(ElementForm::CementedDoublet)).lens().unwrap()
}

fn edited(lens: &Lens, edit: ElementEdit) -> Lens {
    apply_edit(lens, &Edit::Element(edit)).unwrap()
}

/// The reason why an edit is refused.
fn refusal(lens: &Lens, edit: ElementEdit) -> String {
    apply_edit(lens, &Edit::Element(edit)).unwrap_err().to_string()
}

/// The positions of all vertices and of the image plane, from the first vertex.
fn vertices(lens: &Lens) -> Vec<f64> {
    let gaps = lens.surfaces.iter();
    gaps.scan(0.0, |z, row| {
        *z += row.thickness;
        Some(*z)
    })
    .collect()
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs().max(1.0)
}

#[test]
fn a_new_lens_has_the_focal_length_and_aperture_that_were_asked_for() {
    for form in [ElementForm::Singlet, ElementForm::CementedDoublet] {
        let lens = starting(StartingForm::Element(form)).lens().unwrap();
        let data = first(&lens);
        assert!(close(data.efl.unwrap(), 35.0), "{form:?}: {:?}", data.efl);
        assert!(close(data.f_number.unwrap(), 4.0));
        assert!(data.image_defocus.unwrap().abs() < 1e-9, "the image plane is in focus");
        let numbers = analyze(&lens, &AnalysisSettings::default()).unwrap();
        assert_eq!(numbers.layout.value.fates.total(), numbers.layout.value.fates.imaged);
    }
}

#[test]
fn a_lens_without_any_glass_is_analysed_without_an_error() {
    for aperture in [Aperture::FNumber(2.0), Aperture::EntrancePupilDiameter(5.0)] {
        let empty = StartingLens { aperture, ..starting(StartingForm::Empty) };
        let lens = empty.lens().unwrap();
        assert_eq!(lens.surfaces.len(), 1);
        assert!(lens.surfaces[0].stop);
        let numbers = analyze(&lens, &AnalysisSettings::default()).unwrap();
        assert_eq!(numbers.first_order().efl, None);
        assert!(numbers.layout.value.errors.is_empty(), "rays go straight to the image plane");
    }
}

#[test]
fn an_empty_lens_with_image_heights_gets_the_angles_that_belong_to_them() {
    let fields = Fields::equal_area(FieldKind::ImageHeight, 21.6, 2);
    let lens = StartingLens { fields, ..starting(StartingForm::Empty) }.lens().unwrap();
    assert_eq!(lens.fields.kind, FieldKind::Angle);
    assert!(close(lens.fields.values[1].y.to_radians().tan() * 35.0, 21.6));
}

#[test]
fn an_element_in_an_empty_lens_brings_the_image_into_focus() {
    let lens = starting(StartingForm::Empty).lens().unwrap();
    let element = NewElement {
        form: ElementForm::Singlet,
        focal_length: 35.0,
        semi_diameter: 5.0,
        shape_factor: 0.0,
    };
    let rows = element.rows(0.5875618).unwrap();
    let lens = edited(&lens, ElementEdit::Insert { at: 1, rows });
    assert_eq!(lens.surfaces.len(), 3);
    let data = first(&lens);
    assert!(close(data.efl.unwrap(), 35.0));
    assert!(data.image_defocus.unwrap().abs() < 1e-9);
}

#[test]
fn a_finite_object_is_imaged_in_focus() {
    let object = Object::Finite(105.0);
    let form = StartingForm::Element(ElementForm::CementedDoublet);
    for aperture in [Aperture::ObjectNa(0.05), Aperture::FNumber(5.0)] {
        let asked = StartingLens { object, aperture, ..starting(form) };
        let data = first(&asked.lens().unwrap());
        assert!(close(data.efl.unwrap(), 35.0));
        assert!((data.magnification.unwrap() + 0.5).abs() < 0.05, "{:?}", data.magnification);
        assert!(data.image_defocus.unwrap().abs() < 1e-9);
    }
}

#[test]
fn what_cannot_begin_a_lens_is_refused_with_its_name() {
    let form = StartingForm::Element(ElementForm::Singlet);
    let cases = [
        (StartingLens { focal_length: 0.0, ..starting(form) }, "focal length"),
        (StartingLens { focal_length: f64::NAN, ..starting(form) }, "focal length"),
        (StartingLens { aperture: Aperture::FNumber(-1.0), ..starting(form) }, ""),
        (StartingLens { object: Object::Finite(30.0), ..starting(form) }, "object distance"),
        (StartingLens { wavelengths: Vec::new(), ..starting(form) }, "wavelength"),
    ];
    for (asked, what) in cases {
        let why = asked.lens().unwrap_err().to_string();
        assert!(why.contains(what), "{why}");
    }
}

#[test]
fn an_inserted_element_leaves_the_others_in_place_where_there_is_room() {
    let lens = files::parse(files::bundled_lenses()[0].text.as_bytes(), "x").unwrap().lens;
    let at = lens.stop().unwrap() + 1;
    let room = lens.surfaces[at - 1].thickness;
    let glass = |thickness| Row {
        thickness,
        medium: Medium::Glass("SCHOTT N-BK7".into()),
        ..Row::default()
    };
    let rows = vec![glass(0.5 * room), Row::default()];
    let more = edited(&lens, ElementEdit::Insert { at, rows });
    assert!(close(*vertices(&more).last().unwrap(), *vertices(&lens).last().unwrap()));
    let rows = vec![glass(2.0 * room), Row::default()];
    let longer = edited(&lens, ElementEdit::Insert { at, rows });
    assert!(vertices(&longer).last() > vertices(&lens).last());
    let in_glass = lens.surfaces.iter().position(|row| row.medium != Medium::Air).unwrap() + 1;
    let refused = refusal(&lens, ElementEdit::Insert { at: in_glass, rows: vec![glass(1.0)] });
    assert!(refused.contains("is not air"));
}

#[test]
fn an_inserted_element_divides_the_air_of_each_zoom_position() {
    let mut lens = doublet();
    let at = lens.surfaces.len();
    lens.image_solve = None;
    let gap = |thickness| ZoomPosition {
        numbers: vec![ZoomNumber::thickness(0, thickness)],
        ..ZoomPosition::default()
    };
    lens.zoom = vec![gap(4.0), gap(8.0)];
    let glass = Medium::Glass("SCHOTT N-BK7".into());
    let rows = vec![Row { thickness: 1.0, medium: glass, ..Row::default() }, Row::default()];
    let more = edited(&lens, ElementEdit::Insert { at: 1, rows: rows.clone() });
    for (zoom, gap) in [(0, 1.5), (1, 3.5)] {
        assert_eq!(more.thickness_at(0, zoom), Some(gap));
        assert_eq!(more.thickness_at(2, zoom), Some(gap));
    }
    let less = edited(&more, ElementEdit::Remove(1));
    for (zoom, gap) in [(0, 4.0), (1, 8.0)] {
        assert!(close(less.thickness_at(0, zoom).unwrap(), gap));
    }
    assert_eq!(edited(&lens, ElementEdit::Insert { at, rows }).surfaces.len(), at + 2);
}

#[test]
fn a_removed_element_leaves_air_of_its_length() {
    let lens = files::parse(files::bundled_lenses()[0].text.as_bytes(), "x").unwrap().lens;
    let less = edited(&lens, ElementEdit::Remove(0));
    assert!(less.surfaces.len() < lens.surfaces.len());
    let last = lens.surfaces.len() - 1;
    let less = edited(&lens, ElementEdit::Remove(last));
    assert!(close(*vertices(&less).last().unwrap(), *vertices(&lens).last().unwrap()));
    let stop = lens.stop().unwrap();
    assert!(refusal(&lens, ElementEdit::Remove(stop)).contains("no element"));
}

#[test]
fn a_moved_element_moves_alone_and_not_through_its_neighbour() {
    let lens = files::parse(files::bundled_lenses()[0].text.as_bytes(), "x").unwrap().lens;
    let (first, last) = (0..lens.surfaces.len())
        .filter_map(|row| lens.element_around(row))
        .find(|(first, _)| *first > 0)
        .unwrap();
    let room = lens.surfaces[last].thickness;
    let moved = edited(&lens, ElementEdit::Move { surface: first, by: 0.5 * room });
    let (before, after) = (vertices(&lens), vertices(&moved));
    for row in 0..before.len() {
        // The vertex of surface `row + 1` is at the end of gap `row`.
        let belongs = (first..=last).contains(&(row + 1));
        let wanted = if belongs { 0.5 * room } else { 0.0 };
        assert!(close(after[row] - before[row], wanted), "surface {}", row + 2);
    }
    let refused = refusal(&lens, ElementEdit::Move { surface: first, by: 1.1 * room });
    assert!(refused.contains("of air after surface"));
    // The room and what the motion takes are lengths.
    assert!(!refused.contains('-'), "{refused}");
}

/// The image plane of a solve stays at the focus, so nothing has to make room for the last element.
#[test]
fn the_last_element_moves_against_a_solved_image() {
    let mut lens = doublet();
    lens.image_solve = Some(0.0);
    let last = lens.surfaces.len() - 1;
    let before = first(&lens);
    let moved = edited(&lens, ElementEdit::Move { surface: last, by: 2.0 });
    assert!(close(moved.surfaces[0].thickness, lens.surfaces[0].thickness + 2.0));
    assert_eq!(moved.surfaces[last].thickness, lens.surfaces[last].thickness);
    let after = first(&moved);
    assert!(close(after.bfl.unwrap(), before.bfl.unwrap()));
    assert!(after.image_defocus.unwrap().abs() < 1e-9);
}

#[test]
fn a_stop_on_either_side_of_the_air_stays_where_elements_are_cemented() {
    let apart = edited(&doublet(), ElementEdit::Split(2));
    for at in [2, 3] {
        let mut lens = apart.clone();
        lens.surfaces.iter_mut().enumerate().for_each(|(i, row)| row.stop = i == at);
        let joined = edited(&lens, ElementEdit::Cement(1));
        assert_eq!(joined.stop(), Some(2), "{at}");
    }
}

/// For distant light the stronger side of a singlet of least aberration is in front: `q` has the
/// sign of `−p` (Welford 1986, section 12.3). Turned round it has more spherical aberration.
#[test]
fn a_singlet_for_distant_light_turns_its_stronger_side_to_it() {
    let lens = singlet();
    let [front, back] = [1, 2].map(|i| lens.surfaces[i].curvature);
    assert!(front > 0.0 && front.abs() > back.abs(), "{front} {back}");
    let aberration = |lens: &Lens| {
        let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
        seidel(&system, &first(lens), None).unwrap().total.s1.abs()
    };
    let mut turned = lens.clone();
    (turned.surfaces[1].curvature, turned.surfaces[2].curvature) = (-back, -front);
    assert!(aberration(&turned) > 2.0 * aberration(&lens));
}

/// Heights on the image become the angles of `h = f tan θ`, across both axes.
#[test]
fn image_heights_of_an_empty_lens_become_angles_in_both_directions() {
    let mut fields = Fields::equal_area(FieldKind::ImageHeight, 12.0, 2);
    fields.values[0].x = 7.0;
    let lens =
        StartingLens { fields: fields.clone(), ..starting(StartingForm::Empty) }.lens().unwrap();
    assert_eq!(lens.fields.kind, FieldKind::Angle);
    for (angle, height) in lens.fields.values.iter().zip(&fields.values) {
        for (angle, height) in [(angle.x, height.x), (angle.y, height.y)] {
            assert!(close(35.0 * angle.to_radians().tan(), height), "{angle} {height}");
        }
    }
}

#[test]
fn bending_keeps_the_focal_length() {
    for lens in [singlet(), doublet()] {
        let bent = edited(&lens, ElementEdit::Bend { surface: 2, by: 0.01 });
        assert!(close(bent.surfaces[1].curvature, lens.surfaces[1].curvature + 0.01));
        assert!(close(first(&bent).efl.unwrap(), first(&lens).efl.unwrap()));
    }
}

#[test]
fn splitting_a_singlet_keeps_the_focal_length_and_cementing_undoes_a_separation() {
    let lens = singlet();
    let two = edited(&lens, ElementEdit::Split(1));
    assert_eq!(two.surfaces.len(), lens.surfaces.len() + 2);
    assert_eq!([two.element_around(1), two.element_around(4)], [Some((1, 2)), Some((3, 4))]);
    assert!(close(first(&two).efl.unwrap(), first(&lens).efl.unwrap()));

    let group = doublet();
    let apart = edited(&group, ElementEdit::Split(2));
    assert_eq!(apart.element_around(1), Some((1, 2)));
    assert!(apart.surfaces[2].thickness > 0.0);
    let again = edited(&apart, ElementEdit::Cement(1));
    assert_eq!(again.surfaces.len(), group.surfaces.len());
    for (a, b) in again.surfaces.iter().zip(&group.surfaces) {
        assert_eq!((a.curvature, &a.medium), (b.curvature, &b.medium));
    }
    let refused = refusal(&group, ElementEdit::Split(1));
    assert!(refused.contains("outside of a cemented group"), "{refused}");
    let refused = refusal(&group, ElementEdit::Cement(1));
    assert!(refused.contains("expected one behind it"), "{refused}");
}

#[test]
fn a_session_scales_to_a_focal_length_and_inserts_a_file_each_as_one_undo_step() {
    let mut session = Session::new(doublet(), || {}).unwrap();
    session.apply(Command::ScaleToFocalLength(70.0));
    assert!(close(first(session.lens()).efl.unwrap(), 70.0));
    assert_eq!(session.view().undo.as_deref(), Some("scale to the focal length 70 mm"));
    session.apply(Command::Undo);
    assert_eq!(**session.lens(), doublet());
    session.apply(Command::ScaleToFocalLength(-1.0));
    let message = session.view().messages.last().unwrap().text.clone();
    assert!(message.contains("expected more than 0"), "{message}");

    let folder = std::env::temp_dir().join(format!("aplanat-insert-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("singlet.json");
    files::save(&singlet(), &path).unwrap();
    let at = session.lens().surfaces.len();
    session.apply(Command::InsertLens { path, at });
    assert_eq!(session.lens().surfaces.len(), at + 3);
    assert_eq!(session.view().undo.as_deref(), Some("insert singlet.json"));
    assert_eq!(session.lens().stop(), Some(0), "the stop of the file is not a second stop");
    session.apply(Command::Undo);
    assert_eq!(**session.lens(), doublet());
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn every_edit_of_an_element_survives_a_file() {
    let rows = vec![Row::default()];
    let edits = [
        ElementEdit::Insert { at: 1, rows },
        ElementEdit::Remove(1),
        ElementEdit::Move { surface: 1, by: 0.5 },
        ElementEdit::Bend { surface: 1, by: -0.01 },
        ElementEdit::Cement(1),
        ElementEdit::Split(2),
    ];
    for edit in edits {
        let edit = Edit::Element(edit);
        let text = serde_json::to_string(&Command::Edit(edit.clone())).unwrap();
        assert_eq!(serde_json::from_str::<Command>(&text).unwrap(), Command::Edit(edit));
    }
}
