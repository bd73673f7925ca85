//! The lenses, rays and perturbations of `tolerances.json`.

use crate::cli::{Scratch, aplanat, done_json};
use crate::reference::{count, number, read};
use aplanat::lens::{ErrorDistribution, Perturbation, PerturbationKind, Tolerance};
use aplanat::measure::ReferenceLens;
use aplanat::tolerance::{Beam, MeritOptions, NominalLens};
use aplanat::trace::Ray;
use serde_json::Value;

/// A lens of the file.
pub(super) struct ToleranceCase {
    pub(super) data: Value,
    lens: ReferenceLens,
}

/// The four rays of `base` and `derivatives`: field and pupil point.
pub(super) const RAYS: [(usize, [f64; 2]); 4] =
    [(0, [0.0, 0.0]), (0, [0.0, 1.0]), (1, [0.6, -0.7]), (2, [-0.8, 0.5])];

/// Every lens of the file.
pub(super) fn lenses() -> Vec<ToleranceCase> {
    let file = read("tolerances.json");
    let lenses = file["lenses"].as_array().unwrap();
    let case = |data: &Value| ToleranceCase {
        data: data.clone(),
        lens: serde_json::from_value(data.clone()).unwrap(),
    };
    lenses.iter().map(case).collect()
}

/// The kind of a name of the file.
pub(super) fn kind(name: &Value) -> PerturbationKind {
    serde_json::from_value(name.clone()).unwrap()
}

/// A perturbation of the file.
pub(super) fn perturbation(data: &Value) -> Perturbation {
    Perturbation {
        kind: kind(&data["kind"]),
        first: count(&data["first"]),
        last: count(&data["last"]),
    }
}

/// A perturbation of the file with its value.
pub(super) fn valued(data: &Value) -> (Perturbation, f64) {
    (perturbation(data), number(&data["value"]))
}

impl ToleranceCase {
    pub(super) fn id(&self) -> &str {
        self.data["id"].as_str().unwrap()
    }

    pub(super) fn primary(&self) -> usize {
        count(&self.data["primary"])
    }

    pub(super) fn nominal(&self) -> NominalLens {
        self.lens.nominal()
    }

    pub(super) fn options(&self) -> MeritOptions {
        self.lens.options()
    }

    /// A ray of the file, and its optical path up to its start.
    pub(super) fn ray(&self, field: usize, pupil: [f64; 2]) -> (Ray<f64>, f64) {
        self.lens.ray(field, pupil)
    }

    /// Rays through the pupil: Gauss-Legendre rings in r² times azimuths at half steps.
    pub(super) fn beam(&self, rings: usize, azimuths: usize) -> Beam {
        self.lens.beam((rings, azimuths))
    }
}

/// The tolerances of `as_built`, all with this distribution.
pub(super) fn tolerances(lens: &ToleranceCase, distribution: ErrorDistribution) -> Vec<Tolerance> {
    let all = lens.data["as_built"]["tolerances"].as_array().unwrap().iter();
    let tolerance = |data: &Value| Tolerance {
        error: perturbation(data),
        half_range: number(&data["half_range"]),
        distribution,
    };
    all.map(tolerance).collect()
}

/// Checks that two numbers agree within an absolute tolerance; NaN does not.
pub(super) fn assert_close(found: f64, expected: f64, tolerance: f64, what: &str) {
    let apart = (found - expected).abs();
    assert!(apart <= tolerance, "{what}: {found:e}, expected {expected:e} within {tolerance:e}");
}

/// The agreement is printed by the program: of the triplet with few of its answers it holds, and a wrong answer is
/// found.
#[test]
fn the_program_compares_itself_with_exact_answers() {
    let mut file = read("tolerances.json");
    let lenses = file["lenses"].as_array_mut().unwrap();
    lenses.truncate(1);
    for (list, count) in [("derivatives", 4), ("cases", 1), ("exact", 1)] {
        lenses[0][list].as_array_mut().unwrap().truncate(count);
    }
    let written = |file: &Value| {
        let text = serde_json::to_string(file).unwrap();
        Scratch::with("some_tolerances.json", &text)
    };
    let measure = |path: &Scratch| {
        vec!["measure".to_owned(), "tolerance".into(), "--reference".into(), path.path().into()]
    };
    let few = ["--samples", "40"].map(str::to_owned);
    let right = written(&file);
    let arguments: Vec<String> = measure(&right).into_iter().chain(few.clone()).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let json = done_json(&arguments, "");
    let rows = json["lenses"][0]["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 6, "{json}");
    for row in rows {
        assert!(count(&row["answers"]) > 3, "{row}");
        assert!(number(&row["largest"]) <= number(&row["bound"]), "{row}");
    }
    let first = &mut file["lenses"][0]["derivatives"][1]["mean"][0];
    *first = (number(first) * (1.0 + 1e-6)).into();
    let wrong = written(&file);
    let arguments: Vec<String> = measure(&wrong).into_iter().chain(few).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let output = aplanat(&arguments, "");
    let [table, error] =
        [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert_eq!(table.matches("broken").count(), 2, "{table}");
    assert!(error.contains("answers differ by more than their bounds"), "{error}");
}

/// A file of exact answers whose lists are too short, or count what is not there, is refused by name.
#[test]
fn a_file_of_exact_answers_is_checked() {
    let mut file = read("tolerances.json");
    file["lenses"].as_array_mut().unwrap().truncate(1);
    let refused = |change: &dyn Fn(&mut Value)| {
        let mut file = file.clone();
        change(&mut file["lenses"][0]);
        let text = serde_json::to_string(&file).unwrap();
        let scratch = Scratch::with("short_tolerances.json", &text);
        let output = aplanat(&["measure", "tolerance", "--reference", scratch.path()], "");
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8(output.stderr).unwrap()
    };
    let cut = |list: &mut Value| {
        list.as_array_mut().unwrap().pop();
    };
    for (what, change) in [
        (
            "n: found",
            &(|lens: &mut Value| cut(&mut lens["surfaces"][1]["n"])) as &dyn Fn(&mut Value),
        ),
        ("primary: found 9", &|lens| lens["primary"] = 9.into()),
        ("wavelength_weights: found", &|lens| cut(&mut lens["wavelength_weights"])),
        ("mean_square: found", &|lens| cut(&mut lens["derivatives"][0]["mean_square"])),
        ("merits: found", &|lens| cut(&mut lens["cases"][0]["merits"]["msc"])),
        ("wavelength of a ray: found 7", &|lens| {
            lens["cases"][0]["rays"][0]["wavelength"] = 7.into();
        }),
    ] {
        let text = refused(change);
        assert!(text.contains("cooke_triplet_100: ") && text.contains(what), "{text}");
    }
}
