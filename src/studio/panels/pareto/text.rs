//! The texts of a Pareto front: progress, hypervolume, and the numbers of a lens.

use egui::{Label, RichText, Ui};

use crate::lens::{Lens, Quantity};
use crate::optimize::pareto::ParetoPoint;
use crate::session::{ParetoRun, RunStatus, SessionView};
use crate::studio::number;
use crate::studio::panels::RMS_OVER_FIELDS;
use crate::studio::text::{capitalize, counted, status_text};

/// The variables of the sweep.
pub(super) fn variables_label(ui: &mut Ui, view: &SessionView) {
    let lens = view.pareto.run.snapshot.as_ref().filter(|_| view.pareto.run.is_active());
    let free = match lens {
        Some(run) => variables_by_kind(&run.start.lens),
        None if view.lens.variables.is_empty() => {
            "all curvatures, gaps and semi-diameters".to_owned()
        }
        None => {
            let variables = counted(view.lens.variables.len() as u64, "variable");
            format!("the {variables} and all semi-diameters")
        }
    };
    let text = format!(
        "Variables: {free}. Fields and wavelengths are those of the lens; its aperture becomes \
         the semi-diameter of the stop."
    );
    ui.add(Label::new(RichText::new(text).small().weak()).wrap()).on_hover_text(
        "If the lens has no variables, all curvatures and gaps are varied; the focal length and \
         the thicknesses of glass and air are constrained. The aperture becomes the semi-diameter \
         of the stop, so that the semi-diameters alone limit the beam.",
    );
}

/// The number of variables of each kind.
fn variables_by_kind(lens: &Lens) -> String {
    let kinds = [
        ("curvatures", Quantity::Curvature),
        ("gaps", Quantity::Thickness),
        ("semi-diameters", Quantity::SemiDiameter),
    ];
    let free = || lens.variables.iter().map(|variable| variable.parameter.quantity);
    let count = |kind: Quantity| free().filter(|quantity| *quantity == kind).count();
    let mut parts = kinds.map(|(name, kind)| (count(kind), name)).to_vec();
    let named: usize = parts.iter().map(|(count, _)| count).sum();
    parts.push((free().count() - named, "others"));
    parts.retain(|(count, _)| *count > 0);
    let parts: Vec<String> = parts.iter().map(|(count, name)| format!("{count} {name}")).collect();
    parts.join(", ")
}

/// The progress of the run.
pub(super) fn progress_text(run: &ParetoRun, status: RunStatus) -> String {
    let status = status_text(status);
    let pass = run.current_pass();
    let biased = if run.biased.is_some() { ", fixed rays" } else { "" };
    let rate = pass.done as f64 / pass.seconds;
    let rate = if rate.is_finite() { format!(", {rate:.0} steps/s") } else { String::new() };
    let (done, total, seconds) = (pass.done, pass.total, pass.seconds);
    format!("{status}{biased}: {done} of {total} steps{rate}, {seconds:.1} s")
}

/// The number of lenses, and the hypervolume of the fronts.
pub(super) fn hypervolume_label(ui: &mut Ui, run: &ParetoRun) {
    let main = &run.main;
    let (lenses, tried) = (main.front.points().len(), main.evaluated.len());
    let volume = main.hypervolume;
    let biased = run.biased.as_ref();
    let biased = biased.map(|pass| format!(", {:.4} with fixed rays", pass.hypervolume));
    let text = format!("{lenses} lenses on the front, {tried} tried; hypervolume {volume:.4}");
    ui.label(text + &biased.unwrap_or_default()).on_hover_text(
        "The area that the front covers in the plane of spot and light, against twice the spot of \
         the lens at the start, in multiples of the start's spot times its light: larger is better",
    );
    if let Some(why) = &run.current_pass().rejection {
        let text = RichText::new(capitalize(why)).small();
        ui.label(text.color(ui.visuals().warn_fg_color)).on_hover_text(
            "A weight whose optimization fails is skipped, and so is light that no lens near has",
        );
    }
}

/// Spot and light of the selected lens, with errors.
pub(super) fn selection_label(ui: &mut Ui, run: &ParetoRun, chosen: Option<&ParetoPoint>) {
    match chosen {
        Some(design) => {
            ui.add(Label::new(design_text(design, &run.start).replace('\n', ", ")).wrap());
        }
        None => {
            ui.weak("Click a point to show its lens in every panel; the design does not change.");
        }
    }
}

/// Spot and light of a lens, one value a line.
pub(super) fn design_text(design: &ParetoPoint, start: &ParetoPoint) -> String {
    let spot = number::with_error(1e3 * design.spot, 1e3 * design.spot_error);
    let light = number::with_error(design.light, design.light_error);
    let percent = number::format_digits(100.0 * design.light / start.light, 4);
    let asked = match (design.weight, design.min_light) {
        (None, None) => "start of the sweep".to_owned(),
        (None, Some(light)) => {
            let percent = number::format_digits(100.0 * light / start.light, 3);
            format!("found where at least {percent} % of the light was asked for")
        }
        (Some(0.0), _) => "found without a weight for light".to_owned(),
        (Some(weight), _) => {
            format!("rim blur {} µm", number::format_digits(1e3 * weight.sqrt(), 3))
        }
    };
    let as_built = design.as_built.map_or_else(String::new, |as_built| {
        let radius = number::with_error(1e3 * as_built.value, 1e3 * as_built.error);
        format!("as built {radius} µm\n")
    });
    format!(
        "{RMS_OVER_FIELDS} {spot} µm\n{as_built}light {light} mm², {percent} % of the start\n{asked}\n{}",
        counted(design.rays as u64, "ray")
    )
}
