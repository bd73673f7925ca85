//! From a lens that was found to a file that a factory can work by: real glasses, every limit kept,
//! and a report of what that took; a lens that does not get there is refused by name.

use super::background::guarded;
use crate::files;
use crate::lens::Lens;
use crate::merit::ConstraintMargin;
use crate::search::lens_landscape::{
    CrossCheck, FieldSummary, FinalizedLens, GlassSubstitution, LensLandscape, UnlistedGlass,
    finalize,
};
use std::path::Path;

/// What makes a lens that can be made.
#[derive(Debug)]
pub(super) struct LensFinalizer {
    landscape: LensLandscape,
}

impl LensFinalizer {
    pub(super) fn new(landscape: LensLandscape) -> Self {
        Self { landscape }
    }

    /// Finishes a lens and writes it; what was done, or why nothing was written.
    pub(super) fn write(&self, lens: &Lens, path: &Path) -> Result<String, String> {
        guarded(|| {
            let finished = finalize(&self.landscape, lens).map_err(|why| why.to_string())?;
            let failures = finished.failures();
            if !failures.is_empty() {
                return Err(refusal(&failures, &finished));
            }
            let saved = files::save(&without_variables(&finished.lens), path);
            saved.map_err(|why| why.to_string()).map(|_| report(&finished))
        })
    }
}

/// A lens for its own file: what a search held or freed is no variable of a person.
fn without_variables(lens: &Lens) -> Lens {
    Lens { variables: Vec::new(), ..lens.clone() }
}

fn refusal(failures: &[String], finished: &FinalizedLens) -> String {
    let first = "nothing is written: the lens cannot be made within its limits";
    format!("{first}\n{}\n\n{}", failures.join("\n"), report(finished))
}

/// Glasses, sharpness and light, and every limit with the room that is left.
fn report(finished: &FinalizedLens) -> String {
    let glass = |change: &GlassSubstitution| {
        let ((nd, _), (is, vd)) = (change.was, change.is);
        let (surface, glass) = (change.surface, &change.glass);
        format!("glass behind surface {surface} : {glass} ({is:.4}, {vd:.1}) for index {nd:.4}")
    };
    let unlisted = |UnlistedGlass { surface, glass }: &UnlistedGlass| {
        format!(
            "glass behind surface {surface} : {glass} is not listed, and stays: it is not to be touched"
        )
    };
    let graded =
        |surface: &usize| format!("medium behind surface {surface} : a gradient, kept as it is");
    let field = |(field, other): (&FieldSummary, &CrossCheck)| {
        let spot = field.spot.map_or(f64::NAN, |spot| 1e3 * spot.value);
        let (number, again, light) = (field.field + 1, 1e3 * other.spot, field.light.value);
        format!("{number:>6} {spot:>12.3} {again:>14.3} {light:>12.2}")
    };
    let limit = |limit: &ConstraintMargin| {
        let (name, value, room) = (limit.term.replace('_', " "), limit.value, limit.slack());
        let surface = limit.surface.map_or_else(|| "-".to_owned(), |i| (i + 1).to_string());
        format!("{name:<16} {surface:>8} {value:>12.4} {room:>12.4}")
    };
    let mut lines: Vec<String> = finished.glasses.iter().map(glass).collect();
    lines.extend(finished.unlisted.iter().map(unlisted));
    lines.extend(finished.gradients.iter().map(graded));
    lines.push(format!("{:>6} {:>12} {:>14} {:>12}", "field", "spot, µm", "other rays, µm", "mm²"));
    lines.extend(finished.figures.fields.iter().zip(&finished.confirmed).map(field));
    lines.push(format!("{:<16} {:>8} {:>12} {:>12}", "limit", "surface", "is", "room"));
    lines.extend(finished.limits.iter().chain(&finished.light).map(limit));
    lines.join("\n")
}
