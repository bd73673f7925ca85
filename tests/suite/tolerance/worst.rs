//! The worst of the lenses with random errors as a file of its own.

use crate::cli::{Scratch, done, done_json};
use aplanat::files;

/// The rays of the lens as designed have the spot in the written lens that was stated for it, but for what
/// a model glass lacks of the dispersion.
#[test]
fn the_worst_lens_is_written_with_the_spot_that_is_stated() {
    let worst = Scratch::new("worst_lens.json");
    let lens = "lenses/cooke_triplet_100_f27.json";
    let few = ["tolerance", lens, "--samples", "12", "--error", "1%", "--worst", worst.path()];
    let json = done_json(&few, "");
    let [stated, written] = ["rms", "written_rms"].map(|key| json["worst"][key].as_f64().unwrap());
    assert!((written / stated - 1.0).abs() < 0.02, "{stated} {written}");
    let text = std::fs::read_to_string(worst.path()).unwrap();
    let made = files::parse(text.as_bytes(), "worst").unwrap().lens;
    assert!(made.name.ends_with("worst of 12") && made.tolerances.is_none());
    assert!(done(&["info", worst.path()], "").contains("worst of 12"));
    // Any analysis shows the number that was stated, and the lens has tolerances of its own.
    let spots = done_json(&["analyze", worst.path(), "spot"], "");
    let fields = spots["fields"].as_array().unwrap();
    let weights: Vec<f64> = made.fields.values.iter().map(|field| field.weight).collect();
    assert_eq!((fields.len(), weights.len()), (5, 5));
    let square = |field: &serde_json::Value| field["rms"]["value"].as_f64().unwrap().powi(2);
    let sum: f64 = fields.iter().zip(&weights).map(|(field, weight)| weight * square(field)).sum();
    let shown = (sum / weights.iter().sum::<f64>()).sqrt();
    assert!((shown / written - 1.0).abs() < 2e-3, "{shown} {written}");
    let again = ["tolerance", worst.path(), "--samples", "4", "--error", "10%"];
    let again = done_json(&again, "");
    let designed = again["spots"][0]["nominal_rms"].as_f64().unwrap();
    assert!((designed / written - 1.0).abs() < 0.05, "{designed} {written}");
    assert!(again["pupils"]["reason"].to_string().contains("decentred"), "{}", again["pupils"]);
}
