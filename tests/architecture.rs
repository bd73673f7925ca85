//! The rules of the architecture, checked on the source text: the order of the modules, access to
//! the clock and to widgets, permitted `unsafe`, and the documentation of files and items.
#![expect(clippy::unwrap_used, reason = "a test that cannot read the source should fail")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The only floors that read the clock.
const CLOCK: [&str; 2] = ["measure", "session"];

/// Files that may contain `unsafe`, and why.
const UNSAFE: [(&str, &str); 2] = [
    ("src/math/lanes.rs", "vector instructions that the processor was asked for before"),
    ("src/cli/heap.rs", "the allocator of the system is told to keep free memory"),
];

/// Names of the top modules, lowest first.
fn floors() -> Vec<String> {
    let lib = fs::read_to_string("src/lib.rs").unwrap();
    lib.lines()
        .filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';').map(str::to_owned))
        .collect()
}

fn rust_files(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path());
    let (dirs, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    let mut found: Vec<_> =
        files.into_iter().filter(|f| f.extension().is_some_and(|e| e == "rs")).collect();
    found.extend(dirs.iter().flat_map(|dir| rust_files(dir)));
    found.sort();
    found
}

/// Every source file with its path and its text.
fn sources() -> Vec<(String, String)> {
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).unwrap();
        (path.to_str().unwrap().replace('\\', "/"), text)
    };
    rust_files(Path::new("src")).into_iter().map(read).collect()
}

/// The lines of a text that are not comments.
fn code(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter(|line| !line.trim_start().starts_with("//"))
}

/// True if a text contains a name as a whole word.
fn names(text: &str, word: &str) -> bool {
    let is_letter = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(word).any(|(at, _)| {
        let before = text[..at].chars().next_back().is_some_and(is_letter);
        let behind = text[at + word.len()..].chars().next().is_some_and(is_letter);
        !before && !behind
    })
}

fn is_in(path: &str, floor: &str) -> bool {
    path.starts_with(&format!("src/{floor}/"))
}

#[test]
fn modules_use_only_the_floors_below() {
    let floors = floors();
    assert!(floors.len() > 10, "{floors:?}");
    for (level, floor) in floors.iter().enumerate() {
        for file in rust_files(&Path::new("src").join(floor)) {
            let text = fs::read_to_string(&file).unwrap();
            let hidden = text.contains("crate::{") || text.contains("super::super");
            assert!(!hidden, "{}: one `use crate::floor::…` a line", file.display());
            for above in &floors[level + 1..] {
                let path = format!("crate::{above}");
                assert!(!names(&text, &path), "{} uses {path}, a floor above", file.display());
            }
        }
    }
}

#[test]
fn every_floor_is_a_folder_and_every_folder_a_floor() {
    let mut floors = floors();
    let mut folders: Vec<String> = fs::read_dir("src")
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir())
        .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
        .collect();
    floors.sort();
    folders.sort();
    assert_eq!(floors, folders);
}

#[test]
fn only_measuring_and_the_session_read_the_clock() {
    for (path, text) in sources() {
        if CLOCK.iter().any(|floor| is_in(&path, floor)) {
            continue;
        }
        for word in ["Instant", "SystemTime"] {
            let reads = code(&text).any(|line| names(line, word));
            assert!(!reads, "{path} names {word}, and the engine reads no clock");
        }
    }
}

#[test]
fn only_the_studio_knows_widgets() {
    for (path, text) in sources() {
        if is_in(&path, "studio") {
            continue;
        }
        for word in ["egui", "eframe", "egui_plot", "egui_tiles", "egui_extras", "rfd", "wgpu"] {
            let knows = code(&text).any(|line| names(line, word));
            assert!(!knows, "{path} names {word}, which only the studio knows");
        }
    }
}

#[test]
fn unsafe_stands_only_where_it_is_allowed_and_explained() {
    for (path, text) in sources() {
        let blocks = code(&text).filter(|line| names(line, "unsafe")).count();
        let reasons = text.matches("SAFETY:").count();
        let allowed = UNSAFE.iter().any(|(file, _)| *file == path);
        assert!(allowed || blocks == 0, "{path} contains `unsafe`");
        assert!(reasons >= blocks, "{path}: {blocks} `unsafe`, {reasons} times `SAFETY:`");
    }
    for (file, reason) in UNSAFE {
        let text = fs::read_to_string(file).unwrap();
        let used = code(&text).any(|line| names(line, "unsafe"));
        assert!(used, "{file} needs no permission any more ({reason})");
    }
}

#[test]
fn every_file_begins_with_its_idea() {
    for (path, text) in sources() {
        assert!(text.starts_with("//! "), "{path} does not begin with `//!`");
        let idea = text.lines().next().unwrap_or_default();
        assert!(idea.len() > 12, "{path} begins with `{idea}`");
    }
}

#[test]
fn the_window_and_python_are_behind_one_feature_gate_each() {
    for (path, text) in sources() {
        if path == "src/lib.rs" {
            let gates = text.matches("cfg(feature").count();
            assert_eq!(gates, 2, "src/lib.rs has two gates, on the studio and on Python");
        } else if !path.starts_with("src/cli/") && path != "src/main.rs" {
            assert!(!text.contains("cfg(feature"), "{path} has a feature gate of its own");
        }
    }
}

#[test]
fn functions_are_short() {
    let mut longest = (0, String::new());
    for (path, text) in sources() {
        for (name, lines) in functions(&text) {
            if lines > longest.0 {
                longest = (lines, format!("{name} in {path}"));
            }
        }
    }
    assert!(longest.0 <= 60, "{} has {} lines", longest.1, longest.0);
}

/// Every function of a formatted text with the number of its lines: from `fn` to the brace at the
/// same depth.
fn functions(text: &str) -> Vec<(String, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (i, line) in lines.iter().enumerate() {
        let indent = line.len() - line.trim_start().len();
        let Some(name) = code(line).find_map(|line| line.split_once("fn ").map(|(_, rest)| rest))
        else {
            continue;
        };
        let name: String = name.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        let end = format!("{}}}", " ".repeat(indent));
        let length = lines[i..].iter().position(|line| *line == end);
        if let (false, Some(length)) = (name.is_empty() || line.ends_with(';'), length) {
            found.push((name, length + 1));
        }
    }
    found
}

/// The names of the types and traits that a text defines at the top level of a module.
fn defined_types(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter_map(|line| {
        let line = line.trim_start();
        let item = line.strip_prefix("pub").map_or(line, |rest| {
            rest.strip_prefix('(').and_then(|rest| rest.split_once(')')).map_or(rest, |(_, r)| r)
        });
        let (keyword, rest) = item.trim_start().split_once(' ')?;
        let is_type = matches!(keyword, "struct" | "enum" | "trait");
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        (is_type && end > 0).then(|| &rest[..end])
    })
}

#[test]
fn a_type_name_means_one_thing() {
    let mut rooms: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    let mut count: BTreeMap<String, usize> = BTreeMap::new();
    for (path, text) in sources() {
        let room = path.split('/').nth(1).unwrap_or_default().to_owned();
        for name in defined_types(&text) {
            rooms.entry(name.to_owned()).or_default().insert(room.clone());
            *count.entry(name.to_owned()).or_default() += 1;
        }
    }
    assert!(count.len() > 500, "only {} types were found", count.len());
    let often: Vec<_> = count.iter().filter(|(_, times)| **times > 2).collect();
    let wide: Vec<_> = rooms.iter().filter(|(_, rooms)| rooms.len() > 2).collect();
    assert!(often.is_empty() && wide.is_empty(), "defined too often: {often:?} {wide:?}");
}

#[test]
fn errors_are_called_errors() {
    for (path, text) in sources() {
        let lines: Vec<&str> = text.lines().collect();
        for (i, line) in lines.iter().enumerate() {
            let derives = line.trim_start().starts_with("#[derive(");
            let is_error = derives && (line.contains("Error)") || line.contains("Error,"));
            let Some(item) = lines[i..].iter().find(|line| defined_types(line).next().is_some())
            else {
                continue;
            };
            let name = defined_types(item).next().unwrap_or_default();
            assert!(!is_error || name.ends_with("Error"), "{path}: the error {name}");
        }
    }
}

/// True if a doc comment begins as a bare clause ("How far a run is.") instead of naming the thing.
fn is_bare_clause(line: &str) -> bool {
    let text = line.trim_start();
    let Some(text) = text.strip_prefix("///").or_else(|| text.strip_prefix("//!")) else {
        return false;
    };
    let first = text.split_whitespace().next().unwrap_or_default();
    ["What", "How", "Where", "Which", "Whether", "Why", "When", "Who"].contains(&first)
}

#[test]
fn documentation_names_the_thing() {
    let mut bare = Vec::new();
    let mut all = 0;
    for (path, text) in sources() {
        let mut before = "";
        for (i, line) in text.lines().enumerate() {
            let is_doc = |line: &str| {
                let line = line.trim_start();
                line.starts_with("///") || line.starts_with("//!")
            };
            if is_doc(line) && !is_doc(before) {
                all += 1;
                if is_bare_clause(line) {
                    bare.push(format!("{path}:{}: {}", i + 1, line.trim()));
                }
            }
            before = line;
        }
    }
    assert!(all > 5_000, "only {all} were found");
    assert!(bare.is_empty(), "these begin as bare clauses:\n{}", bare.join("\n"));
}
