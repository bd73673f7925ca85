//! What holds for any lens, checked on every lens of the library.

mod derivatives;
mod errors;
mod files;
mod images;
mod light;
mod symmetry;

use aplanat::analysis::{Estimate, pupil};
use aplanat::files::library_lenses;
use aplanat::lens::{FieldPoint, Lens, at_zoom};
use aplanat::pupil::{Accuracy, RayModel};
use rayon::prelude::*;
use std::error::Error;
use std::sync::LazyLock;

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-3, max_rays: 200_000 };
/// Enough for what is the same to rounding, or within its stated error, at any accuracy.
const ROUGH: Accuracy = Accuracy { tolerance: 1e-2, max_rays: 20_000 };

/// What a check of a lens found wrong.
type Verdict = Result<(), String>;

/// A lens of the library at its last zoom position.
struct LensCase {
    name: &'static str,
    lens: Lens,
    /// Its model, with the fields that have light.
    model: RayModel,
}

static CASES: LazyLock<Vec<LensCase>> = LazyLock::new(|| {
    let case = |entry: &'static aplanat::files::LibraryLens| {
        let lens = entry.open().unwrap();
        let lens = at_zoom(&lens, lens.zoom_positions() - 1);
        let mut model = RayModel::from_lens(&lens, 0).unwrap();
        let lit = |field: &FieldPoint| pupil(&model, *field, model.primary, ACCURACY).extent;
        let fields: Vec<_> = model.fields.iter().copied().filter(|f| lit(f).is_some()).collect();
        // The edge of the field of this lens is dark where it focuses on what is near.
        assert!(fields.len() == model.fields.len() || entry.name == "macro_micro_nikkor_105_f28");
        model.fields = fields;
        LensCase { name: &entry.name, lens, model }
    };
    library_lenses().par_iter().map(case).collect()
});

/// Checks every lens on all threads; tells everything that is wrong, or returns what the checks do.
fn check_every_lens<T: Send>(
    check: impl Fn(&Lens, &RayModel) -> Result<T, String> + Sync,
) -> Vec<T> {
    let check = |case: &LensCase| {
        check(&case.lens, &case.model).map_err(|why| format!("{}: {why}", case.name))
    };
    let results: Vec<_> = CASES.par_iter().map(check).collect();
    assert_eq!(results.len(), 188);
    let wrong: Vec<&str> =
        results.iter().filter_map(|r| r.as_ref().err()).map(String::as_str).collect();
    assert!(wrong.is_empty(), "{} lenses:\n{}", wrong.len(), wrong.join("\n"));
    results.into_iter().flatten().collect()
}

fn ensure(holds: bool, what: impl FnOnce() -> String) -> Verdict {
    if holds { Ok(()) } else { Err(what()) }
}

/// The edge of the field.
fn edge(model: &RayModel) -> FieldPoint {
    *model.fields.iter().max_by(|a, b| a.y.abs().total_cmp(&b.y.abs())).unwrap()
}

/// Two numbers that are the same within their stated errors.
fn alike(what: &str, a: Estimate, b: Estimate) -> Verdict {
    let error = a.error + b.error;
    let same = (a.value - b.value).abs() <= error;
    ensure(same, || format!("{what}: {} and {} ± {error:e}", a.value, b.value))
}

fn near(what: &str, a: f64, b: f64, error: f64) -> Verdict {
    ensure((a - b).abs() <= error, || format!("{what}: {a} and {b}, {:e}", a - b))
}

fn text(error: impl Into<Box<dyn Error>>) -> String {
    error.into().to_string()
}
