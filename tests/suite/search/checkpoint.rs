//! A run resumes from its file unchanged, and other files are refused.

use super::chain::settings;
use super::rugged::{Fault, Rugged, START};
use aplanat::files::CheckpointError;
use aplanat::search::lens_landscape::LensLandscape;
use aplanat::search::{
    MutationKind, Refusal, SearchError, SearchMethod, SearchRun, SearchRunOn, SearchSettings,
    SteerCommand, Temperature,
};
use serde_json::Value;
use std::fs;
use std::path::PathBuf;

/// A folder of its own for a test.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("search").join(name);
    fs::create_dir_all(&folder).unwrap();
    folder
}

fn after(rounds: usize, settings: &SearchSettings) -> SearchRunOn<Rugged> {
    let mut run = SearchRun::new(&Rugged::default(), START, settings).unwrap();
    (0..rounds).for_each(|_| drop(run.round(&Rugged::default())));
    run
}

#[test]
fn a_resumed_run_is_bit_identical() {
    let path = folder("resume").join("run.json");
    for method in [SearchMethod::Restore, SearchMethod::Metropolis, SearchMethod::BruteForce] {
        for value in [None, Some(0.0), Some(f64::INFINITY)] {
            let temperature = value.and_then(Temperature::new);
            let settings = SearchSettings { temperature, remembered: 30, ..settings(method) };
            let whole = after(200, &settings);
            after(100, &settings).save(&Rugged::default(), &path).unwrap();
            let mut resumed: SearchRunOn<Rugged> =
                SearchRun::load(&Rugged::default(), &settings, &path).unwrap();
            (0..100).for_each(|_| drop(resumed.round(&Rugged::default())));
            assert!(resumed == whole, "{method:?} at {value:?}");
            assert!(whole.statistics().moves > 300);
        }
    }
}

#[test]
fn steering_commands_are_stored_in_the_checkpoint() {
    let path = folder("steered").join("run.json");
    let landscape = Rugged::default();
    let mut run = after(40, &settings(SearchMethod::Restore));
    for steer in [SteerCommand::Pin(0), SteerCommand::Reheat, SteerCommand::Stop] {
        run.steer(&landscape, steer).unwrap();
    }
    run.save(&landscape, &path).unwrap();
    assert!(SearchRun::load(&landscape, run.settings(), &path).unwrap() == run);
}

#[test]
fn a_resumed_run_may_only_change_its_limits() {
    let path = folder("settings").join("run.json");
    let landscape = Rugged::default();
    let first = settings(SearchMethod::Restore);
    after(10, &first).save(&landscape, &path).unwrap();
    let load = |settings: &SearchSettings| SearchRun::load(&landscape, settings, &path);
    let later = SearchSettings { gradients: None, moves: Some(50), ..first.clone() };
    assert_eq!(load(&later).unwrap().settings(), &later);
    let others = [
        ("settings.seed", "7", SearchSettings { seed: 8, ..first.clone() }),
        ("settings.gamma", "0.02", SearchSettings { gamma: 0.5, ..first.clone() }),
        ("settings.chains", "4", SearchSettings { chains: 2, ..first.clone() }),
        (
            "settings.method",
            "restore",
            SearchSettings { method: SearchMethod::Metropolis, ..first.clone() },
        ),
        (
            "settings.temperature",
            "null",
            SearchSettings { temperature: Temperature::new(2.0), ..first.clone() },
        ),
    ];
    for (name, found, other) in others {
        let message = load(&other).unwrap_err().to_string();
        assert!(message.contains(name) && message.contains(found), "{message}");
    }
    let elsewhere = Rugged::with(Fault::Flat);
    let message = SearchRun::load(&elsewhere, &first, &path).unwrap_err().to_string();
    assert!(message.contains("landscape.fault is \"Nothing\" there"), "{message}");
}

#[test]
fn brute_force_divides_its_gradients() {
    let path = folder("brute").join("run.json");
    let first = settings(SearchMethod::BruteForce);
    after(3, &first).save(&Rugged::default(), &path).unwrap();
    let more = SearchSettings { gradients: Some(40_000), ..first };
    let error = SearchRun::<_, super::rugged::Momentum>::load(&Rugged::default(), &more, &path)
        .unwrap_err();
    assert!(error.to_string().contains("settings.gradients"), "{error}");
}

#[test]
fn a_damaged_file_is_refused() {
    let folder = folder("damaged");
    let (good, bad) = (folder.join("good.json"), folder.join("bad.json"));
    let first = settings(SearchMethod::Restore);
    after(30, &first).save(&Rugged::default(), &good).unwrap();
    let bytes = fs::read(&good).unwrap();
    let text = String::from_utf8(bytes.clone()).unwrap();
    let load = |bytes: &[u8]| {
        fs::write(&bad, bytes).unwrap();
        let loaded: Result<SearchRunOn<Rugged>, _> =
            SearchRun::load(&Rugged::default(), &first, &bad);
        loaded.unwrap_err()
    };
    let mut damaged: Vec<Vec<u8>> =
        (0..20).map(|i| bytes[..i * bytes.len() / 20].to_vec()).collect();
    damaged.push(bytes[..bytes.len() - 1].to_vec());
    damaged.push(text.replace("\"descended\"", "\"ascended\"").into_bytes());
    damaged.push(text.replace("\"chains\":4", "\"chains\":3").into_bytes());
    damaged.push(text.replace("\"temperature\":", "\"temperature\":-").into_bytes());
    damaged.push(b"[1, 2]".to_vec());
    damaged.push(vec![0xff; 100]);
    for bytes in damaged {
        let error = load(&bytes);
        let told = matches!(&error, SearchError::Checkpoint(CheckpointError::Corrupt { what, .. }) if !what.is_empty());
        assert!(told && error.to_string().contains("bad.json"), "{error}");
    }
    let newer = text.replacen("\"aplanat_search\":3", "\"aplanat_search\":4", 1);
    let error = load(newer.as_bytes());
    assert!(
        matches!(
            error,
            SearchError::Checkpoint(CheckpointError::UnsupportedVersion {
                found: 4,
                expected: 3,
                ..
            })
        ),
        "{error}"
    );
    let missing = SearchRun::<_, super::rugged::Momentum>::load(
        &Rugged::default(),
        &first,
        &folder.join("none"),
    );
    assert!(matches!(missing, Err(SearchError::Checkpoint(CheckpointError::File(_)))));
}

/// A digit that is another one makes a sound file with other numbers.
#[test]
fn one_wrong_digit_is_noticed() {
    let folder = folder("digits");
    let (good, bad) = (folder.join("good.json"), folder.join("bad.json"));
    let first = settings(SearchMethod::Restore);
    after(30, &first).save(&Rugged::default(), &good).unwrap();
    let bytes = fs::read(&good).unwrap();
    let digits: Vec<usize> = (0..bytes.len()).filter(|i| bytes[*i].is_ascii_digit()).collect();
    let mut count = 0;
    for at in digits.iter().step_by(digits.len() / 150) {
        let mut damaged = bytes.clone();
        damaged[*at] = if bytes[*at] == b'7' { b'8' } else { b'7' };
        fs::write(&bad, damaged).unwrap();
        let loaded: Result<SearchRunOn<Rugged>, _> =
            SearchRun::load(&Rugged::default(), &first, &bad);
        let error = loaded.err().map(|error| error.to_string()).unwrap_or_default();
        assert!(error.contains("bad.json"), "a wrong digit at {at} is taken: {error}");
        count += 1;
    }
    assert!(count > 100, "{count}");
}

/// A file of an older version has no checksum; what it says of its best point is not believed.
#[test]
fn the_best_points_of_a_file_are_judged_anew() {
    let path = folder("judged").join("run.json");
    let (landscape, first) = (Rugged::default(), settings(SearchMethod::Restore));
    let run = after(60, &first);
    run.save(&landscape, &path).unwrap();
    let mut file: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    file["aplanat_search"] = 2.into();
    file.as_object_mut().unwrap().remove("checksum");
    let load = |file: &Value| -> SearchRunOn<Rugged> {
        fs::write(&path, file.to_string()).unwrap();
        SearchRun::load(&landscape, &first, &path).unwrap()
    };
    assert!(load(&file) == run, "an old file is read as it is");
    let mut wrong = file.clone();
    wrong["run"]["best"]["loss"] = (-1e3).into();
    assert!(load(&wrong) == run);
    let mut wrong = file.clone();
    wrong["run"]["reservoir"]["entries"][0]["loss"] = (-1e3).into();
    assert!(load(&wrong) == run);
    let mut wrong = file;
    wrong["run"]["best"]["point"] = wrong["run"]["start"]["point"].clone();
    let judged = load(&wrong);
    let best = judged.best();
    assert_eq!(best.loss, aplanat::search::Landscape::loss(&landscape, &best.point));
    let retained = judged.reservoir().best().unwrap();
    assert!(best.loss <= retained.loss.min(judged.start().loss));
}

#[test]
fn a_failed_save_leaves_the_existing_file() {
    let folder = folder("unwritable");
    let run = after(5, &settings(SearchMethod::Restore));
    assert!(run.save(&Rugged::default(), &folder).is_err());
    let path = folder.join("run.json");
    run.save(&Rugged::default(), &path).unwrap();
    let value: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    assert_eq!(value["aplanat_search"], 3);
    let left = fs::read_dir(&folder).unwrap().count();
    assert_eq!(left, 1, "something was left beside it");
}

/// A checkpoint of version 1 describes mutations and refusals as text.
#[test]
fn a_checkpoint_of_version_1_resumes() {
    let path = PathBuf::from("tests/files/search_checkpoint_v1.json");
    let saved: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let about = &saved["landscape"];
    let landscape = LensLandscape::new(
        &serde_json::from_value(about["start"].clone()).unwrap(),
        &serde_json::from_value(about["goal"].clone()).unwrap(),
        &serde_json::from_value(about["rules"].clone()).unwrap(),
        &serde_json::from_value(about["local"].clone()).unwrap(),
    );
    let light = serde_json::from_value(about["light"].clone()).unwrap();
    let landscape = landscape.unwrap().with_reference_light(light).unwrap();
    let settings: SearchSettings =
        serde_json::from_value(saved["run"]["settings"].clone()).unwrap();
    let more = SearchSettings { gradients: None, ..settings };
    let mut run: SearchRunOn<LensLandscape> = SearchRun::load(&landscape, &more, &path).unwrap();
    let texts: Vec<String> =
        run.lineage().nodes().iter().map(|node| node.mutation.to_string()).collect();
    assert_eq!(texts[0], "the start");
    assert!(texts[1].starts_with("removed the singlet of surfaces 8 and 9;"), "{}", texts[1]);
    let glue = &run.statistics().kinds[&MutationKind::Glue];
    assert_eq!(glue.refused, [(Refusal::Other, 1)].into());
    run.round(&landscape);
    let copy = folder("version_1").join("run.json");
    run.save(&landscape, &copy).unwrap();
    assert!(SearchRun::load(&landscape, &more, &copy).unwrap() == run);
}
