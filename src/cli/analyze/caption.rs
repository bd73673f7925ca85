//! The caption of a drawn result: the errors, the rays and the time of the numbers of each field.

use crate::cli::output::ShortNumber;
use serde_json::Value;

/// A sentence for each field with light of a report: the largest error of each kind of number in the unit of
/// the printed table, the rays of the number that takes most of them, and milliseconds.
pub(super) fn caption(report: &Value, unit: &str) -> Vec<String> {
    report["fields"].as_array().into_iter().flatten().filter_map(|f| sentence(f, unit)).collect()
}

/// The errors by their names, the rays and the milliseconds of a field.
#[derive(Default)]
struct FieldCosts {
    /// The largest error of each name; `None` if one is not known.
    errors: Vec<(String, Option<f64>)>,
    rays: u64,
    ms: f64,
}

fn sentence(field: &Value, unit: &str) -> Option<String> {
    let mut costs = FieldCosts::default();
    costs.gather(field, &[]);
    if costs.rays == 0 && costs.errors.is_empty() {
        return None;
    }
    let place = |key: &str| field[key].as_f64().unwrap_or(0.0);
    let (x, y) = (place("x"), ShortNumber(place("y")));
    let across = if x == 0.0 { String::new() } else { format!("x {}{unit}, ", ShortNumber(x)) };
    let error = |(name, error): &(String, Option<f64>)| match error {
        Some(error) => format!("{name} ± {error:.1e}"),
        None => format!("{name} of unknown error"),
    };
    let errors = costs.errors.iter().map(error);
    let work = [format!("{} rays", costs.rays), format!("{:.2} ms", costs.ms)];
    let facts: Vec<String> = errors.chain(work).collect();
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
                        "rays" => self.rays = self.rays.max(value.as_u64().unwrap_or(0)),
                        "milliseconds" => self.ms = self.ms.max(value.as_f64().unwrap_or(0.0)),
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
            [] => "all".to_owned(),
            [only] => (*only).to_owned(),
            [first, .., last] => format!("{first} {last}"),
        };
        let (name, error) = (name.replace('_', " "), value.as_f64());
        match self.errors.iter_mut().find(|(known, _)| *known == name) {
            Some((_, largest)) => *largest = largest.zip(error).map(|(a, b)| a.max(b)),
            None => self.errors.push((name, error)),
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
        ]});
        let expected = [
            "y 14 deg: colors lit area ± 2.0e-5, rms ± 1.0e-3, 60 rays, 2.50 ms",
            "x 3 deg, y 0 deg: all of unknown error, 7 rays, 0.12 ms",
        ];
        assert_eq!(caption(&report, " deg"), expected);
    }
}
