//! The shape and the place of a surface beside the table of the prescription.

use aplanat::lens::{
    ApertureShape, AxisBreak, BlockedSide, Edit, Freeform, FreeformKind, IdealElement, Lens,
    Parameter, Quantity, SurfaceAperture, apply_edit,
};
use aplanat::session::Command;
use aplanat::studio::panels::PrescriptionPanel;
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{PanelState, double_gauss, painted_texts, panel_harness, view_of};

type Bench = Harness<'static, PanelState<PrescriptionPanel>>;

/// The table of a lens with the first surface selected and its details open.
fn details(lens: Lens) -> Bench {
    let mut view = view_of(lens);
    view.selected = Some(0);
    let mut harness = panel_harness(PrescriptionPanel::default(), view);
    harness.run();
    press(&mut harness, "Shape, apertures, tilt");
    harness
}

fn press(harness: &mut Bench, label: &str) {
    harness.get_by_label(label).click();
    harness.run();
}

fn choose(harness: &mut Bench, list: &str, entry: &str) {
    press(harness, list);
    press(harness, entry);
}

fn enter(harness: &mut Bench, field: &str, text: &str) {
    harness.get_by_label(field).focus();
    harness.run();
    harness.get_by_label(field).type_text(text);
    harness.run();
    harness.key_press(Key::Enter);
    harness.run();
}

/// The same for a text of several lines, which ends with the focus.
fn replace_lines(harness: &mut Bench, field: &str, text: &str) {
    harness.get_by_label(field).focus();
    harness.run();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.get_by_label(field).type_text(text);
    harness.run();
    harness.key_press(Key::Tab);
    harness.run();
}

/// The lens after the edits that were asked for, each with the end of its undo step behind it; the panel
/// shows it from now on.
fn edited(harness: &mut Bench) -> Lens {
    let commands = std::mem::take(&mut harness.state_mut().commands);
    let mut lens = Lens::clone(&harness.state().view.lens);
    for pair in
        commands.iter().filter(|c| !matches!(c, Command::Select(_))).collect::<Vec<_>>().chunks(2)
    {
        let [Command::Edit(edit), Command::CommitEdit] = pair else { panic!("found {pair:?}") };
        lens = apply_edit(&lens, edit).unwrap();
    }
    let selected = harness.state().view.selected;
    harness.state_mut().view = view_of(lens.clone());
    harness.state_mut().view.selected = selected;
    harness.run();
    lens
}

fn says(harness: &Bench, text: &str) -> bool {
    painted_texts(harness).iter().any(|painted| painted.contains(text))
}

#[test]
fn a_surface_becomes_biconic_and_its_other_radius_is_typed() {
    let plain = double_gauss();
    let mut harness = details(plain.clone());
    choose(&mut harness, "Form of surface 1", "Biconic");
    let row = &edited(&mut harness).surfaces[0];
    let numbers = vec![plain.surfaces[0].curvature, 0.0];
    assert_eq!(row.freeform, Some(Freeform { kind: FreeformKind::Biconic, numbers }));
    enter(&mut harness, "Radius x of surface 1", "40");
    let form = edited(&mut harness).surfaces[0].freeform.clone().unwrap();
    assert_eq!(form.numbers[0], 1.0 / 40.0);
    enter(&mut harness, "Radius x of surface 1", "0");
    let form = edited(&mut harness).surfaces[0].freeform.clone().unwrap();
    assert_eq!(form.numbers[0], 0.0, "a plane, as in the table");
    press(&mut harness, "Freeform number 1 of surface 1 variable");
    let added = harness.state().commands.iter().any(|command| {
        let parameter = Parameter::new(0, Quantity::Freeform(0));
        matches!(command, Command::Edit(Edit::AddVariable(v)) if v.parameter == parameter)
    });
    assert!(added, "{:?}", harness.state().commands);
    harness.state_mut().commands.clear();
    choose(&mut harness, "Form of surface 1", "Conic, even asphere");
    assert_eq!(edited(&mut harness), plain);
}

#[test]
fn terms_of_a_polynomial_are_added_removed_and_typed_and_a_bad_length_is_refused() {
    let mut harness = details(double_gauss());
    choose(&mut harness, "Form of surface 1", "XY polynomial");
    let count = edited(&mut harness).surfaces[0].freeform.as_ref().unwrap().numbers.len();
    press(&mut harness, "Add a term");
    edited(&mut harness);
    enter(&mut harness, "Normalisation R of surface 1", "20");
    let form = edited(&mut harness).surfaces[0].freeform.clone().unwrap();
    assert_eq!(
        (form.kind, form.numbers.len()),
        (FreeformKind::XyPolynomial { radius: 20.0 }, count + 1)
    );
    enter(&mut harness, "x³ of surface 1", "0.002");
    let form = edited(&mut harness).surfaces[0].freeform.clone().unwrap();
    assert_eq!(form.numbers[count], 0.002);
    press(&mut harness, "Remove the last");
    let form = edited(&mut harness).surfaces[0].freeform.clone().unwrap();
    assert_eq!(form.numbers.len(), count);
    enter(&mut harness, "Normalisation R of surface 1", "-3");
    assert!(says(&harness, "is normalised to -3 mm; expected more than 0"));
    assert_eq!(harness.state().commands, []);
}

#[test]
fn a_rule_of_deflection_is_chosen_and_one_that_does_not_fit_is_refused_in_words() {
    let stop = double_gauss().stop().unwrap();
    let mut harness = details(double_gauss());
    choose(&mut harness, "Deflection at surface 1", "Paraxial lens");
    assert!(says(&harness, "a paraxial lens is a plane that light goes through"));
    assert_eq!(harness.state().commands, []);
    harness.state_mut().view.selected = Some(stop);
    harness.run();
    let name = stop + 1;
    choose(&mut harness, &format!("Deflection at surface {name}"), "Paraxial lens");
    edited(&mut harness);
    enter(&mut harness, &format!("Focal length of surface {name}"), "250");
    let rule = edited(&mut harness).surfaces[stop].ideal;
    assert_eq!(rule, Some(IdealElement::Lens { focal_length: 250.0 }));
    choose(&mut harness, &format!("Deflection at surface {name}"), "Grating");
    edited(&mut harness);
    enter(&mut harness, &format!("Grooves of surface {name}"), "60");
    let rule = edited(&mut harness).surfaces[stop].ideal;
    assert_eq!(rule, Some(IdealElement::Grating { lines_per_mm: 60.0, order: 1.0 }));
}

#[test]
fn a_surface_and_its_element_are_decentred_and_tilted() {
    let mut harness = details(double_gauss());
    enter(&mut harness, "Surface 1: tilt about x", "5");
    let lens = edited(&mut harness);
    assert_eq!((lens.surfaces[0].decenter, lens.surfaces[0].tilt), ([0.0; 2], [5.0, 0.0]));
    enter(&mut harness, "Surface 1: tilt about x", "95");
    assert!(says(&harness, "less than 90 degrees"));
    harness.key_press(Key::Escape);
    let mut harness = details(double_gauss());
    enter(&mut harness, "Element 1–2: decentre y", "0.5");
    let lens = edited(&mut harness);
    let place = AxisBreak { decenter: [0.0, 0.5, 0.0], tilt: [0.0; 3] };
    assert_eq!(lens.group_place((0, 1)), Some(place));
    // A pure displacement is taken back by the opposite one.
    let back = AxisBreak { decenter: [0.0, -0.5, 0.0], tilt: [0.0; 3] };
    assert_eq!(lens.surfaces[1].break_after, Some(back));
    enter(&mut harness, "Axis behind 1: tilt about z", "30");
    let lens = edited(&mut harness);
    assert_eq!(lens.surfaces[0].break_after.unwrap().tilt, [0.0, 0.0, 30.0]);
    assert!(says(&harness, "has breaks"));
}

#[test]
fn an_aperture_is_added_formed_placed_and_removed() {
    let plain = double_gauss();
    let mut harness = details(plain.clone());
    press(&mut harness, "Add an aperture");
    edited(&mut harness);
    enter(&mut harness, "Half width of aperture 1 of surface 1", "9");
    edited(&mut harness);
    enter(&mut harness, "Centre y of aperture 1 of surface 1", "-2");
    edited(&mut harness);
    enter(&mut harness, "Turned, ° of aperture 1 of surface 1", "30");
    edited(&mut harness);
    choose(&mut harness, "Light at aperture 1 of surface 1", "Obscures");
    edited(&mut harness);
    choose(&mut harness, "Form of aperture 1 of surface 1", "Ellipse");
    let own = edited(&mut harness).surfaces[0].apertures[0].clone();
    let [half_width, half_height, place @ ..] = own.numbers();
    assert_eq!((own.blocks, half_width, place), (BlockedSide::Inside, 9.0, [0.0, -2.0, 30.0]));
    assert!(matches!(own.shape, ApertureShape::Ellipse { .. }) && half_height > 1.0);
    choose(&mut harness, "Form of aperture 1 of surface 1", "Polygon");
    edited(&mut harness);
    replace_lines(&mut harness, "Corners of aperture 1 of surface 1", "(0, 0) (3, 0) (0, 2)");
    let points = vec![[0.0, 0.0], [3.0, 0.0], [0.0, 2.0]];
    let shape = edited(&mut harness).surfaces[0].apertures[0].shape.clone();
    assert_eq!(shape, ApertureShape::Polygon { points });
    press(&mut harness, "Remove aperture 1 of surface 1");
    assert_eq!(edited(&mut harness), plain);
}

#[test]
fn an_aperture_that_cannot_be_is_refused_in_words() {
    let mut harness = details(double_gauss());
    press(&mut harness, "Add an aperture");
    edited(&mut harness);
    enter(&mut harness, "Half width of aperture 1 of surface 1", "-1");
    assert!(says(&harness, "has the half width -1"), "{:?}", painted_texts(&harness));
    assert_eq!(harness.state().commands, []);
    choose(&mut harness, "Form of aperture 1 of surface 1", "Spider");
    let after = edited(&mut harness);
    assert!(!says(&harness, "half width"), "{:?}", painted_texts(&harness));
    let spider = after.surfaces[0].apertures[0].clone();
    assert!(spider.obscures() && matches!(spider.shape, ApertureShape::Spider { arms: 3, .. }));
    enter(&mut harness, "Number of arms of aperture 1 of surface 1", "0");
    assert!(says(&harness, "has 0 arms; expected 1 to 32"));
}

#[test]
fn the_column_of_apertures_shows_and_takes_words() {
    let mut lens = double_gauss();
    let shape = ApertureShape::Rectangle { half_width: 9.5, half_height: 7.0 };
    lens.surfaces[0].apertures = vec![SurfaceAperture::inside(shape.clone())];
    let mut harness = panel_harness(PrescriptionPanel::default(), view_of(lens));
    harness.run();
    assert!(says(&harness, "rectangle ±9.5 x ±7"));
    enter(&mut harness, "Apertures of surface 1", "rectangle 9.5 7; obscuring circle 2 at 1, 0");
    let own = edited(&mut harness).surfaces[0].apertures.clone();
    let beside = SurfaceAperture {
        center: [1.0, 0.0],
        ..SurfaceAperture::obscuration(ApertureShape::Circle { radius: 2.0 })
    };
    assert_eq!(own, [SurfaceAperture::inside(shape), beside]);
    enter(&mut harness, "Apertures of surface 1", "square 3");
    assert!(says(&harness, "found `square`"));
    let edits = harness.state().commands.iter().filter(|c| !matches!(c, Command::Select(_)));
    assert_eq!(edits.count(), 0);
}
