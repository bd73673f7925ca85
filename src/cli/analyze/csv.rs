//! Results as CSV: a row for each number, with the field and the keys that lead to it. A number that is rounding
//! beside the largest of its kind is written as 0, which it means.

use crate::cli::output::without_rounding;
use serde_json::Value;
use std::collections::BTreeMap;

/// The numbers of a report as CSV with the columns `field_x`, `field_y`, `key`, `value`.
pub(super) fn csv(report: &Value) -> String {
    let fields = || report["fields"].as_array().into_iter().flatten();
    let places: Vec<String> =
        fields().map(|field| format!("{},{}", field["x"], field["y"])).collect();
    let mut rows = Vec::new();
    for (field, place) in fields().zip(&places) {
        let keys = field.as_object().into_iter().flatten();
        for (key, value) in keys.filter(|(key, _)| *key != "x" && *key != "y") {
            add(&mut rows, place, key, value);
        }
    }
    let mut scales: BTreeMap<String, f64> = BTreeMap::new();
    for Row { key, value, .. } in &rows {
        let is_alike = !key.split('.').any(|part| NOT_ALIKE.contains(&part));
        if let Some(number) = value.as_f64().filter(|_| is_alike) {
            let scale = scales.entry(kind(key)).or_default();
            *scale = scale.max(number.abs());
        }
    }
    let mut text = "field_x,field_y,key,value\r\n".to_owned();
    for Row { place, key, value } in &rows {
        let scale = scales.get(&kind(key)).copied().unwrap_or(0.0);
        text.extend([place, ",", key, ",", &cell(value, scale), "\r\n"]);
    }
    text
}

/// A number, a word or nothing, with the field and the keys that lead to it.
struct Row<'a> {
    place: &'a str,
    key: String,
    value: Value,
}

/// A number below this share of the largest of its kind is rounding: differences of such numbers have no more
/// digits.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The kind of a number by its key: the numbers of a list, and the coordinates of a point, are of one kind.
fn kind(key: &str) -> String {
    let part = |part: &str| {
        let is_index = part.bytes().all(|byte| byte.is_ascii_digit());
        let coordinate = part
            .strip_suffix(['x', 'y'])
            .filter(|rest| ["", "d", "p"].contains(rest) || rest.ends_with('_'));
        match part {
            _ if is_index => "#".to_owned(),
            "re" | "im" => "complex".to_owned(),
            part => coordinate.map_or_else(|| part.to_owned(), |rest| format!("{rest}#")),
        }
    };
    key.split('.').map(part).collect::<Vec<_>>().join(".")
}

/// Names of numbers of which a large one tells nothing about the rounding of the others.
const NOT_ALIKE: [&str; 3] = ["focal_length", "focus", "matrix"];

fn cell(value: &Value, scale: f64) -> String {
    match value {
        Value::String(words) => format!("\"{}\"", words.replace('"', "\"\"")),
        Value::Number(_)
            if value.as_f64().is_some_and(|v| v != 0.0 && v.abs() < ROUNDING * scale) =>
        {
            "0".to_owned()
        }
        Value::Null => String::new(),
        value => value.to_string(),
    }
}

fn add<'a>(rows: &mut Vec<Row<'a>>, place: &'a str, key: &str, value: &Value) {
    match value {
        Value::Object(keys) => {
            // A number that is nothing but its own rounding is 0.
            let number = |name: &str| keys.get(name).and_then(Value::as_f64);
            let shown = number("value").zip(number("error"));
            for (name, value) in keys {
                let rounded =
                    shown.filter(|_| name == "value").map(|(v, error)| without_rounding(v, error));
                let value =
                    rounded.filter(|v| *v == 0.0).map_or_else(|| value.clone(), |_| 0.into());
                add(rows, place, &format!("{key}.{name}"), &value);
            }
        }
        Value::Array(list) => list
            .iter()
            .enumerate()
            .for_each(|(i, value)| add(rows, place, &format!("{key}.{i}"), value)),
        value => rows.push(Row { place, key: key.to_owned(), value: value.clone() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_number_has_a_row() {
        let report = json!({"fields": [{"x": 0.0, "y": 7.5, "rms": {"value": 0.5, "error": null},
            "list": [true, "a \"b\""]}]});
        let expected = "field_x,field_y,key,value\r\n0.0,7.5,list.0,true\r\n\
            0.0,7.5,list.1,\"a \"\"b\"\"\"\r\n0.0,7.5,rms.error,\r\n0.0,7.5,rms.value,0.5\r\n";
        assert_eq!(csv(&report), expected);
    }

    /// A coordinate that symmetry makes 0 but for rounding is 0, beside the other coordinate or its own error; small numbers that
    /// mean something stay.
    #[test]
    fn rounding_is_written_as_zero() {
        let report = json!({"fields": [{"x": 0.0, "y": 7.0,
            "points": [{"x": -3.8e-18, "y": 0.02}, {"x": 1e-9, "y": -0.01}],
            "centroid_x": {"value": -3.8e-18, "error": 2e-15, "rays": 40},
            "rms": {"value": 2e-18, "error": 1e-20, "rays": 40},
            "ghosts": [{"focal_length": 1e17}, {"focal_length": 100.0}],
            "fates": {"imaged": 0, "missed": 3}}]});
        let rows = csv(&report);
        for row in [
            "points.0.x,0\r\n",
            "points.1.x,1e-9\r\n",
            "points.0.y,0.02\r\n",
            "centroid_x.value,0\r\n",
            "centroid_x.error,2e-15\r\n",
            "rms.value,2e-18\r\n",
            "ghosts.1.focal_length,100.0\r\n",
            "fates.imaged,0\r\n",
        ] {
            assert!(rows.contains(row), "{row} in {rows}");
        }
    }
}
