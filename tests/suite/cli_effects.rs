//! The switches of the effects on the command line: what is off is not computed, what is left to the
//! plan changes no number beyond its error, and a switch that cannot be followed is refused.

use super::cli::{Scratch, done, done_json, refused};
use serde_json::{Value, json};

const GAUSS: &str = "lenses/double_gauss_rudolph_50.json";
const ASPHERE: &str = "lenses/double_gauss_canon_fd50_f12.json";
const TRIPLET: &str = "lenses/cooke_triplet_100_f27.json";
const WOOD: &str = "lenses/wood_lens_60.json";

/// A copy of a lens file with some of its numbers changed.
fn edited(name: &str, lens: &str, edit: impl Fn(&mut Value)) -> Scratch {
    let mut file: Value = serde_json::from_str(&std::fs::read_to_string(lens).unwrap()).unwrap();
    edit(&mut file);
    Scratch::with(name, &file.to_string())
}

/// The lens with its primary wavelength alone.
fn of_one_wavelength(name: &str, lens: &str) -> Scratch {
    edited(name, lens, |file| file["wavelengths"] = json!([{"um": 0.5875618, "primary": true}]))
}

/// The lens without its aspheric terms.
fn without_aspheres(name: &str, lens: &str) -> Scratch {
    edited(name, lens, |file| {
        for row in file["surfaces"].as_array_mut().unwrap() {
            row.as_object_mut().unwrap().remove("asphere");
        }
    })
}

/// The keys that differ between two runs of the same computation, and those of the errors, which
/// count what is left out.
const VOLATILE: [&str; 11] = [
    "milliseconds",
    "ms",
    "figures_ms",
    "error",
    "d_error",
    "reached",
    "radius_reached",
    "effects",
    "not_counted",
    "out",
    "files",
];

/// A result without times, errors and the report of the effects.
fn plain(mut value: Value) -> Value {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(map) => {
                VOLATILE.iter().for_each(|key| drop(map.remove(*key)));
                map.values_mut().for_each(strip);
            }
            Value::Array(list) => list.iter_mut().for_each(strip),
            _ => {}
        }
    }
    strip(&mut value);
    value
}

/// The result of a command with all effects on except those of `switches`.
fn run(command: &[&str], lens: &str, switches: &str) -> Value {
    let mut arguments = vec![command[0], lens];
    arguments.extend(&command[1..]);
    arguments.extend(["--effects", switches]);
    plain(done_json(&arguments, ""))
}

/// Rays are counted in these results: equal results are equal work.
#[test]
fn an_analysis_without_an_effect_is_that_of_a_lens_without_it() {
    let mono = of_one_wavelength("mono.json", GAUSS);
    let bare = without_aspheres("bare.json", ASPHERE);
    for what in ["spot", "fan", "through-focus"] {
        let command = ["analyze", what];
        let off = run(&command, GAUSS, "all=on,dispersion=off");
        assert_eq!(off, run(&command, mono.path(), "all=on"), "{what}");
    }
    for what in ["spot", "distortion", "field-curvature", "illumination"] {
        let command = ["analyze", what];
        let off = run(&command, ASPHERE, "all=on,asphere=off");
        assert_eq!(off, run(&command, bare.path(), "all=on"), "{what}");
    }
    let command = ["gradient", "--error", "1e-4"];
    let off = run(&command, GAUSS, "all=on,dispersion=off");
    assert_eq!(off, run(&command, mono.path(), "all=on"));
    let off = run(&command, ASPHERE, "all=on,asphere=off");
    assert_eq!(off, run(&command, bare.path(), "all=on"));
}

#[test]
fn rays_without_an_effect_are_those_through_a_lens_without_it() {
    let rays = json!({"rays": [{"x": 1.0, "y": 12.0, "z": 0.0, "L": 0.0, "M": 0.0, "N": 1.0}]});
    let rays = Scratch::with("given.json", &rays.to_string());
    let command = ["trace", "--rays", rays.path()];
    let bare = without_aspheres("traced.json", ASPHERE);
    let off = run(&command, ASPHERE, "asphere=off");
    assert_eq!(off, run(&command, bare.path(), "all=auto"));
    assert_ne!(off, run(&command, ASPHERE, "all=on"));
    let base = edited("base.json", WOOD, |file| {
        file["variables"] = json!([]);
        for row in file["surfaces"].as_array_mut().unwrap() {
            if let Some(base) = row["glass"]["gradient"].get("base").cloned() {
                row["glass"] = base;
            }
        }
    });
    let rays = json!({"rays": [{"x": 0.0, "y": 2.0, "z": 0.0, "L": 0.0, "M": 0.0, "N": 1.0}]});
    let rays = Scratch::with("given-wood.json", &rays.to_string());
    let command = ["trace", "--rays", rays.path()];
    let off = run(&command, WOOD, "gradient=off");
    assert_eq!(off, run(&command, base.path(), "all=on"));
    assert_ne!(off, run(&command, WOOD, "all=on"));
    // Without the rims the ray outside them arrives.
    let open = json!({"rays": [{"x": 0.0, "y": 6.2, "z": 0.0, "L": 0.0, "M": 0.0, "N": 1.0}]});
    let fate = |more: &[&str]| {
        let arguments = [&["trace", GAUSS, "--rays", "-"], more].concat();
        done_json(&arguments, &open.to_string())["rays"][0]["fate"].clone()
    };
    assert_eq!(fate(&[]), "clipped");
    assert_eq!(fate(&["--effects", "clipping=off"]), "imaged");
}

#[test]
fn a_design_without_dispersion_is_that_at_one_wavelength() {
    let mono = of_one_wavelength("mono-design.json", GAUSS);
    let (all, one) = (Scratch::new("all-colours.json"), Scratch::new("one-colour.json"));
    let off = "dispersion=off";
    let optimize = |lens: &str, out: &str, switches: &str| {
        let more = ["--out", out, "--steps", "4", "--vary", "curvatures", "--error", "1%"];
        run(&[&["optimize"][..], &more].concat(), lens, switches)
    };
    let found = optimize(GAUSS, all.path(), off);
    assert_eq!(found, optimize(mono.path(), one.path(), "all=auto"));
    assert!(found["terms"][0]["after"]["rays"].as_u64().unwrap() > 0);
    let saved: Value = serde_json::from_str(&std::fs::read_to_string(&all.0).unwrap()).unwrap();
    assert_eq!(saved["wavelengths"].as_array().unwrap().len(), 3);

    let pareto = ["pareto", "--points", "2", "--steps", "3", "--error", "1%", "--no-biased"];
    assert_eq!(run(&pareto, GAUSS, off), run(&pareto, mono.path(), "all=auto"));
    let search = |lens: &str, out: &str, switches: &str| {
        run(&["search", "--iterations", "300", "--out", out], lens, switches)
    };
    assert_eq!(search(GAUSS, all.path(), off), search(mono.path(), one.path(), "all=auto"));
    let saved: Value = serde_json::from_str(&std::fs::read_to_string(&all.0).unwrap()).unwrap();
    assert_eq!(saved["wavelengths"].as_array().unwrap().len(), 3);
}

/// Checks that every number of two results agrees within the sum of the errors.
fn agree(a: &Value, b: &Value, place: &str) -> usize {
    let number = |value: &Value, key: &str| value.get(key).and_then(Value::as_f64);
    match (a, b) {
        (Value::Object(map), Value::Object(_)) if map.contains_key("value") => {
            let read = |v: &Value| (number(v, "value").unwrap(), number(v, "error").unwrap());
            let ((a, a_error), (b, b_error)) = (read(a), read(b));
            let allowed = a_error + b_error + 1e-15;
            assert!((a - b).abs() <= allowed, "{place}: {a} and {b}, allowed {allowed:e}");
            1
        }
        (Value::Object(map), Value::Object(_)) => {
            let listed =
                map.iter().filter(|(key, _)| !["effects", "colors"].contains(&key.as_str()));
            listed.map(|(key, value)| agree(value, &b[key], &format!("{place}/{key}"))).sum()
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{place}");
            let pairs = a.iter().zip(b).enumerate();
            pairs.map(|(i, (a, b))| agree(a, b, &format!("{place}/{i}"))).sum()
        }
        _ => 0,
    }
}

#[test]
fn numbers_left_to_the_plan_agree_with_those_of_all_effects() {
    let zoom = "lenses/zoom_nikkor_28_80.json";
    let telescope = "lenses/telescope_rc_f8.json";
    let (mut numbers, mut left_out) = (0, 0);
    for lens in
        [GAUSS, ASPHERE, TRIPLET, WOOD, zoom, telescope, "lenses/petzval_kodak_100_f22.json"]
    {
        for what in ["spot", "distortion", "field-curvature", "illumination", "through-focus"] {
            let arguments = ["analyze", lens, what, "--error", "1%"];
            let auto = done_json(&arguments, "");
            let on = done_json(&[&arguments[..], &["--effects", "all=on"]].concat(), "");
            numbers += agree(&auto, &on, &format!("{lens} {what}"));
            let effects = auto["effects"].as_array().unwrap();
            assert_eq!(effects.len(), 10);
            let differ = |(a, b): &(&Value, &Value)| a["computed"] != b["computed"];
            let on = on["effects"].as_array().unwrap();
            left_out += effects.iter().zip(on).filter(differ).count();
        }
    }
    assert!(numbers > 300 && left_out > 5, "{numbers} numbers, {left_out} effects left out");
}

/// A ray of a fan has its place in the pupil of the real stop: where aiming moves it, it is aimed, even if the
/// spot and the light are the same either way.
#[test]
fn rays_of_fans_have_their_places_in_the_real_stop() {
    for name in ["singlet_la1131", "achromat_ac254_100", "telescope_rc_f8", "wood_lens_60"] {
        let lens = format!("lenses/{name}.json");
        let auto = done_json(&["analyze", &lens, "fan"], "");
        let on = done_json(&["analyze", &lens, "fan", "--effects", "aiming=on"], "");
        let [auto, on] = [&auto, &on].map(|fans| fan_rays(&fans["fields"]));
        assert!(auto.len() > 60 && auto.len() == on.len(), "{name}");
        for ((fate, a), (other, b)) in auto.iter().zip(&on) {
            assert_eq!(fate, other, "{name}");
            let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart < 2e-8, "{name}: {a:?} and {b:?}");
        }
    }
}

/// The fates and image points of all rays of some fans, in order.
fn fan_rays(value: &Value) -> Vec<(String, [f64; 2])> {
    match value {
        Value::Object(map) => {
            let at = |key: &str| map.get(key).and_then(Value::as_f64).unwrap_or(0.0);
            let own = map.get("fate").and_then(Value::as_str);
            let own = own.map(|fate| (fate.to_owned(), [at("dx"), at("dy")]));
            own.into_iter().chain(map.values().flat_map(fan_rays)).collect()
        }
        Value::Array(all) => all.iter().flat_map(fan_rays).collect(),
        _ => Vec::new(),
    }
}

#[test]
fn derivatives_left_to_the_plan_agree_with_those_of_all_effects() {
    for lens in [GAUSS, TRIPLET, WOOD] {
        let arguments = ["gradient", lens, "--error", "1e-5", "--field", "2"];
        let auto = done_json(&arguments, "");
        let on = done_json(&[&arguments[..], &["--effects", "all=on"]].concat(), "");
        for key in ["curvature", "thickness", "semi_diameter", "index"] {
            let column = |report: &Value, which: &str| -> Vec<f64> {
                let list = report[which][key].as_array().unwrap().clone();
                list.iter().map(|v| v.as_f64().unwrap_or(0.0)).collect()
            };
            let largest = column(&on, "d").iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            let errors = column(&on, "d_error").into_iter().zip(column(&auto, "d_error"));
            let pairs = column(&on, "d").into_iter().zip(column(&auto, "d")).zip(errors);
            for ((a, b), (a_error, b_error)) in pairs {
                let allowed = a_error + b_error + 1e-10 * largest;
                assert!((a - b).abs() <= allowed, "{lens} {key}: {a} and {b}, {allowed:e}");
            }
        }
    }
}

/// The numbers of a field with an effect switched off, and those with all effects on.
fn switched_off(lens: &str, what: &str, effect: &str) -> [Value; 2] {
    let off = format!("all=on,{effect}=off");
    [off.as_str(), "all=on"].map(|switches| {
        done_json(&["analyze", lens, what, "--error", "1e-5", "--effects", switches], "")
    })
}

#[test]
fn errors_count_what_is_switched_off() {
    let cases = [
        (TRIPLET, "spot", "aiming", &["rms", "centroid_y"][..]),
        (GAUSS, "spot", "dispersion", &["rms", "radius", "centroid_y"]),
        (ASPHERE, "spot", "asphere", &["rms", "radius", "centroid_y"]),
        (ASPHERE, "distortion", "asphere", &["height"]),
    ];
    for (lens, what, effect, keys) in cases {
        let [off, on] = switched_off(lens, what, effect);
        let mut changed = 0;
        for (off, on) in
            off["fields"].as_array().unwrap().iter().zip(on["fields"].as_array().unwrap())
        {
            for key in keys {
                let read = |v: &Value, part: &str| v[key][part].as_f64().unwrap();
                let change = (read(off, "value") - read(on, "value")).abs();
                let allowed = read(off, "error") + read(on, "error");
                assert!(change <= allowed, "{lens} {effect} {key}: {change} of {allowed}");
                changed += usize::from(change > read(on, "error"));
            }
            assert!(what != "spot" || off["reached"] == false, "{lens} {effect}");
        }
        assert!(changed > 0, "{lens} {what} {effect} changes nothing");
        assert!(off.get("not_counted").is_none(), "{off}");
    }
}

#[test]
fn what_no_error_counts_is_said() {
    for (what, effect) in
        [("spot", "clipping"), ("field-curvature", "asphere"), ("wavefront", "clipping")]
    {
        let [off, on] = switched_off(ASPHERE, what, effect);
        assert_eq!(off["not_counted"], json!([effect]), "{what}");
        assert!(on.get("not_counted").is_none(), "{on}");
    }
    let told = done(&["analyze", ASPHERE, "spot", "--effects", "clipping=off"], "");
    assert!(told.contains("switched off, and not counted in the errors: clipping"), "{told}");
    let told = done(&["gradient", GAUSS, "--effects", "dispersion=off"], "");
    assert!(told.contains("not counted in the errors: dispersion"), "{told}");
    let out = Scratch::new("told.json");
    let optimize = ["optimize", GAUSS, "--out", out.path(), "--steps", "1", "--vary", "curvatures"];
    let told = done(&[&optimize[..], &["--effects", "dispersion=off"]].concat(), "");
    assert!(told.contains("not counted in the errors: dispersion"), "{told}");
    assert!(!done(&optimize, "").contains("not counted"));
}

#[test]
fn a_switch_that_cannot_be_followed_is_refused_by_name() {
    let refuse = |command: &[&str], switches: &str, words: &[&str]| {
        let arguments = [command, &["--effects", switches]].concat();
        let effect = switches.split('=').next().unwrap().replace('_', "-");
        refused(2, &arguments, "", &[&["--effects", effect.as_str()], words].concat());
    };
    let out = Scratch::new("refused.json");
    let optimize = ["optimize", GAUSS, "--out", out.path()];
    let search = ["search", GAUSS, "--iterations", "10"];
    for command in [&optimize[..], &["pareto", GAUSS], &search] {
        refuse(command, "aiming=off", &["off here", "fills the real stop"]);
        refuse(command, "clipping=off", &["semi-diameters"]);
        refuse(command, "asphere=off", &["numbers of the lens"]);
        refuse(command, "finite-object=off", &["merit function"]);
        refuse(command, "gradient=off", &["numbers of the lens"]);
    }
    let one = [&search[..], &["--wavelength", "0.55"]].concat();
    refuse(&one, "dispersion=on", &["on here", "--wavelength leaves one"]);
    let irradiance = ["analyze", GAUSS, "illumination"];
    refuse(&irradiance, "clipping=off", &["off here", "from every direction"]);
    refuse(&["gradient", GAUSS], "aiming=off", &["real stop"]);
    refuse(&["trace", GAUSS, "--rays", "-"], "aiming=on", &["none is aimed"]);
    refuse(&["trace", GAUSS, "--rays", "-"], "dispersion=on", &["one wavelength"]);
    for effect in ["dispersion", "aiming", "finite-object"] {
        refuse(&["trace", GAUSS, "--rays", "-"], &format!("{effect}=off"), &["off here: the rays"]);
    }
    refuse(&["analyze", GAUSS, "distortion"], "dispersion=on", &["only the primary wavelength"]);
    refuse(&["analyze", GAUSS, "distortion"], "finite_object=off", &["where it is"]);
    refuse(&["analyze", GAUSS, "spot"], "total-reflection=off", &["part of refraction"]);
    refuse(&["info", GAUSS], "total_reflection=off", &["part of refraction"]);
    refuse(&["info", GAUSS], "colour=off", &["no effect `colour`", "dispersion, asphere"]);
    refuse(&["info", GAUSS], "aiming=maybe", &["aiming=auto"]);
    refuse(&["info", GAUSS], "aiming", &["aiming=auto"]);
    refuse(&["info", GAUSS], "aiming=on,all=on,aiming=on", &["switched twice"]);
    assert!(!out.0.exists());
}

#[test]
fn info_follows_the_switches_and_says_so() {
    let effects = |switches: &str| {
        let info = done_json(&["info", GAUSS, "--effects", switches], "");
        info["effects"].as_array().unwrap().clone()
    };
    let of = |effects: &[Value], name: &str| {
        effects.iter().find(|effect| effect["effect"] == name).unwrap().clone()
    };
    let off = effects("dispersion=off,asphere=on");
    assert_eq!(of(&off, "dispersion")["choice"], "off");
    assert_eq!(of(&off, "dispersion")["computed"], false);
    assert!(of(&off, "dispersion")["left"].as_f64().unwrap() > 0.0);
    assert_eq!(of(&off, "asphere")["choice"], "on");
    assert_eq!(of(&effects("all=auto"), "dispersion")["choice"], "auto");
    let page = done(&["info", GAUSS, "--effects", "dispersion=off"], "");
    assert!(page.contains("omitted   switched off: the 3 wavelengths"), "{page}");
    assert!(done(&["help", "effects"], "").contains("--effects NAME=SETTING"));
}
