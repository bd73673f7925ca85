//! The worst of the lenses with random errors as a file of its own.

use crate::cli::{Scratch, done, done_json};
use aplanat::files;

/// The rays of the lens as designed have the spot in the written lens that was stated for it, but for what
/// a model glass lacks of the dispersion.
#[test]
fn the_worst_lens_is_written_with_the_spot_that_is_stated() {
    let worst = Scratch::new("worst_lens.json");
    let lens = "lenses/cooke_triplet_100_f27.json";
    let few = ["tolerance", lens, "--samples", "12", "--error", "10%", "--worst", worst.path()];
    let json = done_json(&few, "");
    let [stated, written] = ["rms", "written_rms"].map(|key| json["worst"][key].as_f64().unwrap());
    assert!((written / stated - 1.0).abs() < 0.02, "{stated} {written}");
    let text = std::fs::read_to_string(worst.path()).unwrap();
    let made = files::parse(text.as_bytes(), "worst").unwrap().lens;
    assert!(made.name.ends_with("worst of 12") && made.tolerances.is_none());
    assert!(done(&["info", worst.path()], "").contains("worst of 12"));
}
