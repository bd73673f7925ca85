//! From a lens that was found to a file that a factory can work by: real glasses, every limit kept,
//! and a report of what that took; a lens that does not get there is refused by name.

use super::background::guarded;
use crate::files;
use crate::lens::Lens;
use crate::merit::Margin;
use crate::search::lens::{Finished, LensLandscape, finish};
use std::fmt::Write as _;
use std::path::Path;

/// What makes a lens that can be made.
#[derive(Debug)]
pub(super) struct Finishing {
    landscape: LensLandscape,
}

impl Finishing {
    pub(super) fn on(landscape: LensLandscape) -> Self {
        Self { landscape }
    }

    /// Finishes a lens and writes it; what was done, or why nothing was written.
    pub(super) fn write(&self, lens: &Lens, path: &Path) -> Result<String, String> {
        guarded(|| {
            let finished = finish(&self.landscape, lens).map_err(|why| why.to_string())?;
            let failures = finished.failures();
            if !failures.is_empty() {
                return Err(refusal(&failures, &finished));
            }
            let saved = files::save(&written(&finished.lens), path);
            saved.map_err(|why| why.to_string()).map(|_| report(&finished))
        })
    }
}

/// A lens for its own file: what a search held or freed is no variable of a person.
fn written(lens: &Lens) -> Lens {
    Lens { variables: Vec::new(), ..lens.clone() }
}

fn refusal(failures: &[String], finished: &Finished) -> String {
    let first = "nothing is written: the lens cannot be made within its limits";
    format!("{first}\n{}\n\n{}", failures.join("\n"), report(finished))
}

/// Glasses, sharpness and light, and every limit with the room that is left.
fn report(finished: &Finished) -> String {
    let mut text = String::new();
    for change in &finished.glasses {
        let ((nd, _), (is, vd)) = (change.was, change.is);
        let (surface, glass) = (change.surface, &change.glass);
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "glass behind surface {surface} : {glass} ({is:.4}, {vd:.1}) for index {nd:.4}"
        );
    }
    let _ =
        writeln!(text, "{:>6} {:>12} {:>14} {:>12}", "field", "spot, µm", "other rays, µm", "mm²");
    for (field, other) in finished.figures.fields.iter().zip(&finished.confirmed) {
        let spot = field.spot.map_or(f64::NAN, |spot| 1e3 * spot.value);
        let (again, light) = (1e3 * other.spot, field.light.value);
        let _ = writeln!(text, "{:>6} {spot:>12.3} {again:>14.3} {light:>12.2}", field.field + 1);
    }
    let _ = writeln!(text, "{:<16} {:>8} {:>12} {:>12}", "limit", "surface", "is", "room");
    for limit in finished.limits.iter().chain(&finished.light) {
        let Margin { term, surface, value, .. } = limit;
        let (name, room) = (term.replace('_', " "), limit.room());
        let surface = surface.map_or_else(|| "-".to_owned(), |i| (i + 1).to_string());
        let _ = writeln!(text, "{name:<16} {surface:>8} {value:>12.4} {room:>12.4}");
    }
    text
}
