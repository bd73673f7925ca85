//! Invalid tasks and volumes: each is refused before any work, with the error, its place and the
//! valid values.

use super::cli::{Scratch, done, done_json, refused};
use aplanat::grin_design::{self, GrinOptimizer};
use serde_json::{Value, json};

/// The error with which a built-in task is refused after a value in it is replaced or removed.
fn refusal(name: &str, place: &str, value: Option<Value>) -> Option<String> {
    let task = grin_design::find_builtin(name).unwrap().task().unwrap();
    let mut task = serde_json::to_value(&task).unwrap();
    if let Some(value) = value {
        *task.pointer_mut(place).unwrap() = value;
    } else {
        let (parent, key) = place.rsplit_once('/').unwrap();
        task.pointer_mut(parent).unwrap().as_object_mut().unwrap().remove(key).unwrap();
    }
    match grin_design::read_task(&task.to_string(), "task.json") {
        Err(error) => Some(error.to_string()),
        Ok(task) => {
            let checked = task.check().and_then(|()| task.read_files());
            checked.and_then(|()| GrinOptimizer::new(&task)).err().map(|error| error.to_string())
        }
    }
}

/// A task, a place in it, what stands there instead, and the words that tell it.
type Row = (&'static str, &'static str, Value, &'static [&'static str]);

/// Errors of the field and its domain.
fn field() -> Vec<Row> {
    vec![
        ("luneburg", "/aplanat_grin", json!(2), &["aplanat_grin: found 2; expected 1"]),
        ("luneburg", "/aplanat_grin", json!(1.5), &["aplanat_grin", "1.5", "a whole number"]),
        ("luneburg", "/name", json!(null), &["name", "null", "a string"]),
        ("luneburg", "/field", json!(3), &["field", "`3`", "an object with one key"]),
        ("luneburg", "/field", json!({}), &["an object with one key"]),
        ("luneburg", "/field", json!({"cubic": 1}), &["field", "cubic", "`tricubic`"]),
        ("luneburg", "/field/trilinear", json!(1.1), &["field.trilinear", "{\"key\": ...}"]),
        ("luneburg", "/field/trilinear/half", json!(-1), &["field: found -1", "a length above 0"]),
        (
            "luneburg",
            "/field/trilinear/half",
            json!(1e300),
            &["field: found 1e300", "up to 1000000 mm"],
        ),
        (
            "luneburg",
            "/field/trilinear/half",
            json!(null),
            &["field.trilinear.half", "null", "a number"],
        ),
        ("luneburg", "/space/ball/radius", json!(0), &["space: found 0", "a length above 0"]),
        ("luneburg", "/space/ball/radius", json!("1"), &["space.ball.radius", "a number"]),
        (
            "fibre",
            "/space/rod/to",
            json!(-5),
            &["space", "from -1 to -5 mm", "beyond the beginning"],
        ),
        ("fibre", "/space/rod/to", json!(1e300), &["space, to", "1e300", "1000000 mm"]),
        ("luneburg", "/launch", json!(7), &["launch", "`7`"]),
    ]
}

/// Errors of the light.
fn light() -> Vec<Row> {
    vec![
        ("luneburg", "/views", json!([]), &["views: found none", "at least one"]),
        ("luneburg", "/views", json!({}), &["views", "a list"]),
        ("luneburg", "/views/0", json!(1), &["views[0]", "an object with its keys"]),
        (
            "luneburg",
            "/views/0/weight",
            json!(-1),
            &["number 0, weight: found -1", "a weight, 0 or more"],
        ),
        ("luneburg", "/views/0/weight", json!(0), &["no weight above 0"]),
        ("luneburg", "/views/0/source", json!("beam"), &["views[0].source"]),
        (
            "luneburg",
            "/views/0/source/parallel/rays",
            json!(0),
            &["source: found 0 rays", "1 to 10000000"],
        ),
        (
            "luneburg",
            "/views/0/source/parallel/rays",
            json!(-4),
            &["rays", "-4", "a whole number, 0 or more"],
        ),
        (
            "luneburg",
            "/views/0/source/parallel/radius",
            json!(0),
            &["source, radius: found 0", "a length"],
        ),
        (
            "luneburg",
            "/views/0/source/parallel/directions",
            json!({"given": [[0, 0, 0]]}),
            &["directions", "[0, 0, 0]", "not all 0"],
        ),
        ("luneburg", "/views/0/source/parallel/directions", json!({"given": []}), &["0 rays"]),
        (
            "luneburg",
            "/views/0/goal",
            json!({"point": [0, 1]}),
            &["views[0].goal.point", "length 2"],
        ),
        (
            "luneburg",
            "/views/0/goal",
            json!({"ring": {"radius": 1, "distance": 1, "angle": 1, "far": 1}}),
            &["goal", "`ring` for a source that is no beam"],
        ),
        (
            "caustic-far",
            "/views/0/goal/far/angle",
            json!(90),
            &["angle: found 90", "degrees from 0.1 to 80"],
        ),
        (
            "maxwell",
            "/views/0/source/points/cone",
            json!(-1),
            &["cone: found -1", "degrees from 0 to 89"],
        ),
    ]
}

/// Errors of target images.
fn pictures() -> Vec<Row> {
    vec![
        (
            "display",
            "/views/0/source",
            json!({"fan": {"height": 1, "z": -2, "rays": 3}}),
            &["`image` for a source that is no beam"],
        ),
        (
            "display",
            "/views/0/goal",
            json!("antipode"),
            &["`antipode` for a source that has no directions"],
        ),
        (
            "display",
            "/views/0/goal/image/pixels",
            json!(1),
            &["pixels: found 1", "pixels along a side, from 4 to 2048"],
        ),
        (
            "display",
            "/views/0/goal/image/distance",
            json!(-1),
            &["distance: found -1", "0 to 1000000 mm"],
        ),
        (
            "display",
            "/views/0/goal/image/drawing",
            json!({"scene": 2}),
            &["drawing, scene: found 2", "a depth from 0 to 1"],
        ),
        (
            "display",
            "/views/0/goal/image/drawing",
            json!({"file": "none.png"}),
            &["none.png", "cannot be read"],
        ),
        (
            "display",
            "/views/0/source/beam/direction",
            json!([0, 0, 0]),
            &["source, direction", "not all 0"],
        ),
    ]
}

/// Errors of the optimization.
fn search() -> Vec<Row> {
    vec![
        ("display", "/method", json!("lbfgs"), &["views, number 0, source, fresh", "only adam"]),
        (
            "luneburg",
            "/method",
            json!("lbfgs"),
            &["views, number 0, source, directions, fresh", "only adam"],
        ),
        (
            "luneburg",
            "/start/uniform",
            json!(0.5),
            &["start, uniform: found 0.5", "within the limits, from 1 to 2"],
        ),
        ("luneburg", "/start/uniform", json!(1e300), &["found 1e300"]),
        ("luneburg", "/start", json!({"volume": "none.npz"}), &["start: none.npz: cannot be read"]),
        ("luneburg", "/tolerance", json!(0), &["tolerance: found 0", "a length in mm above 0"]),
        ("luneburg", "/tolerance", json!("fine"), &["tolerance", "\"fine\"", "a number"]),
        ("luneburg", "/limits/low", json!(0.9), &["limits, low: found 0.9", "1 or more", "vacuum"]),
        ("luneburg", "/limits/high", json!(0.9), &["limits, high: found 0.9", "no less than 1"]),
        (
            "luneburg",
            "/limits/change",
            json!(0),
            &["limits, change: found 0", "a change of the index above 0"],
        ),
        (
            "luneburg",
            "/limits",
            json!({"slope": -1}),
            &["limits, slope: found -1", "1/mm, above 0"],
        ),
        (
            "luneburg",
            "/edge/index",
            json!(3),
            &["edge, index: found 3", "within the limits, from 1 to 2"],
        ),
        ("luneburg", "/edge/weight", json!(-1), &["edge, weight: found -1", "a weight"]),
        ("luneburg", "/method/adam/rate", json!(0), &["method, adam, rate: found 0", "a rate"]),
        (
            "luneburg",
            "/method/adam/fall",
            json!(-1),
            &["method, adam, fall: found -1", "a factor above 0"],
        ),
        ("luneburg", "/method", json!("newton"), &["method", "newton", "`least_squares`"]),
        ("luneburg", "/levels", json!([]), &["levels: found none"]),
        (
            "luneburg",
            "/levels/0/nodes",
            json!(1),
            &["levels, number 0, nodes: found 1", "2 to 513"],
        ),
        ("luneburg", "/levels/0/nodes", json!(2.5), &["levels[0].nodes", "a whole number"]),
        (
            "luneburg",
            "/exact/luneburg/radius",
            json!(-1),
            &["exact, luneburg, radius: found -1", "a length"],
        ),
        (
            "maxwell",
            "/exact/maxwell/centre",
            json!(0),
            &["exact, maxwell, centre: found 0", "an index above 0"],
        ),
        ("fibre", "/exact/secant/a", json!(0), &["exact, secant, a: found 0", "1/mm above 0"]),
    ]
}

#[test]
fn grin_every_invalid_value_of_a_task_has_its_own_message() {
    for (name, place, value, words) in [field(), light(), pictures(), search()].concat() {
        let found = refusal(name, place, Some(value.clone())).unwrap_or_default();
        let all = words.iter().all(|word| found.contains(word));
        assert!(all && found.len() < 300, "{name} {place} {value}: `{found}`, not {words:?}");
        let rust = ["struct", "variant", "usize", "f64", "u32", "JSON (", "000000000"];
        assert!(!rust.iter().any(|word| found.contains(word)), "{name} {place}: {found}");
    }
    for key in ["/name", "/field", "/space", "/views", "/tolerance", "/method", "/levels"] {
        let found = refusal("luneburg", key, None).unwrap();
        assert!(found.contains(&format!("no key `{}`", &key[1..])), "{found}");
    }
}

/// The error of a task that starts from a file with these bytes.
fn start(name: &str, bytes: &[u8], words: &[&str]) {
    let file = Scratch::new(name);
    std::fs::write(&file.0, bytes).unwrap();
    let mut task: Value = serde_json::from_str(&done(&["grin", "luneburg", "--show"], "")).unwrap();
    task["start"] = json!({"volume": file.path()});
    refused(2, &["grin", "-"], &task.to_string(), &[&["start", file.path()], words].concat());
}

#[test]
fn grin_impossible_volumes_are_refused_with_the_value_found() {
    start("empty.npz", b"", &["an empty file", ".npz", "PK"]);
    start("text.npz", b"hello there", &["`hello there`", "header of a volume"]);
    start("one.npz", b"\x93NUMPY\x01\x00", &["a single array of NumPy", ".npz"]);
    start("junk.npz", &[0xff, 0x00, 0x13], &["the bytes [ff, 00, 13]"]);
    start("archive.npz", b"PK\x03\x04junk", &["array index"]);
    let header = |counts: [usize; 3], data: &str| {
        json!({"aplanat_volume": 1, "counts": counts, "low": [-1.2, -1.2, -1.2],
            "spacing": [2.4, 2.4, 2.4], "numbers": "f64", "data": data})
        .to_string()
    };
    let raw = Scratch::new("numbers.raw");
    let data = raw.0.file_name().unwrap().to_str().unwrap();
    let numbers = |bytes: Vec<u8>, words: &[&str]| {
        std::fs::write(&raw.0, bytes).unwrap();
        start("header.json", header([2, 2, 2], data).as_bytes(), words);
    };
    numbers(1.1_f64.to_le_bytes().repeat(7), &["7 values for [2, 2, 2] nodes"]);
    numbers(vec![0; 61], &["61 bytes", "values of 8 bytes"]);
    numbers(f64::NAN.to_le_bytes().repeat(8), &["NaN at node [0, 0, 0]"]);
    numbers(0.9_f64.to_le_bytes().repeat(8), &["[0, 0, 0]", "0.9", "1 or more"]);
    numbers(1.1_f64.to_be_bytes().repeat(8), &["1 or more", "lowest byte first"]);
    numbers(2.5_f64.to_le_bytes().repeat(8), &["2.5", "1 to 2, the limits"]);
    start("zero.json", header([0, 2, 2], data).as_bytes(), &["8 values for [0, 2, 2]"]);
}

#[test]
fn grin_invalid_options_are_refused_before_any_work() {
    refused(2, &["grin", "fibre", "--out", "no/such/folder/a.npz"], "", &["no/such/folder"]);
    refused(2, &["grin", "fibre", "--minutes", "nan"], "", &["--minutes", "more than 0"]);
    refused(2, &["grin", "fibre", "--iterations", "-1"], "", &["-1"]);
    refused(2, &["grin", "display", "--lines"], "", &["display, --lines", "like"]);
    refused(2, &["grin", "there-is-none.json"], "", &["there-is-none.json", "cannot be read"]);
    refused(2, &["grin", "-"], "a text", &["standard input", "line 1"]);
    refused(2, &["grin", "-"], "", &["standard input", "the end of the file"]);
}

#[test]
fn grin_a_report_has_every_limit_and_every_file_and_no_infinite_number() {
    let header = Scratch::new("limits.json");
    let task = done(&["grin", "luneburg-radial", "--show"], "");
    let mut task: Value = serde_json::from_str(&task).unwrap();
    task["exact"] = json!({"secant": {"axis": 1.0, "a": 1e-30}});
    let arguments = ["grin", "-", "--iterations", "1", "--out", header.path(), "--nodes", "3"];
    let report = done_json(&arguments, &task.to_string());
    let raw = header.0.with_extension("raw");
    assert_eq!(report["files"], json!([header.path(), raw.to_str().unwrap()]));
    assert_eq!(report["error"]["of_contrast"], Value::Null);
    let limits = report["limits"].as_array().unwrap();
    assert!(limits.len() == 2 && limits.iter().all(|limit| limit["kept"] == true), "{limits:?}");
    assert_eq!(limits[1]["limit"], 2.0);
    let text = done(&arguments, &task.to_string());
    let words = ["lowest index", "limit 2: satisfied, margin", "nothing to find", ".raw", ".json"];
    assert!(words.iter().all(|word| text.contains(word)) && !text.contains("inf"), "{text}");
    std::fs::remove_file(raw).unwrap();
}
