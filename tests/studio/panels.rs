//! Panels, driven by their accessibility labels: they show a view and push commands.

use std::sync::Arc;

use aplanat::effects::{Effect, EffectOverride};
use aplanat::lens::{Aperture, Edit, Lens, Medium, Object, Parameter, Quantity, Row, Variable};
use aplanat::merit::{Goal, OperandKind, PupilEdge, Term, WeightedTerm};
use aplanat::optimize::{DescentMethod, OptimizationEnd, OptimizationProgress, pareto};
use aplanat::session::{
    Analyses, Command, HandleSlopes, MeritReport, MeritSlopes, MeritValues, OptimizationRequest,
    OptimizationSnapshot, PanelSetting, ParetoPass, ParetoRun, ParetoView, RunId, RunKind,
    RunStatus, RunView, Session, SessionView,
};
use aplanat::studio::draw::RenderBackend;
use aplanat::studio::file_dialog::FileRequest;
use aplanat::studio::number;
use aplanat::studio::panels::{
    EffectsPanel, FieldCurvesPanel, FirstOrderPanel, FootprintPanel, GhostsPanel, LayoutPanel,
    OptimizerPanel, Panel, ParetoPanel, PrescriptionPanel, PupilPanel, SeidelPanel, SpotMapPanel,
    SpotPanel, WavefrontPanel,
};
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{
    PanelState, UPPER, double_gauss, painted_galleys, painted_texts, panel_harness, sized_harness,
    small_harness, view, view_of,
};

fn prescription() -> Harness<'static, PanelState<PrescriptionPanel>> {
    let mut harness = panel_harness(PrescriptionPanel::default(), view());
    harness.run();
    harness
}

/// Types into a field as a person does: enter it, type over what is there, end with a key.
fn type_into<P: Panel>(
    harness: &mut Harness<'_, PanelState<P>>,
    field: &str,
    text: &str,
    end: Key,
) {
    harness.get_by_label(field).focus();
    harness.run();
    harness.get_by_label(field).type_text(text);
    harness.run();
    harness.key_press(end);
    harness.run();
}

fn edits(commands: &[Command]) -> Vec<&Edit> {
    commands
        .iter()
        .filter_map(|command| if let Command::Edit(edit) = command { Some(edit) } else { None })
        .collect()
}

#[test]
fn a_typed_radius_is_committed_by_enter() {
    let mut harness = prescription();
    type_into(&mut harness, "Radius of surface 1", "15*1.1", Key::Enter);
    let wanted = Edit::set_radius(0, 15.0 * 1.1);
    let [first, second] = [0, 1].map(|surface| Command::Select(Some(surface)));
    let entered = [first, Command::Edit(wanted), Command::CommitEdit, second];
    assert_eq!(harness.state().commands, entered, "the surface of the cell is the selected one");
    assert!(harness.get_by_label("Radius of surface 2").is_focused(), "Enter goes down");
}

#[test]
fn a_typed_thickness_is_committed_by_tab() {
    let mut harness = prescription();
    type_into(&mut harness, "Thickness of surface 2", "*2", Key::Tab);
    let parameter = Parameter::new(1, Quantity::Thickness);
    let gap = harness.state().view.lens.surfaces[1].thickness;
    let wanted = Edit::Set { parameter, value: 2.0 * gap };
    assert_eq!(edits(&harness.state().commands), [&wanted]);
    assert!(harness.get_by_label("Glass of surface 2").is_focused(), "Tab goes to the right");
}

#[test]
fn an_invalid_number_stays_in_its_cell_with_the_reason() {
    let mut harness = prescription();
    type_into(&mut harness, "Radius of surface 3", "abc", Key::Enter);
    assert_eq!(harness.state().commands, [Command::Select(Some(2))]);
    let cell = harness.get_by_label("Radius of surface 3");
    assert_eq!(cell.value().as_deref(), Some("abc"), "nothing is lost");
    assert!(harness.query_by_label_contains("is no number; expected").is_some());
}

#[test]
fn an_unknown_glass_is_refused_with_its_surface() {
    let mut harness = prescription();
    type_into(&mut harness, "Glass of surface 3", "SCHOTT BK7", Key::Enter);
    assert_eq!(harness.state().commands, [Command::Select(Some(2))]);
    harness.get_by_label_contains("Unknown glass `SCHOTT BK7` after surface 3; similar names");
}

/// A number that its variable does not allow is refused with the bounds that it breaks.
#[test]
fn a_number_beyond_its_bounds_is_refused_with_them() {
    let mut harness = prescription();
    type_into(&mut harness, "Thickness of surface 1", "0.5", Key::Enter);
    harness
        .get_by_label_contains("Thickness after surface 1 is 0.5; expected 0.8 to 8, its bounds");
    let mut harness = prescription();
    type_into(&mut harness, "Radius of surface 1", "4", Key::Enter);
    let text = "is 0.25, a radius of 4 mm; expected -0.151 to 0.151, its bounds";
    harness.get_by_label_contains(text);
}

/// In a wide panel the numbers stay beside their names.
#[test]
fn the_numbers_of_first_order_stay_near_their_names() {
    let mut harness = sized_harness(FirstOrderPanel, view(), [1280.0, 700.0]);
    harness.run();
    let name = harness.get_by_label("Focal length").rect();
    let value = harness.get_by_label("49.389 mm").rect();
    assert!(value.left() - name.right() < 300.0, "{name:?} {value:?}");
}

#[test]
fn escape_discards_a_typed_value() {
    let mut harness = prescription();
    type_into(&mut harness, "Radius of surface 1", "99", Key::Escape);
    assert_eq!(harness.state().commands, [Command::Select(Some(0))]);
    let value = harness.get_by_label("Radius of surface 1").value();
    assert_eq!(value.as_deref(), Some("14.1615"));
}

#[test]
fn a_glass_may_be_a_name_a_model_or_nothing() {
    let media = [
        ("n-sf6", Medium::Glass("SCHOTT N-SF6".into())),
        ("1.62 36.4", Medium::Model { nd: 1.62, vd: 36.4 }),
        ("1.5", Medium::Index(1.5)),
    ];
    for (text, medium) in media {
        let mut harness = prescription();
        type_into(&mut harness, "Glass of surface 1", text, Key::Enter);
        assert_eq!(edits(&harness.state().commands), [&Edit::SetMedium { surface: 0, medium }]);
    }
}

#[test]
fn the_object_can_come_near() {
    let mut harness = prescription();
    type_into(&mut harness, "Object distance", "1000", Key::Enter);
    let wanted = Edit::SetObject(Object::Finite(1000.0));
    assert_eq!(edits(&harness.state().commands), [&wanted]);
}

#[test]
fn a_badge_toggles_a_variable() {
    let mut harness = prescription();
    harness.get_by_label("Radius of surface 1 variable").click();
    harness.run();
    harness.get_by_label("Conic of surface 2 variable").click();
    harness.run();
    let free = Parameter::new(0, Quantity::Curvature);
    let parameter = Parameter::new(1, Quantity::Conic);
    let wanted = [
        Edit::RemoveVariable(free),
        Edit::AddVariable(Variable { parameter, min: None, max: None }),
    ];
    assert_eq!(edits(&harness.state().commands), wanted.iter().collect::<Vec<_>>());
}

#[test]
fn a_key_toggles_the_variable_under_the_cursor() {
    let mut harness = prescription();
    harness.get_by_label("Conic of surface 1").focus();
    harness.run();
    harness.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::V);
    harness.run();
    let parameter = Parameter::new(0, Quantity::Conic);
    let wanted = Edit::AddVariable(Variable { parameter, min: None, max: None });
    assert_eq!(edits(&harness.state().commands), [&wanted]);
}

#[test]
fn a_selected_row_can_be_deleted_and_flipped() {
    let mut harness = prescription();
    harness.get_by_label("Row of surface 3").click();
    harness.run();
    harness.key_press(Key::Delete);
    harness.run();
    harness.get_by_label("Reverse element").click();
    harness.run();
    let wanted = [Edit::RemoveRow(2), Edit::ReverseRows { first: 2, last: 4 }];
    assert_eq!(edits(&harness.state().commands), wanted.iter().collect::<Vec<_>>());
}

#[test]
fn a_row_has_a_menu_of_its_own() {
    let mut harness = prescription();
    harness.get_by_label("Row of surface 2").click_secondary();
    harness.run();
    harness.get_all_by_label("Make stop").last().unwrap().click();
    harness.run();
    assert_eq!(edits(&harness.state().commands), [&Edit::SetStop(1)]);
}

/// A run with a state.
fn run_view<S>(kind: RunKind, number: u64, status: RunStatus, state: S) -> RunView<S> {
    let snapshot = Some(Arc::new(state));
    RunView { id: Some(RunId { kind, number }), status, error: None, snapshot }
}

/// A search that stands somehow.
fn searching(standing: RunStatus) -> SessionView {
    let view = view();
    let goal = Goal::default_for(&view.lens).unwrap();
    let method = DescentMethod::Adam;
    let task = OptimizationRequest {
        method,
        lens: Arc::clone(&view.lens),
        goal,
        tolerance: 1e-3,
        glasses: None,
    };
    let refused = Some("ray 4 is lost: clipped at surface 3".to_owned());
    let progress = OptimizationProgress {
        step: 7,
        evaluations: 7,
        merit: 0.5,
        best: 0.25,
        accepted: 1.0,
        refused,
        finished: standing == RunStatus::Finished,
        end: (standing == RunStatus::Finished).then_some(OptimizationEnd::Tolerance),
    };
    let search = OptimizationSnapshot {
        request: Arc::new(task),
        progress: Some(progress),
        best: Arc::clone(&view.lens),
        current: Arc::clone(&view.lens),
        initial_terms: Vec::new(),
        best_terms: Vec::new(),
        limits: Vec::new(),
        history: Vec::new(),
        curve: Arc::default(),
    };
    let optimization = run_view(RunKind::Optimization, 1, standing, search);
    SessionView { optimization, ..view }
}

fn optimizer(view: SessionView) -> Harness<'static, PanelState<OptimizerPanel>> {
    let mut harness = panel_harness(OptimizerPanel::default(), view);
    harness.run();
    harness
}

/// A bound of a twentieth of a millimetre, or of a picometre, is read to its last digit.
#[test]
fn the_numbers_of_the_merit_function_fit_into_their_fields() {
    let mut view = view();
    let mut goal = Goal::default_for(&view.lens).unwrap();
    let sag = Term::Operand { kind: OperandKind::Sag, min: Some(-1.234e-10), max: Some(2e-3) };
    goal.terms = vec![
        WeightedTerm::new(Term::AirEdge(0.049_388), 0.975_66),
        WeightedTerm::new(Term::GlassEdge(1.234e-9), 1.234e-5),
        WeightedTerm::new(sag, 1.0),
    ];
    view.goal = Some(Arc::new(goal));
    let harness = optimizer(view);
    for (name, text) in [
        ("Minimum of Air edge", "0.0494"),
        ("Weight of Air edge", "0.9757"),
        ("Minimum of Glass edge", "1.23e-9"),
        ("Weight of Glass edge", "1.23e-5"),
        ("Minimum of Sag", "-1.23e-10"),
        ("Maximum of Sag", "0.002"),
    ] {
        let cell = harness.get_by_label(name).rect();
        let galleys = painted_galleys(&harness);
        let number = galleys.iter().find(|galley| galley.text() == text).unwrap();
        // The frame of a field has a line and a margin of four points on each side.
        assert!(number.size().x + 10.0 <= cell.width(), "{text} in {cell:?}");
    }
}

#[test]
fn optimize_requests_a_run_with_the_terms_of_the_panel() {
    let mut harness = optimizer(view());
    type_into(&mut harness, "Weight of Spot", "3", Key::Enter);
    harness.get_by_label("Focal length").click();
    harness.run();
    harness.get_by_label("Optimize").click();
    harness.run();
    let commands = harness.state().commands.as_slice();
    let [Command::Edit(first), Command::Edit(second), Command::Optimize { method, goal, .. }] =
        commands
    else {
        panic!("{commands:?}");
    };
    assert!(matches!(first, Edit::SetMerit(Some(written)) if written.terms[0].weight == 3.0));
    assert_eq!(*second, Edit::SetMerit(Some(goal.clone())), "the design has what is optimized");
    assert_eq!(*method, DescentMethod::TrustRegion);
    assert_eq!(goal.terms[0].weight, 3.0);
    assert!(goal.terms.iter().all(|weighted| weighted.term.name() != "focal_length"));
}

/// Presses something by its name.
fn press<P: Panel>(harness: &mut Harness<'_, PanelState<P>>, name: &str) {
    harness.get_by_label(name).click();
    harness.run();
}

fn goal_of(commands: &[Command]) -> &Goal {
    let mut goals = commands.iter().filter_map(|command| match command {
        Command::Optimize { goal, .. } => Some(goal),
        _ => None,
    });
    goals.next().unwrap()
}

#[test]
fn a_light_term_is_added_in_a_few_clicks() {
    let mut lens = double_gauss();
    lens.aperture = Aperture::EntrancePupilDiameter(10.9);
    let mut harness = optimizer(view_of(lens.clone()));
    assert!(harness.query_by_label("Limit the beam by the stop").is_none(), "nobody asks for more");
    type_into(&mut harness, "Minimum of Light", "1.2", Key::Enter);
    press(&mut harness, "Limit the beam by the stop");
    press(&mut harness, "Vary the semi-diameters");
    press(&mut harness, "Optimize");
    let commands = &harness.state().commands;
    assert!(commands.contains(&Command::LimitByStop));
    let [Edit::SetMerit(_), Edit::SetVariables(freed)] = edits(commands)[..] else {
        panic!("{commands:?}")
    };
    let rims = freed.iter().filter(|v| v.parameter.quantity == Quantity::SemiDiameter).count();
    assert_eq!(rims, double_gauss().surfaces.len());
    let goal = goal_of(commands);
    assert_eq!(goal.pupil, PupilEdge::Moving);
    assert!(goal.terms.iter().any(|weighted| weighted.term == Term::Light(1.2)));

    let mut lens = aplanat::pupil::limited_by_stop(&lens).unwrap();
    lens.variables.clone_from(freed);
    let mut ready = optimizer(view_of(lens));
    type_into(&mut ready, "Minimum of Light", "1.2", Key::Enter);
    assert!(ready.query_by_label_contains("Limit the beam").is_none());
    assert!(ready.query_by_label_contains("Vary the semi").is_none());
}

#[test]
fn a_new_term_starts_at_the_value_of_the_lens() {
    let mut harness = optimizer(view());
    for term in ["F-number", "Relative illumination", "Throughput"] {
        press(&mut harness, "Add a term");
        press(&mut harness, term);
    }
    press(&mut harness, "Optimize");
    let goal = goal_of(&harness.state().commands);
    let lens = &harness.state().view.lens;
    goal.check(lens).unwrap();
    let terms: Vec<Term> = goal.terms.iter().map(|weighted| weighted.term).collect();
    // 94.61 mm² on the axis and 49.389 mm of focal length.
    let number = 49.389 / (2.0 * (94.61 / std::f64::consts::PI).sqrt());
    assert!(terms.iter().any(|t| matches!(t, Term::FNumber(n) if (n - number).abs() < 2e-3)));
    assert!(terms.contains(&Term::RelativeIllumination { field: 2, min: 0.5 }));
    assert!(terms.contains(&Term::Throughput));
}

#[test]
fn fixed_rays_are_described_as_ignoring_light() {
    let mut harness = optimizer(view());
    assert!(harness.query_by_label_contains("Fixed rays carry no information").is_none());
    press(&mut harness, "Fixed rays");
    harness.get_by_label_contains("Fixed rays carry no information about light");
    press(&mut harness, "Optimize");
    assert_eq!(goal_of(&harness.state().commands).pupil, PupilEdge::Frozen);
}

#[test]
fn a_semi_diameter_is_freed_by_its_badge() {
    let mut harness = prescription();
    press(&mut harness, "Semi-diameter of surface 1 variable");
    let parameter = Parameter::new(0, Quantity::SemiDiameter);
    let wanted = Edit::AddVariable(Variable { parameter, min: None, max: None });
    assert_eq!(edits(&harness.state().commands), [&wanted]);
}

#[test]
fn an_optimization_can_be_paused_stepped_stopped_and_accepted() {
    let cases = [
        (RunStatus::Running, "Pause", Command::Pause),
        (RunStatus::Running, "Stop", Command::Stop),
        (RunStatus::Paused, "Resume", Command::Resume),
        (RunStatus::Paused, "Step", Command::Step),
        (RunStatus::Stopped, "Accept", Command::AcceptResult),
        (RunStatus::Finished, "Discard", Command::DiscardResult),
    ];
    for (standing, button, command) in cases {
        let mut harness = optimizer(searching(standing));
        harness.get_by_label(button).click();
        harness.run();
        assert_eq!(harness.state().commands, [command], "{button}");
    }
}

#[test]
fn a_refused_step_names_parameter_and_ray_counted_as_in_the_table() {
    let harness = optimizer(searching(RunStatus::Running));
    harness.get_by_label("Ray 4 is lost: clipped at surface 3");
    harness.get_by_label("after step 7");
}

/// The reason stands on a line of its own, so that it does not widen the panel.
#[test]
fn a_finished_optimization_says_why_it_ended() {
    let harness = optimizer(searching(RunStatus::Finished));
    let reason = "Ended: nothing can be gained at the tolerance of the spots.";
    let (reason, status) =
        (harness.get_by_label(reason).rect(), harness.get_by_label("after step 7").rect());
    assert!(reason.top() >= status.bottom(), "{reason:?} {status:?}");
}

#[test]
fn a_lens_without_variables_cannot_be_optimized() {
    let mut lens = double_gauss();
    lens.variables.clear();
    let mut harness = optimizer(view_of(lens));
    harness.get_by_label("Optimize").click();
    harness.run();
    assert_eq!(harness.state().commands, []);
}

#[test]
fn radii_and_thicknesses_are_varied_from_the_optimizer() {
    let mut lens = double_gauss();
    lens.variables.clear();
    let mut harness = optimizer(view_of(lens));
    press(&mut harness, "Vary all radii and thicknesses");
    let [Command::Edit(Edit::SetVariables(variables))] = &harness.state().commands[..] else {
        panic!("{:?}", harness.state().commands);
    };
    let count = |quantity| variables.iter().filter(|v| v.parameter.quantity == quantity).count();
    assert_eq!((count(Quantity::Curvature), count(Quantity::Thickness)), (10, 11));
}

/// The merit above the drawing is that of the other panels: the slopes have coarser rays.
#[test]
fn the_layout_has_the_merit_of_the_optimizer() {
    let mut view = view();
    let goal = Arc::new(Goal::default_for(&view.lens).unwrap());
    let values = MeritValues { total: 0.5, ..MeritValues::default() };
    let lens = Arc::clone(&view.lens);
    view.merit = Some(Arc::new(MeritReport { lens, goal, values: Ok(values), ms: 1.0 }));
    let slopes = MeritSlopes { merit: 0.4, before: 0.4, ..MeritSlopes::default() };
    let slopes = HandleSlopes { version: view.version, result: Ok(slopes), ms: 1.0 };
    view.drag.slopes = Some(Arc::new(slopes));
    let mut harness = panel_harness(LayoutPanel::new(RenderBackend::Software), view);
    harness.run();
    harness.get_by_label("merit 0.5");
}

/// In a narrow cell the radii stand in one line each; the tooltip has their errors.
#[test]
fn radii_of_spots_are_not_cut_in_a_narrow_panel() {
    let panel = SpotPanel::new(RenderBackend::Software);
    let mut harness = sized_harness(panel, view(), [346.0, 260.0]);
    harness.run();
    let painted = painted_galleys(&harness);
    let is_radius = |text: &str| text.starts_with("RMS ") || text.starts_with("GEO ");
    let radii: Vec<_> = painted.iter().filter(|galley| is_radius(galley.text())).collect();
    assert_eq!(radii.len(), 6);
    for galley in radii {
        assert!(galley.rows.len() == 1 && !galley.elided, "{}", galley.text());
    }
}

#[test]
fn spots_show_radii_with_errors_and_rays() {
    let mut harness = panel_harness(SpotPanel::new(RenderBackend::Software), view());
    harness.run();
    for text in ["RMS 50.59 µm ±", "RMS 93.31 µm ±", "RMS 101.3 µm ±", "GEO 152.1 µm ±"] {
        harness.get_by_label_contains(text);
    }
    assert_eq!(harness.get_all_by_label_contains(" rays").count(), 3);
}

#[test]
fn the_error_of_spots_can_be_chosen() {
    let mut harness = panel_harness(SpotPanel::new(RenderBackend::Software), view());
    harness.run();
    harness.get_by_label("Allowed error").click();
    harness.run();
    harness.get_by_label("1e-6").click();
    harness.run();
    assert_eq!(harness.state().commands, [Command::SetTolerance(1e-6)]);
}

fn pupils(lens: Lens) -> Harness<'static, PanelState<PupilPanel>> {
    let mut harness = panel_harness(PupilPanel::default(), view_of(lens));
    harness.run();
    harness
}

#[test]
fn pupils_show_limits_area_and_error() {
    let harness = pupils(double_gauss());
    harness.get_by_label("Pupil of field 1: stop, surface 6 100 %");
    harness.get_by_label(
        "Pupil of field 3: rim of surface 1 47 %, rim of surface 11 43 %, stop, surface 6 10 %",
    );
    for text in ["94.61 mm²", "100 % of axis", "64.82 % ± <0.001 % of axis"] {
        harness.get_by_label_contains(text);
    }
    let noise = harness.query_by_label_contains("100 % ±");
    assert!(noise.is_none(), "an error that is only rounding is none");
    harness.get_by_label("11 43 %");
    assert_eq!(harness.get_all_by_label_contains(" rays, ").count(), 3);
}

#[test]
fn clicking_a_pupil_limit_selects_and_deselects_its_surface() {
    let mut harness = pupils(double_gauss());
    for wanted in [Some(10), None] {
        harness.get_by_label("Rim of surface 11").click();
        harness.run();
        assert_eq!(harness.state().commands.last(), Some(&Command::Select(wanted)));
    }
}

#[test]
fn sensitivities_predict_the_effect_of_a_tenth_of_a_millimetre() {
    let mut harness = pupils(double_gauss());
    for surface in [1, 6, 11] {
        harness.get_by_label_contains(&format!("Rim of surface {surface} by 0.1 mm: light +"));
    }
    harness.get_by_label("inactive: 2 to 5, 7 to 10");
    assert!(harness.query_by_label_contains("Rim of surface 2 by").is_none());
    harness.get_by_label_contains("Rim of surface 11 by 0.1 mm").click();
    harness.run();
    assert_eq!(harness.state().commands.last(), Some(&Command::Select(Some(10))));
}

#[test]
fn a_click_on_a_pupil_edge_selects_its_surface() {
    let mut harness = pupils(double_gauss());
    // The rim of surface 1 is the lower edge of the third pupil: the first thing above its bottom.
    let picture = harness.get_by_label_contains("Pupil of field 3").rect();
    for i in 0..60 {
        let at = picture.center_bottom() - egui::vec2(0.0, 4.0 * i as f32);
        harness.hover_at(at);
        harness.run();
        harness.drag_at(at);
        harness.drop_at(at);
        harness.run();
        if !harness.state().commands.is_empty() {
            break;
        }
    }
    assert_eq!(harness.state().commands, [Command::Select(Some(0))]);
}

#[test]
fn the_wavelength_of_pupils_can_be_chosen() {
    let mut harness = pupils(double_gauss());
    harness.get_by_label("Wavelength of the pupils").click();
    harness.run();
    harness.get_by_label("486.1 nm").click();
    harness.run();
    assert_eq!(harness.state().commands, [Command::Show(PanelSetting::PupilWavelength(Some(0)))]);
}

#[test]
fn a_pupil_without_light_names_the_limits_and_a_remedy() {
    let mut lens = double_gauss();
    lens.fields.values[2].y = 40.0;
    let harness = pupils(lens);
    harness.get_by_label("Pupil of field 3: no light");
    harness.get_by_label_contains(
        "No light: surface 1 clips 90 of 127 rays, the chief ray among them.",
    );
}

#[test]
fn an_irregular_pupil_is_reported_in_pieces() {
    let mut lens = double_gauss();
    let row = |curvature, thickness, medium, limit: f64| Row {
        curvature,
        thickness,
        medium,
        semi_diameter: Some(limit),
        ..Row::default()
    };
    // Spherical aberration behind a small hole: the middle and one zone get through.
    lens.surfaces = vec![
        Row { stop: true, ..row(0.02, 8.0, Medium::Index(1.5), 14.0) },
        row(-0.02, 44.4, Medium::Air, 14.0),
        row(0.0, 5.0, Medium::Air, 0.12),
    ];
    lens.aperture = Aperture::EntrancePupilDiameter(26.0);
    lens.fields.values.truncate(1);
    lens.variables.clear();
    let harness = pupils(lens);
    harness.get_by_label("irregular: 2 pieces");
}

#[test]
fn the_layout_counts_lost_rays_by_fate() {
    let mut harness = panel_harness(LayoutPanel::new(RenderBackend::Software), view());
    harness.run();
    harness.get_by_label_contains("clipped of 45 rays");
    harness.get_by_label_contains("Section of");
}

#[test]
fn lost_rays_offer_the_rims_that_clip_them() {
    let mut harness = panel_harness(LayoutPanel::new(RenderBackend::Software), view());
    harness.run();
    harness.get_by_label_contains("clipped of 45 rays").click();
    harness.run();
    harness.get_by_label_contains("Widen the rim of surface 1 from 6.3 to ").click();
    harness.run();
    let [Command::Preview(Some(wider))] = harness.state().commands.as_slice() else {
        panic!("{:?}", harness.state().commands);
    };
    assert!(wider.surfaces[0].semi_diameter > Some(6.3));
    assert_eq!(wider.surfaces[1..], double_gauss().surfaces[1..]);
}

#[test]
fn first_order_data_are_labelled() {
    let mut harness = panel_harness(FirstOrderPanel, view());
    harness.run();
    for text in ["Focal length", "49.389 mm", "Petzval radius"] {
        harness.get_by_label(text);
    }
}

#[test]
fn seidel_sums_are_shown_for_every_surface_within_the_narrowest_panel() {
    // The room of the panel in a window of 1280 x 800.
    let mut harness = Harness::builder()
        .with_size([420.0, 310.0])
        .with_context_setup(aplanat::studio::theme::apply)
        .build_ui_state(
            |ui, view: &mut SessionView| {
                let mut actions = aplanat::studio::Actions::default();
                SeidelPanel::default().ui(ui, view, &mut actions);
            },
            view(),
        );
    harness.run();
    for column in ["Seidel sums, µm", "6 STO", "S1", "S2", "S3", "S4", "S5", "C1", "C2", "Sum"] {
        let place = harness.get_by_label(column).rect();
        assert!(place.right() <= 420.0 && place.bottom() <= 310.0, "{column}: {place:?}");
    }
}

#[test]
fn an_effect_can_be_forced() {
    let mut harness = panel_harness(EffectsPanel, view());
    harness.run();
    harness.get_by_label("Choice of ray aiming").click();
    harness.run();
    harness.get_by_label("On").click();
    harness.run();
    assert_eq!(harness.state().commands, [Command::SetEffect(Effect::Aiming, EffectOverride::On)]);
}

#[test]
fn a_lens_that_cannot_be_traced_says_why_in_every_panel() {
    let mut broken = view();
    let results = broken.results.take().unwrap();
    let mut results = Arc::unwrap_or_clone(results);
    results.analyses = Err("no beam at surface 3".to_owned());
    broken.results = Some(Arc::new(results));
    let mut harness = panel_harness(SpotPanel::new(RenderBackend::Software), broken);
    harness.run();
    harness.get_by_label("No beam at surface 3");
}

/// A front of the double Gauss that stands somehow, and one before it.
pub(super) fn fronts(standing: RunStatus) -> SessionView {
    let view = view();
    let design = |i: usize| pareto::ParetoPoint {
        lens: Lens { name: format!("lens {i}"), ..double_gauss() },
        weight: Some(1e-6 * i as f64),
        min_light: None,
        spot: 0.01 * (1 + i) as f64,
        spot_error: 1e-6,
        as_built: None,
        light: 10.0 * (3 + i) as f64,
        light_error: 1e-3,
        has_light: true,
        rays: 600,
    };
    let mut front = pareto::Front::default();
    (0..6).for_each(|i| assert!(front.insert(design(i))));
    let leg = ParetoPass {
        front: Arc::new(front),
        evaluated: Arc::new(vec![[0.05, 40.0]]),
        hypervolume: 0.5,
        done: 400,
        total: 400,
        seconds: 2.0,
        rejection: None,
    };
    let run = ParetoRun {
        settings: pareto::ParetoSettings::default(),
        compare: true,
        lens: Arc::clone(&view.lens),
        start: Arc::new(design(6)),
        main: leg.clone(),
        biased: Some(leg),
    };
    let earlier = vec![run_view(RunKind::Pareto, 1, RunStatus::Finished, run.clone())];
    let fronts = ParetoView { run: run_view(RunKind::Pareto, 2, standing, run), earlier };
    SessionView { pareto: fronts, ..view }
}

fn pareto_front(view: SessionView) -> Harness<'static, PanelState<ParetoPanel>> {
    let mut harness = panel_harness(ParetoPanel::default(), view);
    harness.run();
    harness
}

#[test]
fn a_sweep_is_requested_with_the_settings_of_the_panel() {
    let mut harness = pareto_front(view());
    harness.get_by_label_contains("How sharp can this lens be for how much light?");
    harness.get_by_label("Compare with fixed rays").click();
    harness.run();
    harness.get_by_label("Start").click();
    harness.run();
    let settings = pareto::ParetoSettings::default();
    assert_eq!(harness.state().commands, [Command::StartPareto { settings, compare: true }]);
}

#[test]
fn a_sweep_can_be_paused_stopped_exported_and_dismissed() {
    let cases = [
        (RunStatus::Running, "Pause", Command::PausePareto),
        (RunStatus::Paused, "Resume", Command::ResumePareto),
        (RunStatus::Running, "Stop", Command::StopPareto),
        (RunStatus::Stopped, "Clear", Command::ClearPareto),
    ];
    for (standing, button, command) in cases {
        let mut harness = pareto_front(fronts(standing));
        harness.get_by_label(button).click();
        harness.run();
        assert_eq!(harness.state().commands, [command], "{button}");
    }
    let mut harness = pareto_front(fronts(RunStatus::Finished));
    press(&mut harness, "Export…");
    assert_eq!(harness.state().requests, [FileRequest::ExportFront]);
}

#[test]
fn front_lenses_are_browsed_and_accepted() {
    let view = fronts(RunStatus::Finished);
    let run = view.pareto.run.snapshot.clone().unwrap();
    let designs = run.main.front.points();
    let mut harness = pareto_front(view);
    harness.get_by_label_contains("hypervolume");
    harness.get_by_label("Sharper").click();
    harness.run();
    let preview = |i: usize| Command::Preview(Some(Box::new(designs[i].lens.clone())));
    assert_eq!(harness.state().commands, [preview(0)]);
    harness.get_by_label("Brighter").click();
    harness.run();
    harness.get_by_label_contains("% of the start");
    harness.get_by_label("Accept this lens").click();
    harness.run();
    assert_eq!(harness.state().commands[1..], [preview(1), Command::AcceptPreview]);
}

#[test]
fn a_click_on_a_point_shows_its_lens() {
    let mut harness = pareto_front(fronts(RunStatus::Finished));
    let plot = harness.get_by_label_contains("Front of").rect();
    // Somewhere on the way across the plot lies a point.
    'search: for i in 0..40 {
        for j in 0..25 {
            let share = egui::vec2(i as f32 / 40.0, j as f32 / 25.0);
            let at = plot.min + share * plot.size();
            harness.hover_at(at);
            harness.run();
            if harness.query_by_label_contains("% of the start").is_some() {
                harness.drag_at(at);
                harness.drop_at(at);
                harness.run();
                break 'search;
            }
        }
    }
    let [Command::Preview(Some(_))] = harness.state().commands.as_slice() else {
        panic!("{:?}", harness.state().commands.len());
    };
}

#[test]
fn a_failed_sweep_shows_its_reason() {
    let mut failed = view();
    failed.pareto.run.error = Some("surface 3 is steeper than a hemisphere".to_owned());
    pareto_front(failed).get_by_label("Surface 3 is steeper than a hemisphere");

    let mut dark = view();
    let mut results = Arc::unwrap_or_clone(dark.results.take().unwrap());
    results.analyses = Err("no beam at surface 3".to_owned());
    dark.results = Some(Arc::new(results));
    let mut harness = pareto_front(dark);
    harness.get_by_label("Start").click();
    harness.run();
    assert_eq!(harness.state().commands, []);
    harness.get_by_label("No light gets through this lens");
}

/// The image plane lies where a solve puts it: what is left of its distance is rounding.
#[test]
fn a_defocus_of_nothing_but_rounding_is_zero() {
    for bundled in aplanat::files::bundled_lenses().iter().take(8) {
        let opened = aplanat::files::parse(bundled.text.as_bytes(), bundled.name).unwrap();
        let mut lens = opened.lens;
        if lens.zoom_positions() > 1 {
            continue;
        }
        lens.image_solve = Some(0.0);
        let view = view_of(lens);
        let analyses = view.results.as_ref().unwrap().analyses.as_ref();
        if !analyses.is_ok_and(|numbers| numbers.first_order().image_defocus.is_some()) {
            continue;
        }
        let mut harness = panel_harness(FirstOrderPanel, view);
        harness.run();
        let at = |label: &str| harness.get_by_label(label).rect().center().y;
        let line = at("Defocus");
        let zero = harness.get_all_by_label("0 mm");
        let beside = zero.filter(|text| (text.rect().center().y - line).abs() < 3.0).count();
        assert_eq!(beside, 1, "{}", bundled.name);
    }
}

/// A share of the axis and its error stand in one line in the default arrangement.
#[test]
fn the_share_of_a_pupil_is_not_parted_from_its_unit() {
    let mut harness = small_harness(PupilPanel::default(), view(), UPPER);
    harness.run();
    let galleys = painted_galleys(&harness);
    let shares = galleys.iter().filter(|galley| galley.text().contains(" of axis"));
    let lines: Vec<usize> = shares.map(|galley| galley.rows.len()).collect();
    assert_eq!(lines, [1, 1, 1]);
}

/// The numbers below each pupil are whole in the default arrangement.
#[test]
fn the_captions_of_pupils_fit() {
    let mut harness = small_harness(PupilPanel::default(), view(), UPPER);
    harness.run();
    let pupils = harness.get_all_by_label_contains("Pupil of field").count();
    let rays: Vec<_> = harness.get_all_by_label_contains(" rays, ").map(|n| n.rect()).collect();
    assert_eq!((pupils, rays.len()), (3, 3));
    let clipped: Vec<_> = harness
        .output()
        .shapes
        .iter()
        .filter_map(|painted| {
            let egui::Shape::Text(text) = &painted.shape else { return None };
            let is_caption = text.galley.text().contains(" rays, ");
            is_caption.then(|| (text.visual_bounding_rect(), painted.clip_rect))
        })
        .collect();
    assert_eq!(clipped.len(), 3);
    for (text, clip) in clipped {
        assert!(clip.expand(0.5).contains_rect(text), "{text:?} in {clip:?}");
    }
}

/// One ray is no rays, and one variable no variables.
#[test]
fn counts_of_one_are_singular() {
    let mut lens = double_gauss();
    lens.variables.truncate(1);
    let mut harness = panel_harness(ParetoPanel::default(), view_of(lens));
    harness.run();
    harness.get_by_label_contains("the 1 variable and all semi-diameters");
}

/// A view with the numbers that a setting asks for, once they are there.
fn results_with(setting: PanelSetting, are_there: impl Fn(&Analyses) -> bool) -> SessionView {
    results_with_all(vec![setting], are_there)
}

/// The same for several settings.
pub(super) fn results_with_all(
    settings: Vec<PanelSetting>,
    are_there: impl Fn(&Analyses) -> bool,
) -> SessionView {
    let mut session = Session::new(double_gauss(), || {}).unwrap();
    let name = format!("{settings:?}");
    for setting in settings {
        session.apply(Command::Show(setting));
    }
    for _ in 0..1000 {
        session.poll();
        let (results, settings) = (session.view().results, session.view().settings);
        let found = results.filter(|found| found.analyses.as_ref().is_ok_and(&are_there));
        if let Some(found) = found {
            return SessionView { results: Some(found), settings, ..view() };
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    panic!("no numbers for {name}");
}

/// Every chart has numbers along both axes, in the notation of the titles.
#[test]
fn the_axes_of_field_curves_have_numbers() {
    let shown = results_with(PanelSetting::FieldCurves(true), |all| all.field_curves.is_some());
    let mut harness = small_harness(FieldCurvesPanel, shown, UPPER);
    harness.run_steps(3);
    let texts = painted_texts(&harness);
    let numbers = texts.iter().filter(|text| text.parse::<f64>().is_ok()).count();
    assert!(numbers >= 4 * (3 + 2), "{numbers} in {texts:?}");
    for text in ["Lateral colour, µm", "486 nm", "656 nm"] {
        assert!(texts.iter().any(|painted| painted == text), "{text} in {texts:?}");
    }
}

/// Every field has an outline on the surface that is chosen, and all are smaller than its rim.
#[test]
fn the_footprint_panel_shows_a_surface() {
    let shown = results_with(PanelSetting::Footprints(true), |all| all.footprints.is_some());
    let lens = double_gauss();
    let mut harness = panel_harness(FootprintPanel::default(), shown);
    harness.run_steps(3);
    let texts = painted_texts(&harness);
    for axis in ["x, mm", "y, mm"] {
        assert!(texts.iter().any(|text| text == axis), "{axis} in {texts:?}");
    }
    harness.get_by_label_contains("Footprint: field 1 reaches");
    harness.get_by_label_contains("Surface of the footprint").click();
    harness.run_steps(3);
    harness.get_by_label("Surface 2").click();
    harness.run_steps(3);
    let rim = lens.surfaces[1].semi_diameter.unwrap();
    harness.get_by_label(&format!("rim {} mm", number::format_digits(rim, 5)));
    let results = harness.state().view.results.clone().unwrap();
    let prints = results.analyses.as_ref().unwrap().footprints.clone().unwrap();
    let reach = |prints: &Result<Vec<_>, _>| prints.as_ref().ok().map(|all: &Vec<_>| reach_of(all));
    assert!(prints.value.iter().filter_map(reach).all(|reach| reach <= rim * (1.0 + 1e-6)));
}

/// How far the light of a field reaches on the second surface.
fn reach_of(prints: &[aplanat::analysis::Footprint]) -> f64 {
    prints[1].reach
}

/// The map has the spots of the list of fields, in words for those who do not see colours.
#[test]
fn the_spot_map_panel_shows_the_range_of_the_spots() {
    let shown = results_with(PanelSetting::SpotMap(true), |all| all.spot_map.is_some());
    let mut harness = panel_harness(SpotMapPanel::default(), shown);
    harness.run_steps(3);
    harness.get_by_label("RMS spot radius over the field");
    harness.get_by_label_contains("RMS radius, ±");
    let texts = painted_texts(&harness);
    assert!(texts.iter().any(|text| text == "field y, degrees"), "{texts:?}");
    assert!(texts.iter().all(|text| !text.contains("± 0.0 %")), "{texts:?}");
    harness.get_by_label_contains("µm");
    let results = harness.state().view.results.clone().unwrap();
    let numbers = results.analyses.as_ref().unwrap();
    let map = numbers.spot_map.clone().unwrap();
    let map = map.value.as_ref().unwrap();
    let values = &map.grid.values;
    let center = values[values.len() / 2].as_ref().unwrap().as_ref().unwrap();
    let axis = numbers.spots.value[0].as_ref().unwrap();
    let off = (center.value - axis.rms.value).abs();
    assert!(off <= center.error + axis.rms.error, "{} and {}", center.value, axis.rms.value);
}

/// A click on a pair shows its light in the layout, another click hides it.
#[test]
fn a_ghost_of_the_list_is_shown_in_the_layout() {
    let shown = results_with(PanelSetting::Ghosts(true), |all| all.ghosts.is_some());
    let mut harness = panel_harness(GhostsPanel::default(), shown);
    harness.run_steps(3);
    let results = harness.state().view.results.clone().unwrap();
    let ghosts = results.analyses.as_ref().unwrap().ghosts.clone().unwrap();
    let ghosts = ghosts.value.as_ref().unwrap();
    let brightest = &ghosts.fields[0][0];
    let pair = [brightest.paraxial.first, brightest.paraxial.second];
    let name = format!("Ghost of surfaces {} and {}", pair[0] + 1, pair[1] + 1);
    harness.get_by_label(&name).click();
    harness.run_steps(3);
    let asked = Command::Show(PanelSetting::Ghost(Some(pair)));
    assert!(harness.state().commands.contains(&asked), "{:?}", harness.state().commands);
    harness.get_by_label("Coating between air and glass").click();
    harness.run_steps(3);
    harness.get_by_label_contains("V coat").click();
    harness.run_steps(3);
    let coated = Command::Show(PanelSetting::Coating(aplanat::analysis::Coating::VCoat));
    assert!(harness.state().commands.contains(&coated), "{:?}", harness.state().commands);

    let drawn = results_with(PanelSetting::Ghost(Some(pair)), |all| !all.ghost_rays.is_empty());
    let rays = &drawn.results.as_ref().unwrap().analyses.as_ref().unwrap().ghost_rays;
    // Some light gets through, and goes back and forth on its way.
    let turns = |ray: &Vec<aplanat::math::Vec3<f64>>| {
        ray.windows(2).filter(|step| step[1].z < step[0].z).count()
    };
    assert!(rays.iter().any(|ray| turns(ray) > 0), "{rays:?}");
    let mut layout = panel_harness(LayoutPanel::new(RenderBackend::Software), drawn);
    layout.run_steps(3);
    layout.get_by_label(&format!("ghost {}, {}", pair[0] + 1, pair[1] + 1)).click();
    layout.run_steps(3);
    let hidden = Command::Show(PanelSetting::Ghost(None));
    assert!(layout.state().commands.contains(&hidden), "{:?}", layout.state().commands);
}

/// The wavelength of wavefronts and images is chosen in a list: of images all of them too.
#[test]
fn the_wavelength_of_wavefronts_can_be_chosen() {
    let shown = results_with(PanelSetting::Wavefronts(true), |all| all.wavefronts.is_some());
    let mut harness = panel_harness(WavefrontPanel::default(), shown);
    harness.run_steps(3);
    harness.get_by_label("Wavelength of the wavefront").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("All wavelengths").is_none());
    harness.get_by_label("486.1 nm").click();
    harness.run_steps(3);
    let chosen = Command::Show(PanelSetting::WavefrontLight(Some(
        aplanat::analysis::ImageLight::Wavelength(0),
    )));
    assert!(harness.state().commands.contains(&chosen), "{:?}", harness.state().commands);
    harness.get_by_label("Encircled energy").click();
    harness.run_steps(3);
    harness.get_by_label("Wavelength of the wavefront").click();
    harness.run_steps(3);
    assert!(harness.get_all_by_label("All wavelengths").count() > 0);
}

/// Every page of the wavefront panel shows every field, with the numbers of the analyses. Images of a point are
/// asked for by the pages that show them, and no longer by the others.
#[test]
fn the_wavefront_panel_shows_maps_images_and_coefficients() {
    let settings = vec![PanelSetting::Wavefronts(true), PanelSetting::PointImages(true)];
    let shown = results_with_all(settings, |numbers| numbers.point_images.is_some());
    let mut harness = panel_harness(WavefrontPanel::default(), shown);
    harness.run_steps(3);
    let numbers = harness.state().view.results.clone().unwrap();
    let waves = numbers.analyses.as_ref().unwrap().wavefronts.clone().unwrap();
    let maps = |harness: &Harness<'_, PanelState<WavefrontPanel>>, what: &str| {
        harness.get_all_by_label_contains(what).count()
    };
    assert_eq!(maps(&harness, "Wavefront at "), waves.value.fields.len());
    let no_images = Command::Show(PanelSetting::PointImages(false));
    assert!(harness.state().commands.contains(&no_images), "{:?}", harness.state().commands);
    harness.get_by_label("Point spread").click();
    harness.run_steps(3);
    assert_eq!(maps(&harness, "Point spread at "), waves.value.fields.len());
    harness.state_mut().commands.clear();
    harness.run_steps(1);
    assert_eq!(harness.state().commands, []);
    harness.get_by_label("Logarithmic").click();
    harness.get_by_label("Encircled energy").click();
    harness.run_steps(3);
    harness.get_by_label("Zernike").click();
    harness.run_steps(3);
    harness.get_by_label("coma y");
    let first = waves.value.fields[0].value.as_ref().unwrap().zernike.as_ref().unwrap();
    harness.get_by_label(&format!("{:.4}", first.coefficients[10].value));
}
