//! The caption of a drawn result: the errors, the rays and the time of the numbers of each field.

use crate::cli::output::{ShortNumber, counted};
use serde_json::Value;

/// The units as they follow a number: that of the fields, and that of an error by the key of its number, the empty
/// key for an error of all numbers.
#[derive(Clone, Copy)]
pub(super) struct CaptionUnits {
    pub(super) field: &'static str,
    pub(super) error: fn(&str) -> &'static str,
}

/// A sentence for each field with light of a report: the largest error of each kind of number, and the rays and the
/// milliseconds, of the number that takes most of them where they differ.
pub(super) fn caption(report: &Value, units: CaptionUnits) -> Vec<String> {
    report["fields"].as_array().into_iter().flatten().filter_map(|f| sentence(f, units)).collect()
}

/// The errors by their names, the rays and the milliseconds of a field.
#[derive(Default)]
struct FieldCosts {
    errors: Vec<NamedError>,
    rays: CostRange,
    ms: CostRange,
}

/// The largest error of the numbers of a name.
struct NamedError {
    name: String,
    /// The key of the numbers; empty for an error of all numbers.
    key: String,
    /// `None` if one of them is not known.
    largest: Option<f64>,
}

/// The least and the most of a cost; `None` where nothing has any.
#[derive(Default)]
struct CostRange(Option<[f64; 2]>);

impl CostRange {
    /// Takes a cost into account, unless it is none.
    fn note(&mut self, value: &Value) {
        let Some(cost) = value.as_f64().filter(|cost| *cost > 0.0) else { return };
        let [least, most] = self.0.unwrap_or([cost; 2]);
        self.0 = Some([least.min(cost), most.max(cost)]);
    }

    /// The cost in words: the most of it where it differs.
    fn words(&self, words: impl Fn(f64) -> String) -> Option<String> {
        let [least, most] = self.0?;
        Some(if least < most { format!("up to {}", words(most)) } else { words(most) })
    }
}

impl NamedError {
    fn words(&self, units: CaptionUnits) -> String {
        let unit = (units.error)(&self.key);
        match (self.key.is_empty(), self.largest) {
            (true, Some(error)) => format!("error {error:.1e}{unit}"),
            (true, None) => "error unknown".to_owned(),
            (false, Some(error)) => format!("{} ± {error:.1e}{unit}", self.name),
            (false, None) => format!("{} of unknown error", self.name),
        }
    }
}

fn sentence(field: &Value, units: CaptionUnits) -> Option<String> {
    let mut costs = FieldCosts::default();
    costs.gather(field, &[]);
    if costs.rays.0.is_none() && costs.errors.is_empty() {
        return None;
    }
    let unit = units.field;
    let place = |key: &str| field[key].as_f64().unwrap_or(0.0);
    let (x, y) = (place("x"), ShortNumber(place("y")));
    let across = if x == 0.0 { String::new() } else { format!("x {}{unit}, ", ShortNumber(x)) };
    let errors = costs.errors.iter().map(|error| error.words(units));
    let rays = costs.rays.words(|rays| counted(rays as usize, "ray"));
    let ms = costs.ms.words(|ms| format!("{ms:.2} ms"));
    let facts: Vec<String> = errors.chain(rays).chain(ms).collect();
    Some(format!("{across}y {y}{unit}: {}", facts.join(", ")))
}

impl FieldCosts {
    /// Adds what stands in a value; `path` leads to it.
    fn gather(&mut self, value: &Value, path: &[&str]) {
        match value {
            Value::Array(list) => list.iter().for_each(|value| self.gather(value, path)),
            Value::Object(keys) => {
                for (key, value) in keys {
                    match key.as_str() {
                        "error" => self.error(path, value),
                        "rays" => self.rays.note(value),
                        "milliseconds" => self.ms.note(value),
                        // A decision has no place among the numbers.
                        "gate" => {}
                        key => self.gather(value, &[path, &[key]].concat()),
                    }
                }
            }
            _ => {}
        }
    }

    /// Keeps the largest error of a name: the first and the last key of its path.
    fn error(&mut self, path: &[&str], value: &Value) {
        let name = match path {
            [] => String::new(),
            [only] => (*only).to_owned(),
            [first, .., last] => format!("{first} {last}"),
        };
        let key = path.last().copied().unwrap_or_default().to_owned();
        let (name, error) = (name.replace('_', " "), value.as_f64());
        match self.errors.iter_mut().find(|known| known.name == name) {
            Some(known) => known.largest = known.largest.zip(error).map(|(a, b)| a.max(b)),
            None => self.errors.push(NamedError { name, key, largest: error }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_field_has_its_largest_errors_its_rays_and_its_time() {
        let estimate = |error: f64, rays: usize| json!({"value": 1.0, "error": error, "rays": rays, "milliseconds": 2.5});
        let report = json!({"fields": [
            {"x": 0.0, "y": 14.0, "rms": estimate(1e-3, 40),
             "colors": [{"um": 0.5, "lit_area": estimate(1e-5, 60)}, {"um": 0.6, "lit_area": estimate(2e-5, 50)}]},
            {"x": 0.0, "y": 20.0, "dark": "no light"},
            {"x": 3.0, "y": 0.0, "error": null, "rays": 7, "milliseconds": 0.125},
            {"x": 0.0, "y": 1.0, "error": 2e-16, "rays": 0, "milliseconds": 0.5},
        ]});
        let expected = [
            "y 14 deg: colors lit area ± 2.0e-5, rms ± 1.0e-3 mm, up to 60 rays, 2.50 ms",
            "x 3 deg, y 0 deg: error unknown, 7 rays, 0.12 ms",
            "y 1 deg: error 2.0e-16 mm, 0.50 ms",
        ];
        let error = |key: &str| if key == "lit_area" { "" } else { " mm" };
        assert_eq!(caption(&report, CaptionUnits { field: " deg", error }), expected);
    }
}
