//! What a command does when something fails on its way: the result is still saved where it can be
//! and printed, a checkpoint has one writer, and every request to end saves what was found.

use super::cli::{done_json, has_keys, refused};
use super::cli_files::Folder;
use aplanat::search::design::{DesignRun, DesignSettings, LensRequirements};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

const LENS: &str = "lenses/cooke_triplet_100_f27.json";
const SINGLET: &str = "lenses/singlet_la1131.json";
const ZOOM: &str = "lenses/zoom_nikkor_28_80.json";

/// A command that runs while the test goes on.
struct Running(Option<Child>);

impl Running {
    /// Starts the program with the end of the terminal as a request to end, which `nohup` around the
    /// tests would have it ignore.
    fn start(arguments: &[&str]) -> Self {
        let program = env!("CARGO_BIN_EXE_aplanat");
        if cfg!(target_os = "linux") {
            let start = ["--default-signal=HUP", program];
            Self::of(Command::new("env").args(start).args(arguments))
        } else {
            Self::of(Command::new(program).args(arguments))
        }
    }

    fn of(command: &mut Command) -> Self {
        let command = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(Some(command.spawn().unwrap()))
    }

    fn id(&self) -> String {
        self.0.as_ref().unwrap().id().to_string()
    }

    fn signal(&self, name: &str) {
        assert!(Command::new("kill").args([name, &self.id()]).status().unwrap().success());
    }

    fn output(mut self) -> Output {
        self.0.take().unwrap().wait_with_output().unwrap()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            drop(child.kill());
            drop(child.wait());
        }
    }
}

/// Waits until a file exists, and then a little longer.
fn wait_for(path: &str) {
    let exists = |_: &u32| !Path::new(path).exists();
    (0..600).take_while(exists).for_each(|_| std::thread::sleep(Duration::from_millis(100)));
    assert!(Path::new(path).exists(), "{path}");
    std::thread::sleep(Duration::from_millis(300));
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A search that takes a while and is saved after every round.
fn long_search(checkpoint: &str, more: &[&str]) -> Vec<String> {
    let base = ["search", LENS, "--iterations", "100000000", "--chains", "1", "--checkpoint"];
    let all = [&base[..], &[checkpoint, "--checkpoint-every", "0", "--json"], more].concat();
    all.into_iter().map(str::to_owned).collect()
}

fn start_search(checkpoint: &str, more: &[&str]) -> Running {
    let arguments = long_search(checkpoint, more);
    let running = Running::start(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    wait_for(checkpoint);
    running
}

/// The search goes on without its checkpoint, says so once, and ends with its result.
#[cfg(unix)]
#[test]
fn a_search_survives_the_loss_of_its_checkpoint() {
    let (lost, kept) = (Folder::new("lost"), Folder::new("kept"));
    let (checkpoint, out) = (lost.path("sub/run.json"), kept.path("best.json"));
    fs::create_dir(lost.path("sub")).unwrap();
    let running = start_search(&checkpoint, &["--out", &out]);
    fs::rename(lost.path("sub"), lost.path("moved")).unwrap();
    std::thread::sleep(Duration::from_secs(1));
    running.signal("-INT");
    let output = running.output();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert_eq!(said.matches("the search goes on").count(), 1, "{said}");
    assert!(said.contains("error: ") && said.contains("run.json: cannot be written"), "{said}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&report["ended"], &report["out"]), (&"interrupted".into(), &out.into()));
    has_keys(&done_json(&["info", &kept.path("best.json")], ""), &["efl"]);
}

/// A checkpoint that can be written again is.
#[cfg(unix)]
#[test]
fn a_checkpoint_is_tried_again() {
    let folder = Folder::new("again");
    let checkpoint = folder.path("sub/run.json");
    fs::create_dir(folder.path("sub")).unwrap();
    let running = start_search(&checkpoint, &[]);
    fs::rename(folder.path("sub"), folder.path("moved")).unwrap();
    std::thread::sleep(Duration::from_millis(500));
    fs::create_dir(folder.path("sub")).unwrap();
    wait_for(&checkpoint);
    running.signal("-INT");
    let output = running.output();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

/// A lens that cannot be saved is printed.
#[cfg(unix)]
#[test]
fn a_lens_that_cannot_be_saved_is_printed() {
    let (lost, kept) = (Folder::new("lost-out"), Folder::new("kept-run"));
    fs::create_dir(lost.path("sub")).unwrap();
    let out = lost.path("sub/best.json");
    let running = start_search(&kept.path("run.json"), &["--out", &out]);
    fs::rename(lost.path("sub"), lost.path("moved")).unwrap();
    running.signal("-INT");
    let output = running.output();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["out"], Value::Null);
    let lens = kept.file("printed.json", &report["lens"].to_string());
    has_keys(&done_json(&["info", &lens], ""), &["efl"]);
}

/// A field that cannot be saved is printed.
#[cfg(unix)]
#[test]
fn a_field_that_cannot_be_saved_is_printed() {
    let folder = Folder::new("lost-field");
    fs::create_dir(folder.path("sub")).unwrap();
    let out = folder.path("sub/field.npz");
    let running = Running::start(&[
        "grin",
        "luneburg",
        "--nodes",
        "5",
        "--iterations",
        "1000000",
        "--out",
        &out,
        "--json",
    ]);
    std::thread::sleep(Duration::from_millis(300));
    fs::rename(folder.path("sub"), folder.path("moved")).unwrap();
    running.signal("-INT");
    let output = running.output();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("field.npz: cannot be written"), "{said}");
    let field = &serde_json::from_slice::<Value>(&output.stdout).unwrap()["field"];
    assert_eq!(field["counts"], json!([5, 5, 5]));
    let index = field["index"].as_array().unwrap();
    assert!(index.len() == 125 && index.iter().all(|n| n.as_f64().unwrap() >= 1.0), "{field}");
}

/// Makes a file that cannot be replaced.
#[cfg(unix)]
fn protect(path: &str) {
    fs::write(path, "").unwrap();
    let mut permissions = fs::metadata(path).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(path, permissions).unwrap();
}

fn failed_json(arguments: &[&str], words: &[&str]) -> Value {
    let output = Running::start(&[arguments, &["--json"]].concat()).output();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(words.iter().all(|word| said.contains(word)), "{said}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Images are rendered until their error is small, and state it with their rays and their time.
#[test]
fn images_of_a_grin_task_state_their_error() {
    let folder = Folder::new("grin-images");
    let grin = ["grin", "caustic-near", "--iterations", "1", "--png", &folder.path("")];
    let report = done_json(&grin, "");
    assert_eq!(report["files"].as_array().unwrap().len(), 3, "{report}");
    let [image] = &report["images"].as_array().unwrap()[..] else { panic!("{report}") };
    has_keys(image, &["view", "quality_db", "correlation", "light", "lost", "beside", "ms"]);
    assert!(image["error"].as_f64().unwrap() <= 0.02 && image["reached"] == true, "{image}");
    let rays = image["rays"].as_u64().unwrap();
    let [light, off] = [0, 1].map(|i| image["light"][i].as_f64().unwrap());
    let beside = image["beside"].as_u64().unwrap() as f64 / rays as f64;
    assert!((light + beside - 1.0).abs() < 1e-9 && off < 0.01, "{image}");
}

/// The lenses of a front that cannot be saved are printed; lenses of a reservoir and images that
/// could be saved are the result of this run, not of an earlier one.
#[cfg(unix)]
#[test]
fn a_folder_that_cannot_be_filled_loses_no_lens() {
    let folder = Folder::new("half-full");
    let all = folder.path("");
    protect(&folder.path("front_001.json"));
    let grin = ["grin", "luneburg", "--iterations", "2", "--png", &all];
    protect(&folder.path("section.png"));
    let report = failed_json(&grin, &["section.png"]);
    assert_eq!(report["files"], json!([folder.path("profile.png")]));
    assert_eq!(report["stale"], json!([folder.path("section.png")]));
    let front = ["pareto", LENS, "--points", "2", "--steps", "2", "--no-biased", "--error", "1%"];
    let report = failed_json(&[&front[..], &["--out", &all]].concat(), &["front_001.json"]);
    let lenses = report["lenses"].as_array().unwrap();
    assert_eq!(lenses.len(), report["front"].as_array().unwrap().len());
    let printed = folder.file("printed.json", &lenses[0].to_string());
    has_keys(&done_json(&["info", &printed], ""), &["efl"]);
    let search = ["search", LENS, "--iterations", "8", "--reservoir-dir", &all];
    let files = done_json(&search, "")["files"].as_array().unwrap().clone();
    let [kept, .., lost] = files.iter().map(|file| file.as_str().unwrap()).collect::<Vec<_>>()[..]
    else {
        panic!("{files:?}");
    };
    protect(lost);
    let report = failed_json(&search, &[lost]);
    assert_eq!(report["files"][0], kept);
    assert!(!report["stale"].to_string().contains(kept), "{report}");
}

/// A command whose files take no bytes, as on a full disk.
#[cfg(target_os = "linux")]
fn on_a_full_disk(arguments: &[&str]) -> Value {
    // Without the signal, a write beyond the limit on the size of files fails.
    let limited = "trap '' 25; ulimit -f 0; exec \"$@\"";
    let mut command = Command::new("sh");
    command.args(["-c", limited, "sh", env!("CARGO_BIN_EXE_aplanat")]).args(arguments);
    let output = Running::of(command.arg("--json")).output();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("cannot be written"), "{said}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_loses_no_result() {
    let folder = Folder::new("full-disk");
    let (table, out) = (folder.path("table.csv"), folder.path("out.json"));
    let spots = on_a_full_disk(&["analyze", SINGLET, "spot", "--error", "1%", "--csv", &table]);
    assert!(spots["fields"][0]["rms"]["value"].as_f64().unwrap() > 0.0, "{spots}");
    let made = on_a_full_disk(&["tolerance", SINGLET, "--samples", "4", "--csv", &table]);
    assert_eq!(made["samples"], 4);
    let best = ["optimize", SINGLET, "--vary", "curvatures", "--steps", "1", "--out", &out];
    assert!(on_a_full_disk(&best)["lens"].is_object());
    let history = folder.path("history.json");
    let best = on_a_full_disk(&[&best[..], &["--history", &history]].concat());
    assert_eq!(best["history"].as_array().unwrap().len(), 1, "{best}");
    let field = on_a_full_disk(&["grin", "luneburg", "--iterations", "1", "--out", &out]);
    assert!(field["field"]["index"].is_array());
    let all = folder.path("");
    let search = ["search", LENS, "--iterations", "4", "--reservoir-dir", &all];
    let found = on_a_full_disk(&search);
    assert_eq!(found["files"], json!([]));
    assert!(found["lens"]["surfaces"].is_array(), "{found}");
    assert_eq!(folder.names(), [""; 0], "nothing is left behind");
}

/// A terminal or a disk that takes no results does not keep them from the file.
#[cfg(target_os = "linux")]
#[test]
fn results_are_saved_whatever_happens_to_the_output() {
    let folder = Folder::new("full");
    let (out, history) = (folder.path("out.json"), folder.path("history.json"));
    let full = || fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
    command.args(["optimize", LENS, "--vary", "curvatures", "--steps", "2", "--out", &out]);
    command.args(["--history", &history]).stdout(full());
    let output = command.stderr(Stdio::piped()).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("standard output: "), "{}", text(&output.stderr));
    aplanat::files::open(&out).unwrap();
    assert!(Path::new(&history).exists());
}

#[cfg(unix)]
#[test]
fn a_checkpoint_has_one_writer() {
    let folder = Folder::new("locked");
    let checkpoint = folder.path("run.json");
    let running = start_search(&checkpoint, &[]);
    let link = folder.path("link.json");
    std::os::unix::fs::symlink("run.json", &link).unwrap();
    let holder = format!("in use by process {}", running.id());
    for path in [&checkpoint, &link] {
        let arguments = long_search(path, &[]);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        refused(2, &arguments, "", &[path, &holder]);
    }
    let out = ["optimize", LENS, "--vary", "curvatures", "--steps", "1", "--out", &checkpoint];
    refused(2, &out, "", &[&checkpoint, &holder]);
    running.signal("-KILL");
    running.output();
    let again = start_search(&checkpoint, &[]);
    again.signal("-INT");
    assert_eq!(again.output().status.code(), Some(0));
    // A process that is killed while it saves leaves a part.
    let names = folder.names().into_iter().filter(|name| !name.contains(".part"));
    let names: Vec<String> = names.collect();
    assert_eq!(names, ["link.json", "run.json"], "the lock is gone with its holder");
}

/// Something that has the name of the lock is named, whatever it is.
#[test]
fn what_has_the_name_of_a_lock_is_left_alone() {
    let folder = Folder::new("lock-names");
    let [file, aside] = ["file.json", "folder.json"].map(|name| folder.path(name));
    folder.file(".file.json.lock", "a letter");
    fs::create_dir(folder.path(".folder.json.lock")).unwrap();
    for (checkpoint, found) in [(&file, "a file that is no lock"), (&aside, "found a folder")] {
        let search = ["search", LENS, "--iterations", "4", "--checkpoint", checkpoint];
        refused(2, &search, "", &[".lock", found]);
    }
    assert_eq!(fs::read_to_string(folder.path(".file.json.lock")).unwrap(), "a letter");
}

/// To save a checkpoint under one of two names would part them.
#[cfg(unix)]
#[test]
fn a_checkpoint_has_one_name() {
    let folder = Folder::new("names");
    let (checkpoint, second) = (folder.path("run.json"), folder.path("second.json"));
    let first = ["search", LENS, "--iterations", "4", "--checkpoint", &checkpoint];
    done_json(&first, "");
    fs::hard_link(&checkpoint, &second).unwrap();
    for path in [&checkpoint, &second] {
        let arguments = ["search", LENS, "--iterations", "8", "--checkpoint", path];
        refused(2, &arguments, "", &[path, "2 names", "one name"]);
    }
    fs::remove_file(&second).unwrap();
    done_json(&["search", LENS, "--iterations", "8", "--checkpoint", &checkpoint], "");
}

/// Some files of the system have no end and wait for more.
#[cfg(target_os = "linux")]
#[test]
fn no_file_is_waited_for() {
    let mut running = Running::start(&["info", "/proc/kmsg"]);
    let waits = |_: &u32| running.0.as_mut().unwrap().try_wait().unwrap().is_none();
    (0..200).take_while(waits).for_each(|_| std::thread::sleep(Duration::from_millis(50)));
    assert!(running.0.as_mut().unwrap().try_wait().unwrap().is_some(), "it waits");
    let output = running.output();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
}

/// A command ends as it does for Ctrl-C: with its result, saved.
#[cfg(unix)]
fn ends_with_its_result(arguments: &[&str], signal: &str) -> Value {
    let mut said = String::new();
    // A busy machine may need longer until the work begins.
    for seconds in [2, 8, 30] {
        let running = Running::start(&[arguments, &["--json"]].concat());
        std::thread::sleep(Duration::from_secs(seconds));
        running.signal(signal);
        let output = running.output();
        said = text(&output.stderr);
        if output.status.code() == Some(0) {
            return serde_json::from_slice(&output.stdout).unwrap();
        }
    }
    panic!("{arguments:?} {signal}: {said}");
}

#[cfg(unix)]
#[test]
fn every_request_to_end_saves_what_was_found() {
    let folder = Folder::new("signals");
    for signal in ["-TERM", "-HUP"] {
        let out = folder.path("lens.json");
        let optimize = ["optimize", LENS, "--vary", "curvatures", "--error", "1e-9", "--out", &out];
        let endless = ["--method", "adam", "--steps", "100000000"];
        let report = ends_with_its_result(&[&optimize[..], &endless].concat(), signal);
        assert_eq!(report["ended"], "stopped");
        fs::remove_file(&out).unwrap();
        let search = ["search", LENS, "--iterations", "100000000", "--out", &out];
        assert_eq!(ends_with_its_result(&search, signal)["ended"], "interrupted");
        fs::remove_file(&out).unwrap();
        let front = folder.path("front");
        let pareto = ["pareto", LENS, "--points", "1000", "--steps", "100000", "--out", &front];
        assert_eq!(ends_with_its_result(&pareto, signal)["stopped"], true);
        assert!(Path::new(&front).join("front.csv").exists());
        fs::remove_dir_all(&front).unwrap();
        let field = folder.path("field.npz");
        let grin = ["grin", "luneburg", "--out", &field];
        assert_eq!(ends_with_its_result(&grin, signal)["stopped"], true);
        fs::remove_file(&field).unwrap();
    }
}

/// A lens of 120 wild surfaces, for which one step takes minutes.
#[cfg(unix)]
fn wild_lens() -> String {
    let mut state = 1_u64;
    let mut random = |min: f64, max: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        min + (max - min) * (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let mut surface = |i: usize| {
        let glass = json!({"nd": random(1.45, 1.9), "vd": random(25.0, 80.0)});
        let curvature = random(-1.0, 1.0) / 60.0;
        let surface =
            json!({"curvature": curvature, "thickness": random(0.5, 2.0), "stop": i == 60});
        if i.is_multiple_of(2) { with(surface, "glass", glass) } else { surface }
    };
    let surfaces: Vec<Value> = (0..120).map(&mut surface).collect();
    let fields = [0.0, 5.0, 10.0].map(|y| json!({"y": y}));
    json!({
        "aplanat": 1, "name": "wild", "source": "made for a test", "object": "infinity",
        "aperture": {"entrance_pupil_diameter": 10.0},
        "fields": {"kind": "angle", "values": fields},
        "wavelengths": [{"um": 0.486}, {"um": 0.5876, "primary": true}, {"um": 0.656}],
        "surfaces": surfaces,
    })
    .to_string()
}

#[cfg(unix)]
fn with(mut object: Value, key: &str, value: Value) -> Value {
    object[key] = value;
    object
}

/// A command that is asked to end within a step of minutes ends after some seconds, with what it has.
#[cfg(unix)]
#[test]
fn a_step_that_does_not_end_keeps_no_command_alive() {
    let folder = Folder::new("wild");
    let (lens, out) = (folder.file("wild.json", &wild_lens()), folder.path("best.json"));
    let commands: [&[&str]; 2] = [
        &["optimize", &lens, "--vary", "curvatures", "--error", "1e-9", "--out", &out, "--json"],
        &["search", &lens, "--out", &out, "--json"],
    ];
    for command in commands {
        let running = Running::start(command);
        std::thread::sleep(Duration::from_secs(2));
        running.signal("-TERM");
        let asked = aplanat::measure::Stopwatch::start();
        let output = running.output();
        let said = text(&output.stderr);
        assert!(asked.seconds() < 40.0, "{command:?}: {said}");
        if output.status.code() == Some(0) {
            let report: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert_eq!(report["out"], out.as_str(), "{report}");
            assert!(["stopped", "interrupted"].contains(&report["ended"].as_str().unwrap()));
            has_keys(&done_json(&["info", &out], ""), &["efl"]);
        } else {
            assert_eq!(output.status.code(), Some(1), "{said}");
            assert!(said.contains("stopped before the first"), "{said}");
        }
    }
}

/// A benchmark prints what it measured until then; a study has no result, those before it have.
#[cfg(unix)]
#[test]
fn benchmarks_and_studies_end_when_they_are_asked_to() {
    let search = ["measure", "search", LENS, "--seconds", "1000"];
    let report = ends_with_its_result(&search, "-TERM");
    assert_eq!(report["methods"].as_array().unwrap().len(), 1, "{report}");
    let running = Running::start(&["experiment", "5.4"]);
    std::thread::sleep(Duration::from_secs(2));
    running.signal("-HUP");
    let output = running.output();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("experiment 5.4: stopped"), "{said}");
    assert!(output.stdout.is_empty(), "{}", text(&output.stdout));
}

/// Benchmarks that would take hours print what they measured until they were asked to end.
#[cfg(unix)]
#[test]
fn every_benchmark_ends_when_it_is_asked_to() {
    let many = "100000000";
    let commands: [(&[&str], &str); 6] = [
        (&["tolerance", SINGLET, "--samples", many], "spots"),
        (&["measure", "trace", "--turns", many], "rows"),
        (&["measure", "optimize", "--steps", many], "rows"),
        (&["measure", "optimize", ZOOM, "--evaluations", many], "rows"),
        (&["measure", "limits", ZOOM, "--steps", many], "rows"),
        (&["measure", "search", LENS, "--seconds", many], "methods"),
    ];
    // A busy machine may need longer until the work begins.
    for wait in [600, 6000, 30000] {
        let start = |(command, _): &(&[&str], _)| Running::start(&[*command, &["--json"]].concat());
        let running: Vec<Running> = commands.iter().map(start).collect();
        std::thread::sleep(Duration::from_millis(wait));
        running.iter().for_each(|running| running.signal("-TERM"));
        let ended: Vec<Output> = running.into_iter().map(Running::output).collect();
        if ended.iter().any(|output| output.status.code().is_none()) {
            continue;
        }
        for (output, (command, rows)) in ended.iter().zip(commands) {
            let said = text(&output.stderr);
            assert_eq!(output.status.code(), Some(0), "{command:?}: {said}");
            assert!(said.contains("stopped; only what was measured"), "{command:?}: {said}");
            let report: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert!(report[rows].is_array(), "{command:?}: {report}");
        }
        let trace: Value = serde_json::from_slice(&ended[1].stdout).unwrap();
        assert!(trace["rows"][0]["min"].as_f64().unwrap() > 0.0, "{trace}");
        return;
    }
    panic!("the work never began");
}

/// A picture and a design that are asked to end are saved as far as they are; a picture whose folder is
/// gone by then is kept elsewhere.
#[cfg(unix)]
#[test]
fn pictures_and_designs_are_saved_when_they_are_asked_to_end() {
    // A busy machine may need longer until the work begins.
    let ended = [1500, 6000, 30000].into_iter().any(|wait| {
        // A try leaves its files behind even if one of its programs had not begun: each has a folder of its own.
        are_saved_when_asked_to_end(&Folder::new(&format!("ended-{wait}")), wait)
    });
    assert!(ended, "the work never began");
}

/// Asks two pictures and a design to end after some milliseconds; false if that was before their work began.
#[cfg(unix)]
fn are_saved_when_asked_to_end(folder: &Folder, wait: u64) -> bool {
    let asked =
        r#"{"focal_length_mm": 60.0, "f_number": 4.0, "half_field_deg": 10.0, "max_elements": 4}"#;
    let spec = folder.file("spec.json", asked);
    let outs = ["gone/exact.png", "quick.png", "lens.json"].map(|name| folder.path(name));
    let (error_map, spare) = (folder.path("error.png"), folder.path("spare"));
    fs::create_dir(&spare).unwrap();
    fs::create_dir(folder.path("gone")).unwrap();
    let scene = ["--scene", "target", "--pixels", "1200x800"];
    let exact = ["--exact", "--error", "1e-6", "--max-samples", "100000000", "--out", &outs[0]];
    let exact = [&exact[..], &["--coating", "none"]].concat();
    let mapped = ["--quick", "--error-map", &error_map, "--out", &outs[1]];
    let commands = [
        [&["picture", LENS][..], &scene, &exact].concat(),
        [&["picture", LENS][..], &scene, &mapped].concat(),
        vec!["design", &spec, "--gradients", "100000000", "--out", &outs[2]],
    ];
    let start = |command: &Vec<&str>| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_aplanat"));
        Running::of(program.args(command).env("TMPDIR", &spare))
    };
    let running: Vec<Running> = commands.iter().map(start).collect();
    std::thread::sleep(Duration::from_millis(wait));
    fs::remove_dir_all(folder.path("gone")).unwrap();
    running.iter().for_each(|running| running.signal("-TERM"));
    let ended: Vec<Output> = running.into_iter().map(Running::output).collect();
    let said: Vec<String> = ended.iter().map(|output| text(&output.stderr)).collect();
    let is_early = ended.iter().any(|output| output.status.code().is_none());
    if is_early || said[2].contains("no start led to a lens") {
        return false;
    }
    let codes: Vec<_> = ended.iter().map(|output| output.status.code()).collect();
    assert_eq!(codes, [Some(1), Some(0), Some(0)], "{said:?}");
    let words = ["stopped; what was not sampled is black", "the picture is kept as"];
    assert!(words.iter().all(|word| said[0].contains(word)), "{}", said[0]);
    let told = text(&ended[0].stdout);
    assert!(told.contains("ghosts (not computed, since the picture was stopped)"), "{told}");
    let kept = fs::read_dir(&spare).unwrap().map(|entry| entry.unwrap().file_name());
    let kept: Vec<_> = kept.collect();
    assert_eq!(kept.len(), 1, "{kept:?} {said:?}");
    assert!(outs[1..].iter().all(|path| Path::new(path).exists()), "{said:?}");
    aplanat::files::open(&outs[2]).unwrap();
    true
}

/// A benchmark of nothing has no result.
#[test]
fn no_repetition_is_wrong_input() {
    let none = [
        ["measure", "trace", "--turns", "0"],
        ["measure", "optimize", "--steps", "0"],
        ["measure", "tolerance", "--samples", "0"],
    ];
    for command in none {
        refused(2, &command, "", &[command[2], "found 0; expected 1 or more"]);
    }
}

/// A design that is asked to end does so within a round, with a lens if it has one.
#[cfg(unix)]
#[test]
fn a_design_ends_within_a_round() {
    let folder = Folder::new("design-end");
    let spec = r#"{"focal_length_mm": 50, "f_number": 4, "half_field_deg": 10, "max_elements": 3}"#;
    let (spec, out) = (folder.file("spec.json", spec), folder.path("lens.json"));
    let checkpoint = folder.path("run.json");
    let design = ["design", &spec, "--out", &out, "--minutes", "1000", "--checkpoint", &checkpoint];
    let running = Running::start(&design);
    wait_for(&checkpoint);
    running.signal("-TERM");
    let output = running.output();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(Path::new(&out).exists());
    // A round that was ended depends on time: only whole ones are saved.
    let saved: Value = serde_json::from_str(&fs::read_to_string(&checkpoint).unwrap()).unwrap();
    let whole = design_of_rounds(&spec, saved["rounds"].as_u64().unwrap());
    assert_eq!(saved, whole);
}

/// The checkpoint of a design of a given number of rounds, none of which uses much of its budget:
/// the share that is used decides which stage a round belongs to.
fn design_of_rounds(spec: &str, rounds: u64) -> Value {
    let spec = serde_json::from_str(&fs::read_to_string(spec).unwrap()).unwrap();
    let (asked, _) = LensRequirements::complete(&spec).unwrap();
    // The usual seed of the command.
    let mut run = DesignRun::new(&asked, &DesignSettings::with_seed(1));
    let saved = |run: &DesignRun| -> Value {
        serde_json::from_str(&serde_json::to_string(run).unwrap()).unwrap()
    };
    while saved(&run)["rounds"].as_u64() < Some(rounds) {
        assert!(run.advance(0.0, &AtomicBool::new(false)), "a round of {rounds} is missing");
    }
    saved(&run)
}

/// A run under `nohup` outlives its terminal.
#[cfg(target_os = "linux")]
#[test]
fn an_ignored_end_of_the_terminal_stays_ignored() {
    let folder = Folder::new("nohup");
    let checkpoint = folder.path("run.json");
    let search = long_search(&checkpoint, &[]).join(" ");
    let line = format!("trap '' HUP; exec {} {search}", env!("CARGO_BIN_EXE_aplanat"));
    let mut running = Running::of(Command::new("sh").args(["-c", &line]));
    wait_for(&checkpoint);
    running.signal("-HUP");
    std::thread::sleep(Duration::from_secs(1));
    assert!(running.0.as_mut().unwrap().try_wait().unwrap().is_none(), "it ended");
    running.signal("-TERM");
    assert_eq!(running.output().status.code(), Some(0));
}

/// A lens whose rims let no light through is wrong input to everything that needs light.
#[test]
fn a_lens_without_light_is_wrong_input_everywhere() {
    let folder = Folder::new("dark");
    let singlet = fs::read_to_string("lenses/singlet_la1131.json").unwrap();
    let mut lens: Value = serde_json::from_str(&singlet).unwrap();
    for surface in lens["surfaces"].as_array_mut().unwrap() {
        surface["semi_diameter"] = json!(0.0);
    }
    let dark = folder.file("dark.json", &lens.to_string());
    let out = folder.path("out.json");
    let commands: [&[&str]; 10] = [
        &["analyze", &dark, "spot"],
        &["analyze", &dark, "fan"],
        &["analyze", &dark, "illumination"],
        &["analyze", &dark, "through-focus"],
        &["gradient", &dark],
        &["optimize", &dark, "--vary", "curvatures", "--out", &out],
        &["pareto", &dark, "--points", "2"],
        &["search", &dark, "--iterations", "4"],
        &["measure", "spot", &dark],
        &["measure", "gradient", &dark],
    ];
    for command in commands {
        refused(2, command, "", &["dark.json", "no light"]);
    }
    let mut aside: Value = serde_json::from_str(&singlet).unwrap();
    aside["fields"] = json!({"kind": "angle", "values": [{"y": 95.0}]});
    let aside = folder.file("aside.json", &aside.to_string());
    let checks = done_json(&["info", &aside], "")["checks"].clone();
    assert!(checks.to_string().contains("field x 0, y 95: no ray"), "{checks}");
    for command in [&["analyze", &aside, "spot"][..], &["gradient", &aside]] {
        refused(2, command, "", &["aside.json", "no ray"]);
    }
    assert!(!Path::new(&out).exists());
    let checks = done_json(&["info", &dark], "")["checks"].clone();
    assert!(checks.to_string().contains("no light"), "{checks}");
}
