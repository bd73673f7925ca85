//! The export of a lens that a search has found: catalogue glasses, every constraint satisfied, and a
//! report of what was changed. A lens that cannot be manufactured is refused with the reasons.

use crate::files;
use crate::lens::{Lens, SurfaceNumber};
use crate::merit::ConstraintMargin;
use crate::search::lens_landscape::{
    CrossCheck, FieldSummary, FinalizedLens, GlassSubstitution, LensLandscape, UnlistedGlass,
    finalize,
};
use crate::session::run::catch_panic;
use std::path::Path;

/// Finalizes lenses of a search.
#[derive(Debug)]
pub(super) struct LensFinalizer {
    landscape: LensLandscape,
}

impl LensFinalizer {
    pub(super) fn new(landscape: LensLandscape) -> Self {
        Self { landscape }
    }

    /// Finalizes a lens and writes it. Returns a report, or the reason why nothing was written.
    pub(super) fn write(&self, lens: &Lens, path: &Path) -> Result<String, String> {
        catch_panic(|| {
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

/// The lens without the variables of the search, which are not those of the designer.
fn without_variables(lens: &Lens) -> Lens {
    Lens { variables: Vec::new(), ..lens.clone() }
}

fn refusal(failures: &[String], finished: &FinalizedLens) -> String {
    let first = "nothing is written: the lens cannot be manufactured within its constraints";
    format!("{first}\n{}\n\n{}", failures.join("\n"), report(finished))
}

/// The glasses, the sharpness and light, and every constraint with its margin.
fn report(finished: &FinalizedLens) -> String {
    let glass = |change: &GlassSubstitution| {
        let ((nd, _), (is, vd)) = (change.was, change.is);
        let (surface, glass) = (SurfaceNumber::new(change.surface), &change.glass);
        format!("glass after surface {surface}: {glass} ({is:.4}, {vd:.1}) for index {nd:.4}")
    };
    let unlisted = |UnlistedGlass { surface, glass }: &UnlistedGlass| {
        let surface = SurfaceNumber::new(*surface);
        format!("glass after surface {surface}: {glass} is not listed, and retained by the rules")
    };
    let graded = |surface: &usize| {
        let surface = SurfaceNumber::new(*surface);
        format!("medium after surface {surface}: a gradient index, retained")
    };
    let field = |(field, other): (&FieldSummary, &CrossCheck)| {
        let spot = field.spot.map_or(f64::NAN, |spot| 1e3 * spot.value);
        let (number, again, light) = (field.field + 1, 1e3 * other.spot, field.light.value);
        format!("{number:>6} {spot:>12.3} {again:>14.3} {light:>12.2}")
    };
    let limit = |limit: &ConstraintMargin| {
        let (name, value, margin) = (limit.term.replace('_', " "), limit.value, limit.slack());
        let surface =
            limit.surface.map_or_else(|| "-".to_owned(), |i| SurfaceNumber::new(i).to_string());
        format!("{name:<16} {surface:>8} {value:>12.4} {margin:>12.4}")
    };
    let mut lines: Vec<String> = finished.glasses.iter().map(glass).collect();
    lines.extend(finished.unlisted.iter().map(unlisted));
    lines.extend(finished.gradients.iter().map(graded));
    lines.push(format!("{:>6} {:>12} {:>14} {:>12}", "field", "spot, µm", "other rays, µm", "mm²"));
    lines.extend(finished.figures.fields.iter().zip(&finished.confirmed).map(field));
    lines.push(format!("{:<16} {:>8} {:>12} {:>12}", "constraint", "surface", "value", "margin"));
    lines.extend(finished.limits.iter().chain(&finished.light).map(limit));
    lines.join("\n")
}
