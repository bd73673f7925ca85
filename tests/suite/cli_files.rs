//! The files of a command: nothing that is read is written over, folders name what is left of an
//! earlier result, and what is no lens file is refused before it is read whole.

use super::cli::{Scratch, done, done_json, has_keys, refused};
use serde_json::{Value, json};
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

const LENS: &str = "lenses/singlet_la1131.json";

/// A folder of its own for a test, empty, and removed at its end.
pub(super) struct Folder(PathBuf);

impl Folder {
    pub(super) fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("aplanat-{}-{name}", std::process::id()));
        drop(fs::remove_dir_all(&path));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// The path of a file in it.
    pub(super) fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    /// A copy of a lens in it.
    pub(super) fn lens(&self, name: &str, lens: &str) -> String {
        fs::copy(lens, self.0.join(name)).unwrap();
        self.path(name)
    }

    /// A file with this text in it.
    pub(super) fn file(&self, name: &str, text: &str) -> String {
        fs::write(self.0.join(name), text).unwrap();
        self.path(name)
    }

    /// The names of its files, sorted.
    pub(super) fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        drop(fs::remove_dir_all(&self.0));
    }
}

#[test]
fn optimize_writes_over_nothing_that_it_reads() {
    let folder = Folder::new("own-optimize");
    let lens = folder.lens("lens.json", LENS);
    let goal = folder.file("goal.json", r#"{"terms": [{"term": "spot", "weight": 1.0}]}"#);
    let out = folder.path("out.json");
    let detour = folder.path("./lens.json");
    let wrong = |out: &str, more: &[&str], words: &[&str]| {
        let base = ["optimize", &lens, "--vary", "curvatures", "--steps", "1", "--out", out];
        refused(2, &[&base[..], more].concat(), "", words);
        assert_eq!(fs::read(&lens).unwrap(), fs::read(LENS).unwrap());
    };
    wrong(&lens, &[], &["--out", "is the lens; expected another file"]);
    wrong(&detour, &[], &["--out", "is the lens"]);
    wrong(&out, &["--history", &lens], &["--history", "is the lens"]);
    wrong(&out, &["--history", &out], &["--history", "is --out"]);
    wrong(&goal, &["--goal", &goal], &["--out", "is --goal"]);
    #[cfg(unix)]
    {
        let (link, twin) = (folder.path("link.json"), folder.path("twin.json"));
        std::os::unix::fs::symlink("lens.json", &link).unwrap();
        fs::hard_link(&lens, &twin).unwrap();
        wrong(&link, &[], &["--out", "is the lens"]);
        wrong(&twin, &[], &["--out", "is the lens"]);
        wrong(&out, &["--history", &link], &["--history", "is the lens"]);
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn no_command_writes_over_what_it_reads() {
    let folder = Folder::new("own-others");
    let lens = folder.lens("start.json", LENS);
    refused(2, &["convert", &lens, &lens], "", &["OUT", "is the lens"]);
    let same = folder.path(".");
    refused(2, &["pareto", &lens, "--out", &same], "", &["--out", "start.json is the lens"]);
    let stored = folder.lens("01_generation_5.json", LENS);
    let search = ["search", &stored, "--iterations", "4", "--reservoir-dir", &same];
    refused(2, &search, "", &["--reservoir-dir", "is the lens"]);
    let values = fs::read("tests/files/old_volume.raw").unwrap();
    fs::write(folder.path("values.raw"), &values).unwrap();
    let header = fs::read_to_string("tests/files/old_volume.json").unwrap();
    let header = folder.file("header.json", &header.replace("old_volume.raw", "values.raw"));
    let task = done(&["grin", "luneburg", "--show"], "");
    let mut task: Value = serde_json::from_str(&task).unwrap();
    task["exact"] = json!({"volume": header});
    let task = folder.file("task.json", &task.to_string());
    let grin = |out: &str, words: &[&str]| refused(2, &["grin", &task, "--out", out], "", words);
    grin(&task, &["--out", "the task itself"]);
    grin(&header, &["--out", "a file of the task"]);
    grin(&folder.path("values.json"), &["the numbers of --out", "a file of the task"]);
    #[cfg(unix)]
    {
        let table = folder.path("table.csv");
        fs::hard_link(&lens, &table).unwrap();
        for command in [&["analyze", &lens, "spot"][..], &["tolerance", &lens]] {
            refused(2, &[command, &["--csv", &table]].concat(), "", &["--csv", "is the lens"]);
        }
        let plot = folder.path("plot.png");
        std::os::unix::fs::symlink("start.json", &plot).unwrap();
        refused(2, &["measure", "spot", &lens, "--plot", &plot], "", &["--plot", "is the lens"]);
    }
    assert_eq!(fs::read(&lens).unwrap(), fs::read(LENS).unwrap());
    assert_eq!(fs::read(&stored).unwrap(), fs::read(LENS).unwrap());
    assert_eq!(fs::read(folder.path("values.raw")).unwrap(), values);
}

#[test]
fn a_scene_is_not_written_over_by_its_picture() {
    let folder = Folder::new("own-scene");
    let scene = folder.path("scene.png");
    fs::write(&scene, b"of a user").unwrap();
    let detour = folder.path("./scene.png");
    for out in [&scene, &detour] {
        let picture = ["picture", LENS, "--scene", &scene, "--out", out];
        refused(2, &picture, "", &["--out", "is the scene; expected another file"]);
    }
    #[cfg(unix)]
    {
        let link = folder.path("link.png");
        std::os::unix::fs::symlink("scene.png", &link).unwrap();
        let picture = ["picture", LENS, "--scene", &scene, "--out", &link];
        refused(2, &picture, "", &["--out", "is the scene"]);
    }
    assert_eq!(fs::read(&scene).unwrap(), b"of a user");
}

/// A design writes lenses beside the one that is named.
#[test]
fn a_specification_is_not_written_over_by_a_lens_beside_the_best_one() {
    let folder = Folder::new("own-design");
    let text = r#"{"focal_length_mm": 100, "f_number": 10, "half_field_deg": 1}"#;
    for merit in ["simplest", "brightest", "robust"] {
        let spec = folder.file(&format!("a_{merit}.json"), text);
        let design = ["design", &spec, "--out", &folder.path("a.json"), "--gradients", "1"];
        refused(2, &design, "", &[&spec, "is the specification; expected another file"]);
        assert_eq!(fs::read_to_string(&spec).unwrap(), text);
    }
    let spec = folder.file("spec.json", text);
    let best = ["design", &spec, "--out", &folder.path("a.json"), "--checkpoint"];
    let checkpoint = folder.path("a_simplest.json");
    fs::remove_file(&checkpoint).unwrap();
    refused(2, &[&best[..], &[&checkpoint]].concat(), "", &["--checkpoint", "is --out"]);
}

/// Curves as polylines of 0.35 mm: two sections at three fields and three wavelengths.
#[test]
fn curves_of_an_analysis_are_drawn() {
    let (folder, lens) = (Folder::new("curves"), "lenses/cooke_triplet_100_f27.json");
    let [svg, pdf, png] = ["svg", "pdf", "png"].map(|kind| folder.path(&format!("fan.{kind}")));
    for path in [&svg, &pdf, &png] {
        done_json(&["analyze", lens, "fan", "--plot", path], "");
    }
    let text = fs::read_to_string(&svg).unwrap();
    let curves = text.lines().filter(|line| line.contains("polyline") && line.contains("0.35"));
    let samples = 3 * 3;
    assert_eq!(curves.count(), 2 * 3 * 3 + samples, "{text}");
    assert!(["tangential", "dy, mm", "0.5875618 um"].iter().all(|word| text.contains(word)));
    // The caption of each field, drawn and as an element of the file.
    let caption = |text: &str| {
        text.split("<desc>").nth(1).map(|t| t.split("</desc>").next().unwrap().to_owned())
    };
    let sentences = caption(&text).unwrap();
    assert!(
        sentences.split("; ").count() == 3 && sentences.starts_with("y 0 deg: error "),
        "{sentences}"
    );
    assert!(
        sentences.contains(" mm, ")
            && sentences.contains(" rays, ")
            && !sentences.contains("up to")
    );
    assert!(fs::read(&pdf).unwrap().starts_with(b"%PDF"));
    assert!(image::open(&png).unwrap().width() > 1000);
    for kind in ["opd-fan", "longitudinal", "through-focus", "mtf", "through-focus-mtf"] {
        done_json(&["analyze", lens, kind, "--error", "1%", "--plot", &svg], "");
        let text = fs::read_to_string(&svg).unwrap();
        assert!(text.matches("0.35").count() >= 2, "{kind}");
    }
    // A kind, a word of its drawing and the least number of its lines.
    for (kind, word, lines) in [
        ("spot", "0.6562725 um", 1000),
        ("footprint", "beam on surface 1", 6),
        ("wavefront", "wavelengths", 300),
        ("zernike", "fringe", 200),
        ("psf", "lg intensity", 12),
        ("ghosts", "lg irradiance", 12),
        ("distortion", "against f theta", 4),
        ("field-curvature", "sagittal", 4),
        ("lateral-color", "0.4861327 um", 6),
        ("illumination", "relative illumination, %", 2),
    ] {
        done_json(&["analyze", lens, kind, "--error", "1%", "--plot", &svg], "");
        let text = fs::read_to_string(&svg).unwrap();
        assert!(text.matches("0.35").count() >= lines && text.contains(word), "{kind}: {text}");
        // The report of the fields is not that of curves over the field.
        let is_over_field =
            ["distortion", "field-curvature", "lateral-color", "illumination"].contains(&kind);
        assert_eq!(caption(&text).is_none(), is_over_field, "{kind}");
    }
    refused(
        2,
        &["analyze", lens, "fan", "--plot", "fan.gif"],
        "",
        &["fan.gif", "`.png` or `.svg`"],
    );
}

/// A corner of the grid is as far from the axis as the farthest field: 22 lines of each of two grids.
#[test]
fn the_corners_of_a_distortion_grid_are_the_farthest_field() {
    let (folder, lens) = (Folder::new("grid"), "lenses/wide_nikkor_28_f35.json");
    let svg = folder.path("grid.svg");
    let grid = done_json(&["analyze", lens, "distortion-grid", "--plot", &svg], "");
    let fields = done_json(&["analyze", lens, "distortion"], "")["fields"].clone();
    let farthest = fields.as_array().unwrap().last().unwrap();
    let expected = &farthest["distortion"];
    let found = &grid["fields"][0];
    let corner = &found["points"][120];
    let off = |k: usize| corner["real"][k].as_f64().unwrap() / corner["ideal"][k].as_f64().unwrap();
    let value = expected["value"].as_f64().unwrap();
    assert!((off(0) - off(1)).abs() < 1e-9 && (off(0) - 1.0 - value).abs() < 1e-9, "{corner}");
    assert_eq!(found["points"].as_array().unwrap().len(), 121);
    assert_eq!(found["points"][60]["ideal"], json!([0.0, 0.0]));
    let text = fs::read_to_string(&svg).unwrap();
    let lines = text.lines().filter(|line| line.contains("polyline") && line.contains("0.35"));
    assert_eq!(lines.count(), 2 * 22 + 2, "with a sample of each in the legend");
}

/// A map of the field has the spots of the fields of the lens: the farthest is at the top of the grid.
#[test]
fn a_spot_map_has_the_spots_of_the_fields() {
    let (folder, lens) = (Folder::new("spot-map"), "lenses/tessar_50_f28.json");
    let svg = folder.path("map.svg");
    let arguments = ["analyze", lens, "spot-map", "--error", "1%", "--plot", &svg];
    let found = done_json(&arguments, "")["fields"][0].clone();
    let spots = done_json(&["analyze", lens, "spot"], "")["fields"].clone();
    let points = found["points"].as_array().unwrap();
    let at = |x: f64, y: f64| {
        let is_it = |point: &&Value| {
            let off = |k: usize, v: f64| (point["field"][k].as_f64().unwrap() - v).abs();
            off(0, x) < 1e-9 && off(1, y) < 1e-9
        };
        points.iter().find(is_it).unwrap()["rms"].clone()
    };
    for spot in spots.as_array().unwrap().iter().filter(|spot| spot["y"] != json!(16.36)) {
        let y = spot["y"].as_f64().unwrap();
        for map in [at(0.0, y), at(-y, 0.0)] {
            let [map, own] = [&map, &spot["rms"]].map(|e| [&e["value"], &e["error"]]);
            let number = |v: &Value| v.as_f64().unwrap();
            let off = (number(map[0]) - number(own[0])).abs();
            assert!(off <= number(map[1]) + number(own[1]), "{y}: {map:?} {own:?}");
        }
    }
    assert!(fs::read_to_string(&svg).unwrap().contains("every"));
}

/// A folder is filled with files of certain names, which nothing else may have.
#[test]
fn a_folder_and_a_file_in_it_do_not_share_a_name() {
    let folder = Folder::new("own-names");
    let (all, best) = (folder.path(""), folder.path("02_generation_0.json"));
    let search = ["search", LENS, "--iterations", "4", "--reservoir-dir", &all];
    let refuse = |more: &[&str], words: &[&str]| {
        refused(2, &[&search[..], more].concat(), "", words);
    };
    refuse(&["--out", &best], &["--reservoir-dir", "02_generation_0.json is --out"]);
    refuse(&["--checkpoint", &best], &["02_generation_0.json is --checkpoint"]);
    assert!(folder.names().is_empty());
}

/// The lock beside a checkpoint is the program's own file; a file of that name that is not stays.
#[test]
fn a_file_with_the_name_of_a_lock_is_kept() {
    let folder = Folder::new("no-lock");
    let own = folder.file(".run.json.lock", "my notes");
    let checkpoint = folder.path("run.json");
    let search = ["search", LENS, "--iterations", "4", "--checkpoint", &checkpoint];
    refused(2, &search, "", &[".run.json.lock: found a file that is no lock"]);
    assert_eq!(fs::read_to_string(&own).unwrap(), "my notes");
    // The number of a process that is no more.
    fs::write(&own, "4194304").unwrap();
    done(&search, "");
    assert_eq!(folder.names(), ["run.json"]);
}

#[cfg(unix)]
#[test]
fn a_checkpoint_is_written_through_a_link_to_nothing() {
    let folder = Folder::new("dangling");
    let link = folder.path("link.json");
    std::os::unix::fs::symlink("run.json", &link).unwrap();
    let search = ["search", LENS, "--iterations", "4", "--checkpoint", &link];
    assert_eq!(done_json(&search, "")["resumed"], false);
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(folder.names(), ["link.json", "run.json"]);
    assert_eq!(done_json(&search, "")["resumed"], true);
    std::os::unix::fs::symlink("loop.json", folder.path("loop.json")).unwrap();
    let circle = ["search", LENS, "--checkpoint", &folder.path("loop.json")];
    refused(2, &circle, "", &["loop.json", "a link that leads to itself"]);
}

#[test]
fn a_folder_names_what_is_left_of_an_earlier_result() {
    let folder = Folder::new("stale");
    let own = folder.path("front_notes.json");
    fs::write(&own, "{}").unwrap();
    let old = folder.lens("front_900.json", LENS);
    let biased = folder.lens("biased_001.json", LENS);
    let front = ["pareto", LENS, "--points", "2", "--steps", "2", "--no-biased", "--error", "1%"];
    let all = folder.path("");
    let front = [&front[..], &["--out", &all]].concat();
    let report = done_json(&front, "");
    assert_eq!(report["stale"], json!([biased, old]));
    fs::remove_file(&old).unwrap();
    fs::remove_file(&biased).unwrap();
    assert_eq!(done_json(&front, "").get("stale"), None);
    let older = folder.lens("09_generation_77.json", LENS);
    let search = ["search", LENS, "--iterations", "8", "--reservoir-dir", &all];
    assert_eq!(done_json(&search, "")["stale"], json!([older]));
    assert!(Path::new(&own).exists() && Path::new(&older).exists());
}

#[cfg(unix)]
#[test]
fn devices_pipes_and_endless_files_are_refused() {
    refused(2, &["info", "/dev/zero"], "", &["/dev/zero", "a device"]);
    refused(2, &["trace", LENS, "--rays", "/dev/zero"], "", &["/dev/zero", "a device"]);
    let folder = Folder::new("endless");
    let pipe = folder.path("pipe.json");
    std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    refused(2, &["info", &pipe], "", &["a named pipe", "expected a file"]);
    refused(2, &["optimize", LENS, "--goal", &pipe, "--out", "x.json"], "", &["a named pipe"]);
    refused(2, &["optimize", LENS, "--out", &pipe], "", &["a device or a pipe"]);
    let long = folder.path("long.json");
    fs::File::create(&long).unwrap().set_len(64_000_001).unwrap();
    refused(2, &["info", &long], "", &["long.json", "more than 64 MB"]);
    // A pipe of the shell has an end.
    let read = format!("{} info /dev/stdin", env!("CARGO_BIN_EXE_aplanat"));
    let line = format!("cat {LENS} | {read}");
    let piped = std::process::Command::new("sh").args(["-c", &line]).output().unwrap();
    assert!(piped.status.success(), "{}", String::from_utf8_lossy(&piped.stderr));
}

/// A megabyte of zeros packs into a kilobyte.
#[test]
fn an_archive_is_unpacked_only_as_far_as_its_header_says() {
    let folder = Folder::new("bomb");
    let path = folder.path("bomb.npz");
    let header = |shape: &str| {
        let text = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
        [b"\x93NUMPY\x01\0", &(text.len() as u16).to_le_bytes()[..], text.as_bytes()].concat()
    };
    let refusal = |shape: &str, numbers: usize| {
        let mut archive = zip::ZipWriter::new(fs::File::create(&path).unwrap());
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file("index.npy", options).unwrap();
        archive.write_all(&header(shape)).unwrap();
        archive.write_all(&vec![0; 8 * numbers]).unwrap();
        archive.finish().unwrap();
        aplanat::files::read_volume(Path::new(&path)).unwrap_err().to_string()
    };
    let text = refusal("(2, 2, 2)", 1_000_000);
    assert!(text.contains("array index: found more bytes of numbers for [2, 2, 2]"), "{text}");
    assert!(refusal("(2, 2, 2)", 7).contains("found 56 bytes of numbers for [2, 2, 2]"));
    let text = refusal("(4000, 4000, 4000)", 8);
    assert!(text.contains("[4000, 4000, 4000]; expected at most 268435456 numbers"), "{text}");
}

#[test]
fn raw_numbers_are_read_only_as_far_as_the_header_says() {
    let folder = Folder::new("raw-bomb");
    fs::File::create(folder.path("long.raw")).unwrap().set_len(1 << 40).unwrap();
    let header = r#"{"aplanat_volume": 1, "counts": [2, 2, 2], "low": [0, 0, 0],
        "spacing": [1, 1, 1], "numbers": "f64", "data": "long.raw"}"#;
    let header = folder.file("long.json", header);
    let text = aplanat::files::read_volume(Path::new(&header)).unwrap_err().to_string();
    assert!(text.contains("long.raw: found more than 8000 bytes"), "{text}");
}

#[test]
fn convert_refuses_what_info_refuses() {
    let folder = Folder::new("convert");
    let mut lens: Value = serde_json::from_str(&fs::read_to_string(LENS).unwrap()).unwrap();
    lens["wavelengths"] = json!([{"um": 50.0}]);
    let glass = folder.file("glass.json", &lens.to_string());
    lens["wavelengths"] = json!([{"um": 0.6, "primary": true}, {"um": 50.0}]);
    let outer = folder.file("outer.json", &lens.to_string());
    for (lens, words) in [(&glass, "has no index at 50 um"), (&outer, "has no index at 50 um")] {
        refused(2, &["info", lens], "", &[lens, words]);
        for out in ["out.json", "out.zmx"].map(|name| folder.path(name)) {
            refused(2, &["convert", lens, &out], "", &[lens, words]);
            assert!(!Path::new(&out).exists());
        }
    }
}

#[test]
fn a_lens_of_too_many_surfaces_is_refused() {
    let folder = Folder::new("many");
    let mut lens: Value = serde_json::from_str(&fs::read_to_string(LENS).unwrap()).unwrap();
    let plane = json!({"thickness": 0.001, "semi_diameter": 30.0});
    let rows = lens["surfaces"].as_array_mut().unwrap();
    rows.splice(0..0, vec![plane; 999]);
    let many = folder.file("many.json", &lens.to_string());
    refused(2, &["info", &many], "", &["many.json", "1001 surfaces; expected at most 1000"]);
}

#[test]
fn a_search_whose_first_gradient_is_no_number_is_refused() {
    let folder = Folder::new("sharp");
    let triplet = fs::read_to_string("lenses/cooke_triplet_100_f27.json").unwrap();
    let mut lens: Value = serde_json::from_str(&triplet).unwrap();
    lens["surfaces"][0]["curvature"] = json!(1e90);
    let sharp = folder.file("sharp.json", &lens.to_string());
    let words = ["sharp.json", "the term `spot` is not finite"];
    refused(2, &["search", &sharp, "--free", "--iterations", "4"], "", &words);
}

#[test]
fn an_aperture_wider_than_the_stop_is_named() {
    let folder = Folder::new("wide");
    let mut lens: Value = serde_json::from_str(&fs::read_to_string(LENS).unwrap()).unwrap();
    lens["aperture"] = json!({"entrance_pupil_diameter": 3000.0});
    let wide = folder.file("wide.json", &lens.to_string());
    let checks = done_json(&["info", &wide], "")["checks"].clone();
    assert_eq!(checks[0]["surface"], 0);
    let found = checks[0]["found"].as_str().unwrap();
    assert!(found.contains("a stop of 1500 mm, but its semi-diameter is 12.7 mm"), "{found}");
    assert_eq!(done_json(&["info", LENS], "")["checks"], json!([]));
}

#[test]
fn a_gap_that_a_file_cannot_hold_is_named_by_its_surface() {
    let folder = Folder::new("gap");
    let mut lens: Value = serde_json::from_str(&fs::read_to_string(LENS).unwrap()).unwrap();
    lens["surfaces"][0]["thickness"] = json!(1e99);
    let far = folder.file("far.json", &lens.to_string());
    let out = folder.path("far.zmx");
    let words = ["far.zmx: thickness after surface 1 is", "expected less than 1e18 mm"];
    refused(2, &["convert", &far, &out], "", &words);
}

#[test]
fn a_list_is_no_object() {
    let rules = Scratch::with("list-rules.json", "[]");
    let words = ["list-rules.json, line 1", "a list", "expected an object"];
    refused(2, &["search", LENS, "--iterations", "4", "--rules", rules.path()], "", &words);
    refused(2, &["trace", LENS, "--rays", "-"], "[0.5, 0, []]", &["a list", "an object"]);
    let rays = r#"{"rays": [[0, 0, -1, 0, 0, 1]]}"#;
    let words = ["rays[0]", "a list", "an object"];
    refused(2, &["trace", LENS, "--rays", "-"], rays, &words);
}

#[test]
fn messages_name_the_number_and_its_place() {
    let rays = |ray: Value| json!({"rays": [ray]}).to_string();
    let far = json!({"x": 1e161, "y": 0, "z": 0, "L": 0, "M": 0, "N": 1});
    let words = ["ray 0: x is 1e161; expected a start of finite numbers up to 1e100 mm"];
    refused(2, &["trace", LENS, "--rays", "-"], &rays(far), &words);
    let text = "{\"rays\": [{\"x\": 0, \"y\": 0, \"z\": 0, \"L\": 0, \"M\": NaN, \"N\": 1}]}";
    let words = ["line 1, column 49, rays[0].M: found `NaN`"];
    refused(2, &["trace", LENS, "--rays", "-"], text, &words);
    let goal = Scratch::new("latin-goal.json");
    fs::write(&goal.0, b"{\"terms\":\n [{\"term\": \"sp\xf6t\"}]}").unwrap();
    let out = Scratch::new("latin-out.json");
    let arguments = ["optimize", LENS, "--goal", goal.path(), "--out", out.path()];
    refused(2, &arguments, "", &["latin-goal.json, line 2: found the byte 0xf6", "UTF-8"]);
}

/// A sphere that light enters from the side, beyond its equator.
#[test]
fn a_lens_file_has_hyperhemispheres() {
    let folder = Folder::new("hyper");
    let lens = |hyper: bool| {
        json!({"aplanat": 1, "object": "infinity", "aperture": {"entrance_pupil_diameter": 2.0},
            "fields": {"kind": "angle", "values": [{"y": 0.0}]}, "wavelengths": [{"um": 0.5}],
            "surfaces": [{"curvature": 0.1, "thickness": 18.0, "glass": {"index": 1.5},
                "semi_diameter": 10.0, "stop": true, "hyper": hyper},
                {"thickness": 2.0, "glass": {"index": 1.5}}]})
        .to_string()
    };
    let ray = json!({"rays": [{"x": 19, "y": 0, "z": 10.62, "L": -0.96, "M": 0, "N": 0.28}]});
    let met = |hyper: bool| {
        let lens = folder.file("ball.json", &lens(hyper));
        done_json(&["trace", &lens, "--rays", "-"], &ray.to_string())["rays"][0].clone()
    };
    assert_eq!((&met(false)["fate"], &met(false)["surface"]), (&"missed".into(), &0.into()));
    assert_eq!(met(true)["fate"], "imaged");
    let whole = folder.file("whole.json", &lens(true));
    let back = folder.path("back.json");
    done(&["convert", &whole, &back], "");
    assert!(aplanat::files::open(&back).unwrap().lens.surfaces[0].hyperhemisphere);
    let report = done_json(&["convert", &whole, &folder.path("whole.zmx")], "");
    has_keys(&report["export"], &["report"]);
    let rows = report["export"]["report"]["rows"].as_array().unwrap();
    let lost = |row: &&Value| row["text"] == "hyperhemisphere of surface 1";
    assert_eq!(rows.iter().find(lost).unwrap()["outcome"], "dropped");
    assert!(done(&["help", "lens-file"], "").contains("hyperhemisphere"));
    // Both halves of such a stop have the same height, which limits no beam.
    refused(2, &["gradient", &whole], "", &["whole.json", "the stop is a hyperhemisphere"]);
    let file = fs::read_to_string(&whole).unwrap();
    let plain = folder.file("plain.json", &file.replace("\"curvature\":0.1", "\"curvature\":0.0"));
    let said = done(&["info", &plain], "");
    assert!(said.contains("`hyper` changes nothing"), "{said}");
}

/// Surfaces of curvature 1e90 one behind the other: the focal length overflows, and nothing panics.
#[test]
fn a_focal_length_that_is_no_number_is_refused() {
    for count in [2, 4, 6, 8, 12, 20] {
        let mut lens: Value =
            serde_json::from_str(&fs::read_to_string("lenses/achromat_ac254_100.json").unwrap())
                .unwrap();
        let surface = |i: usize| {
            let sign = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
            let mut row = json!({"curvature": sign * 1e90, "thickness": 0.5, "semi_diameter": 5.0});
            if i.is_multiple_of(2) {
                row["glass"] = json!({"nd": 1.5, "vd": 60.0});
            }
            if i == 0 {
                row["stop"] = true.into();
            }
            row
        };
        lens["surfaces"] = (0..count).map(surface).collect();
        lens["variables"] = json!([]);
        let file = Scratch::with(&format!("overflow_{count}.json"), &lens.to_string());
        for vary in ["curvatures", "thicknesses"] {
            let arguments = ["optimize", file.path(), "--vary", vary, "--steps", "1"];
            refused(2, &arguments, "", &[]);
        }
    }
}

/// A surface of curvature 1e90 with an aspheric term: no sum and no beam, and every command says so.
#[test]
fn a_lens_with_a_needle_is_described_without_numbers_that_are_none() {
    let folder = Folder::new("needle");
    let text = fs::read_to_string("lenses/cooke_triplet_100_f27.json").unwrap();
    let mut lens: Value = serde_json::from_str(&text).unwrap();
    for row in [2, 3] {
        lens["surfaces"][row]["curvature"] = 1e90.into();
        lens["surfaces"][row]["asphere"] = json!([1e-7]);
    }
    let path = folder.file("needle.json", &lens.to_string());
    let said = done(&["info", &path], "");
    assert!(!said.contains("NaN") && !said.contains("inf "), "{said}");
    assert!(said.lines().all(|line| line.len() < 400), "{said}");
    for command in [vec!["gradient", &path], vec!["analyze", &path, "spot"]] {
        refused(2, &command, "", &["needle.json"]);
    }
}

#[test]
fn a_search_refuses_a_lens_of_a_thousand_surfaces_by_name() {
    let folder = Folder::new("many");
    let text = fs::read_to_string("lenses/cooke_triplet_100_f27.json").unwrap();
    let mut lens: Value = serde_json::from_str(&text).unwrap();
    let rows = lens["surfaces"].as_array().unwrap().clone();
    let plane = json!({"thickness": 0.001});
    let many: Vec<Value> = rows.into_iter().chain(vec![plane; 900]).collect();
    lens["surfaces"] = many.into();
    let path = folder.file("many.json", &lens.to_string());
    let out = folder.path("out.json");
    let words = ["the number of surfaces is 907", "at most 200"];
    refused(2, &["search", &path, "--iterations", "5", "--out", &out], "", &words);
}

/// The indices change the spot of a telescope of 4 m by what is left of terms that cancel: rounding, which no
/// more rays improve.
#[test]
fn derivatives_of_large_telescopes_reach_their_tolerance() {
    for lens in ["lenses/telescope_rc_f8.json", "lenses/more/telescope_hubble_f24.json"] {
        let report = done_json(&["gradient", lens, "--error", "1e-3"], "");
        assert_eq!(report["reached"], true, "{lens}: {report}");
    }
}
