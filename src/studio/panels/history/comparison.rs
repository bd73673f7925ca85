//! Two versions beside each other: the numbers that a designer asks first, and every parameter that
//! differs.

use std::sync::Arc;

use egui::{Grid, Ui};

use super::spots;
use crate::lens::{Lens, Parameter, Quantity, SurfaceNumber};
use crate::session::{Analyses, AnalysisResults, HistoryNode, MeritReport, SessionView};
use crate::studio::number;
use crate::studio::panels::{RMS_OVER_FIELDS, mean_pupil_area, rms_over_fields, total_track};

/// A quantity of two versions.
struct ComparedNumber {
    name: String,
    present: f64,
    selected: f64,
}

/// Shows the table.
pub(super) fn table(ui: &mut Ui, view: &SessionView, selected: &HistoryNode) {
    let numbers = numbers(view, selected);
    let words = differing_words(&view.lens, &selected.lens);
    Grid::new("comparison").num_columns(4).spacing([10.0, 1.0]).striped(true).show(ui, |ui| {
        for heading in ["", "present", "this one", "difference"] {
            ui.weak(heading);
        }
        ui.end_row();
        for ComparedNumber { name, present, selected } in &numbers {
            ui.label(name);
            let change = number::without_rounding(selected - present, *present);
            let digits = number::digits_between(*present, change, 5);
            ui.label(number::format_digits(*present, digits));
            ui.label(number::format_digits(*selected, digits));
            ui.label(difference_text(*present, *selected));
            ui.end_row();
        }
        for (name, present, selected) in words {
            for text in [name, present, selected] {
                ui.label(text);
            }
            ui.end_row();
        }
    });
    if let Some((present, selected)) = both(view, selected) {
        spots::beside_each_other(ui, present, selected);
    }
}

/// The change of a number, as a length where there is no ratio; nothing between a plane and a sphere.
fn difference_text(present: f64, selected: f64) -> String {
    let change = number::format_change(present, selected, 2);
    let difference = selected - present;
    let as_length = || difference.is_finite().then(|| number::format_digits(difference, 3));
    change.or_else(as_length).unwrap_or_default()
}

/// The present version and the selected one with their numbers, once both are known.
fn both<'a>(view: &'a SessionView, selected: &HistoryNode) -> Option<(Shown<'a>, Shown<'a>)> {
    let with_numbers = |results: &'a AnalysisResults| {
        results.analyses.as_ref().ok().map(|numbers| (results, numbers))
    };
    let own = view.results.as_deref().filter(|_| view.is_current())?;
    let other = view.preview_results.as_deref().filter(|other| other.lens == selected.lens)?;
    with_numbers(own).zip(with_numbers(other))
}

/// A lens with its numbers.
type Shown<'a> = (&'a AnalysisResults, &'a Analyses);

fn numbers(view: &SessionView, selected: &HistoryNode) -> Vec<ComparedNumber> {
    let mut found = Vec::new();
    let mut add = |name: &str, pair: Option<(f64, f64)>| {
        if let Some((present, selected)) = pair {
            found.push(ComparedNumber { name: name.to_owned(), present, selected });
        }
    };
    add("merit", merits(view, selected));
    if let Some(((_, own), (_, other))) = both(view, selected) {
        let of = |value: fn(&Analyses) -> Option<f64>| value(own).zip(value(other));
        let rms = of(|numbers| rms_over_fields(numbers).map(|spot| 1e3 * spot));
        add(&format!("{RMS_OVER_FIELDS}, µm"), rms);
        add("focal length, mm", of(|numbers| numbers.first_order().efl));
        add("light, mm²", of(|numbers| Some(mean_pupil_area(numbers))));
    }
    let track = |lens: &Lens| total_track(lens, view.settings.zoom);
    add("total track, mm", track(&view.lens).zip(track(&selected.lens)));
    found.extend(differing_parameters(&view.lens, &selected.lens));
    found
}

/// The merits of the present version and of the selected one: by the merit function of the present one as soon
/// as both are known, as the layout tells them. Until then each by that of its own time.
fn merits(view: &SessionView, selected: &HistoryNode) -> Option<(f64, f64)> {
    let total = |report: &Option<Arc<MeritReport>>, lens: &Arc<Lens>| {
        let report = report.as_deref().filter(|report| report.lens == *lens)?;
        report.values.as_ref().ok().map(|values| values.total)
    };
    let own = total(&view.merit, &view.lens);
    let live = own.zip(total(&view.preview_merit, &selected.lens));
    let present = view.history.iter().find(|node| node.id == view.version_id);
    live.or_else(|| present.and_then(|node| node.merit).zip(selected.merit))
}

/// The numbers that differ, of lenses with as many surfaces; a curvature as its radius.
fn differing_parameters(present: &Lens, selected: &Lens) -> Vec<ComparedNumber> {
    if present.surfaces.len() != selected.surfaces.len() {
        return Vec::new();
    }
    let mut parameters = present.parameters();
    parameters.extend(selected.parameters());
    parameters.sort_unstable();
    parameters.dedup();
    let differing = |parameter: Parameter| {
        let values = present.get(parameter).zip(selected.get(parameter));
        let (old, new) = values.filter(|(old, new)| old != new)?;
        let is_radius = parameter.quantity == Quantity::Curvature;
        let shown = |value: f64| if is_radius { number::radius(value) } else { value };
        let name = parameter.shown_name();
        Some(ComparedNumber { name, present: shown(old), selected: shown(new) })
    };
    parameters.into_iter().filter_map(differing).collect()
}

/// Glasses and counts that differ.
fn differing_words(present: &Lens, selected: &Lens) -> Vec<(String, String, String)> {
    let [own, other] = [present, selected].map(|lens| lens.surfaces.len());
    if own != other {
        return vec![("surfaces".to_owned(), own.to_string(), other.to_string())];
    }
    let pairs = present.surfaces.iter().zip(&selected.surfaces).enumerate();
    let differing = pairs.filter(|(_, (old, new))| old.medium != new.medium);
    let row = |(i, (old, new)): (usize, (&crate::lens::Row, &crate::lens::Row))| {
        let name = format!("glass after surface {}", SurfaceNumber::new(i));
        (name, medium_text(&old.medium), medium_text(&new.medium))
    };
    differing.map(row).collect()
}

fn medium_text(medium: &crate::lens::Medium) -> String {
    serde_json::to_string(medium).unwrap_or_default().trim_matches('"').to_owned()
}
