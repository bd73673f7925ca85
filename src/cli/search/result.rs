//! The result of a search: the start against the best lens, and the finalized lens.

use super::limits::{self, ViolatedLimit};
use crate::cli::output::{ShortNumber, TextTable, or_dash};
use crate::cli::terms::TermComparison;
use crate::lens::{Lens, MediumPlace};
use crate::search::lens_landscape::{
    FieldSummary, FinalizedLens, LandscapeError, LensLandscape, LensSummary, UnlistedGlass,
};
use serde::Serialize;
use std::fmt;

/// The tolerance of the printed numbers.
const FIGURES_TOLERANCE: f64 = 1e-4;

/// The start against the best lens.
#[derive(Serialize)]
pub(super) struct StartAgainstBest {
    start: LensSummary,
    best: LensSummary,
    terms: Vec<TermComparison>,
    best_breaks: Vec<ViolatedLimit>,
}

/// A finalized lens and the constraints that it violates.
#[derive(Serialize)]
pub(super) struct FinishedReport {
    pub(super) failures: Vec<String>,
    #[serde(flatten)]
    pub(super) finished: FinalizedLens,
}

impl StartAgainstBest {
    pub(super) fn new(landscape: &LensLandscape, best: &Lens) -> Result<Self, LandscapeError> {
        let start = landscape.start();
        let [before, after] = [landscape.term_values(start)?, landscape.term_values(best)?];
        Ok(Self {
            start: LensSummary::new(start, FIGURES_TOLERANCE)?,
            best: LensSummary::new(best, FIGURES_TOLERANCE)?,
            terms: TermComparison::compare(&before, &after),
            best_breaks: ViolatedLimit::all(landscape.violations(best)?),
        })
    }

    /// The number of rays of the figures.
    pub(super) fn rays(&self) -> usize {
        self.start.rays() + self.best.rays()
    }

    /// Writes the figures of both lenses.
    pub(super) fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (start, best) = (&self.start, &self.best);
        let mut table = TextTable::new(&[
            "field",
            "spot, um",
            "error",
            "best",
            "error",
            "light, mm^2",
            "error",
            "best",
            "error",
        ]);
        for (before, after) in start.fields.iter().zip(&best.fields) {
            let zoom = if start.focal_lengths.len() > 1 {
                format!(" zoom {}", before.zoom)
            } else {
                String::new()
            };
            let name = if before.x == 0.0 {
                format!("{}{zoom}", ShortNumber(before.y))
            } else {
                format!("{}, {}{zoom}", ShortNumber(before.x), ShortNumber(before.y))
            };
            let light = |field: &FieldSummary| {
                [format!("{:.2}", field.light.value), format!("{:.0e}", field.light.error)]
            };
            let cells = [spot(before), spot(after), light(before), light(after)];
            table.row(std::iter::once(name).chain(cells.into_iter().flatten()));
        }
        write!(f, "{table}")?;
        for (a, b) in start.focal_lengths.iter().zip(&best.focal_lengths) {
            writeln!(f, "focal length {} -> {} mm", or_dash(*a), or_dash(*b))?;
        }
        writeln!(f, "track {} -> {} mm", ShortNumber(start.track), ShortNumber(best.track))?;
        let [from, to] = [start, best].map(|lens| format!("{} ({})", lens.elements, lens.topology));
        writeln!(f, "elements {from} -> {to}")?;
        Ok(())
    }

    /// Writes the terms of the merit function and the violated constraints.
    pub(super) fn write_terms(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", TermComparison::table(&self.terms))?;
        limits::write(&self.best_breaks, f)
    }
}

impl FinishedReport {
    pub(super) fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let FinalizedLens { glasses, unlisted, gradients, figures, confirmed, .. } = &self.finished;
        let (limits, light) = (&self.finished.limits, &self.finished.light);
        let verdict =
            if self.failures.is_empty() { "satisfies every constraint" } else { "NOT finished" };
        writeln!(f, "\nfinished: {verdict}")?;
        for change in glasses {
            let (nd, vd) = change.was;
            let was = format!("{} {}", ShortNumber(nd), or_dash(vd));
            let (nd, vd) = change.is;
            let is = format!("{} ({} {})", change.glass, ShortNumber(nd), ShortNumber(vd));
            writeln!(f, "  glass {}: {was} -> {is}", MediumPlace::behind(change.surface))?;
        }
        for UnlistedGlass { surface, glass } in unlisted {
            writeln!(
                f,
                "  glass {}: {glass} is retained: the rules do not list it, but fix the surface",
                MediumPlace::behind(*surface)
            )?;
        }
        for surface in gradients {
            let place = MediumPlace::behind(*surface);
            writeln!(f, "  medium {place}: a gradient index, retained as it is")?;
        }
        let head =
            ["field", "spot, um", "error", "other rays", "light, mm^2", "error", "other rays"];
        let mut table = TextTable::new(&head);
        for (field, other) in figures.fields.iter().zip(confirmed) {
            let name = format!("{} zoom {}", ShortNumber(field.y), field.zoom);
            let second = [format!("{:.3}", 1e3 * other.spot), format!("{:.2}", other.light)];
            let light = [format!("{:.2}", field.light.value), format!("{:.0e}", field.light.error)];
            let [spot_second, light_second] = second;
            let cells = spot(field).into_iter().chain([spot_second]).chain(light);
            table.row(std::iter::once(name).chain(cells).chain([light_second]));
        }
        writeln!(f, "{table}")?;
        let mut table =
            TextTable::new(&["constraint", "place", "zoom", "value", "min", "max", "margin"]);
        for limit in limits.iter().chain(light) {
            table.row(limits::cells(limit).into_iter().chain([format!("{:.4}", limit.slack())]));
        }
        write!(f, "{table}")
    }
}

/// The RMS radius of a spot and its error, in µm.
fn spot(field: &FieldSummary) -> [String; 2] {
    let both = |spot: crate::analysis::Estimate| {
        [format!("{:.3}", 1e3 * spot.value), format!("{:.0e}", 1e3 * spot.error)]
    };
    field.spot.map_or(["-".to_owned(), "-".to_owned()], both)
}
