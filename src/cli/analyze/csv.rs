//! Results as CSV: a row for each number, with the field and the keys that lead to it.

use serde_json::Value;

/// The numbers of a report as CSV with the columns `field_x`, `field_y`, `key`, `value`.
pub(super) fn csv(report: &Value) -> String {
    let mut text = "field_x,field_y,key,value\r\n".to_owned();
    for field in report["fields"].as_array().into_iter().flatten() {
        let place = format!("{},{}", field["x"], field["y"]);
        let keys = field.as_object().into_iter().flatten();
        for (key, value) in keys.filter(|(key, _)| *key != "x" && *key != "y") {
            add(&mut text, &place, key, value);
        }
    }
    text
}

fn add(text: &mut String, place: &str, key: &str, value: &Value) {
    match value {
        Value::Object(keys) => {
            keys.iter().for_each(|(name, value)| add(text, place, &format!("{key}.{name}"), value));
        }
        Value::Array(list) => list
            .iter()
            .enumerate()
            .for_each(|(i, value)| add(text, place, &format!("{key}.{i}"), value)),
        Value::String(words) => {
            let words = words.replace('"', "\"\"");
            text.extend([place, ",", key, ",\"", &words, "\"\r\n"]);
        }
        Value::Null => text.extend([place, ",", key, ",\r\n"]),
        Value::Bool(_) | Value::Number(_) => {
            text.extend([place, ",", key, ",", &value.to_string(), "\r\n"]);
        }
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
}
