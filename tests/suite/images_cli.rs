//! The cases of `images.json` that commands answer: pupils, coatings, light, sensors and ghosts.

use crate::cli::{Scratch, aplanat, done, done_json, refused};
use crate::reference::{count, number, numbers, read};
use serde_json::{Value, json};

/// The absolute tolerance of integrals.
const INTEGRAL: f64 = 1e-9;

fn list(value: &Value) -> &Vec<Value> {
    value.as_array().unwrap()
}

/// Compares a number with an exact one.
fn close(found: &Value, exact: &Value, tolerance: f64, place: &str) {
    let (found, exact) = (number(found), number(exact));
    assert!((found - exact).abs() <= tolerance, "{place}: {found} and {exact}");
}

/// A pupil by options, with points, radii and frequencies.
fn pupil(options: &[&str], asked: &[String]) -> Value {
    let asked: Vec<&str> = asked.iter().map(String::as_str).collect();
    done_json(&[&["calc", "pupil"], options, &asked].concat(), "")
}

#[test]
fn the_pupils_of_the_books() {
    let file = read("images.json");
    for exact in list(&file["airy"]) {
        let [um, f_number] = ["wavelength_um", "f_number"].map(|key| number(&exact[key]));
        let unit = 1e-3 * um * f_number;
        let mut asked = Vec::new();
        for point in list(&exact["points"]) {
            let r = number(&point["r_over_lambdaN"]) * unit;
            asked.extend([format!("--at={r:.17},0"), format!("--radius={r:.17}")]);
        }
        asked.extend(
            list(&exact["otf"]).iter().map(|otf| format!("--frequency=0,{}", otf["frequency"])),
        );
        let options = [format!("--um={um}"), format!("--f-number={f_number}")];
        let found = pupil(&[&options[0], &options[1]], &asked);
        for (i, point) in list(&exact["points"]).iter().enumerate() {
            let place = format!("{point}");
            close(&found["points"][i]["intensity"], &point["intensity"], 1e-10, &place);
            close(&found["circles"][i]["energy"], &point["encircled"], INTEGRAL, &place);
        }
        for (i, otf) in list(&exact["otf"]).iter().enumerate() {
            close(&found["transfer"][i]["re"], &otf["value"], INTEGRAL, &otf.to_string());
        }
    }
}

#[test]
fn rings_have_their_share_of_light_in_circles() {
    for exact in list(&read("images.json")["annular"]) {
        let unit = 0.5e-3 * 2.0;
        let asked: Vec<String> = list(&exact["points"])
            .iter()
            .map(|p| format!("--radius={:.17}", number(&p["r_over_lambdaN"]) * unit))
            .collect();
        let shadow = format!("--obscuration={}", exact["obscuration"]);
        let found = pupil(&["--um=0.5", "--f-number=2", &shadow], &asked);
        for (i, point) in list(&exact["points"]).iter().enumerate() {
            close(
                &found["circles"][i]["energy"],
                &point["encircled"],
                INTEGRAL,
                &point.to_string(),
            );
        }
    }
}

#[test]
fn aberrations_by_name_are_those_of_the_books() {
    let unit = 0.5e-3 * 2.0;
    for exact in list(&read("images.json")["aberrated_disc"]) {
        let terms = |key: &str, option: &str| -> Vec<String> {
            let all = exact[key].as_object().unwrap().iter();
            all.map(|(name, waves)| format!("--{option}={name}={waves}")).collect()
        };
        let mut asked = [terms("seidel_waves", "seidel"), terms("noll_waves", "noll")].concat();
        for point in list(&exact["psf"]) {
            let [x, y] = ["x_over_lambdaN", "y_over_lambdaN"].map(|key| number(&point[key]) * unit);
            asked.push(format!("--at={x:.17},{y:.17}"));
        }
        for otf in list(&exact["otf"]) {
            let [x, y] = ["fx_over_cutoff", "fy_over_cutoff"].map(|key| number(&otf[key]) / unit);
            asked.push(format!("--frequency={x:.17},{y:.17}"));
        }
        let found = pupil(&["--um=0.5", "--f-number=2"], &asked);
        close(&found["strehl"], &exact["strehl_at_origin"], INTEGRAL, "Strehl");
        for (i, point) in list(&exact["psf"]).iter().enumerate() {
            close(&found["points"][i]["intensity"], &point["value"], INTEGRAL, &point.to_string());
        }
        for (i, otf) in list(&exact["otf"]).iter().enumerate() {
            close(&found["transfer"][i]["re"], &otf["re"], INTEGRAL, &otf.to_string());
            close(&found["transfer"][i]["im"], &otf["im"], INTEGRAL, &otf.to_string());
        }
    }
}

#[test]
fn pupils_in_pieces_by_options() {
    for exact in list(&read("images.json")["other_pupils"]) {
        let mut asked = vec![format!("--um={}", exact["wavelength_um"])];
        match exact["kind"].as_str().unwrap() {
            "discs" => asked.extend(list(&exact["discs"]).iter().map(|disc| {
                let d = numbers(disc);
                format!("--disc={},{},{}", d[0], d[1], d[2])
            })),
            "polygon" => asked.push(format!(
                "--polygon={},{},{}",
                exact["sides"], exact["circumradius"], exact["first_vertex_deg"]
            )),
            _ => {
                let centers = list(&exact["centres"]).iter().map(numbers);
                let disc =
                    |c: Vec<f64>| format!("--disc={},{},{}", c[0], c[1], exact["disc_radius"]);
                asked.extend(centers.map(disc));
                asked.push("--common".to_owned());
            }
        }
        asked.extend(list(&exact["psf"]).iter().map(|p| format!("--at={},{}", p["x"], p["y"])));
        let frequency = |otf: &Value| format!("--frequency={},{}", otf["nx"], otf["ny"]);
        asked.extend(list(&exact["otf"]).iter().map(frequency));
        let found = pupil(&[], &asked);
        for (i, point) in list(&exact["psf"]).iter().enumerate() {
            close(&found["points"][i]["intensity"], &point["value"], INTEGRAL, &point.to_string());
        }
        for (i, otf) in list(&exact["otf"]).iter().enumerate() {
            close(&found["transfer"][i]["re"], &otf["value"], INTEGRAL, &otf.to_string());
        }
    }
}

#[test]
fn coatings_reflect_what_the_books_say() {
    let mut compared = 0;
    for exact in list(&read("images.json")["fresnel"]) {
        let mut asked: Vec<String> = ["from", "to", "um", "angle"]
            .into_iter()
            .zip(["n0", "ns", "wavelength_um", "angle_deg"])
            .map(|(option, key)| format!("--{option}={}", exact[key]))
            .collect();
        let films = list(&exact["layers_from_the_incident_side"]).iter();
        asked.extend(films.map(|film| format!("--film={}:{}", film["n"], film["nm"])));
        let asked: Vec<&str> = asked.iter().map(String::as_str).collect();
        let found = done_json(&[&["calc", "coating"], &asked[..]].concat(), "");
        for (key, name) in [("R_s", "s"), ("R_p", "p"), ("R", "mean")] {
            let size = number(&exact[key]);
            // Digits below 1e-16 of the incident light are rounding.
            close(&found[name], &exact[key], 1e-12 * size + 1e-16, &exact.to_string());
            compared += 1;
        }
    }
    assert_eq!(compared, 156);
}

#[test]
fn light_and_noise_by_formula() {
    let file = read("images.json");
    let relative = |found: &Value, exact: &Value, place: &Value| {
        close(found, exact, 1e-12 * number(exact).abs(), &place.to_string());
    };
    let calc = |name: &str, options: &[(&str, &Value)]| {
        let options: Vec<String> = options.iter().map(|(k, v)| format!("--{k}={v}")).collect();
        let options: Vec<&str> = options.iter().map(String::as_str).collect();
        done_json(&[&["calc", name], &options[..]].concat(), "")
    };
    for e in list(&file["photons"]) {
        let options = [
            ("lux", &e["illuminance_lux"]),
            ("pixel", &e["pixel_um"]),
            ("seconds", &e["seconds"]),
            ("um", &e["wavelength_um"]),
        ];
        relative(&calc("photons", &options)["photons"], &e["photons"], e);
    }
    for e in list(&file["black_body_photon_radiance"]) {
        let options = [("kelvin", &e["kelvin"]), ("from", &e["from_nm"]), ("to", &e["to_nm"])];
        let found = calc("black-body", &options);
        relative(&found["photons_per_s_m2_sr"], &e["photons_per_s_m2_sr"], e);
    }
    for e in list(&file["motion"]) {
        let found = calc("smear", &[("way", &e["smear_mm"]), ("frequency", &e["frequency"])]);
        relative(&found["factor"], &e["factor"], e);
    }
    for e in list(&file["thin_lens_blur"]) {
        let options = [
            ("focal-length", &e["focal_length"]),
            ("f-number", &e["f_number"]),
            ("focus", &e["focus_mm"]),
            ("object", &e["object_mm"]),
        ];
        let found = calc("blur", &options);
        relative(&found["image_distance"], &e["image_distance"], e);
        relative(&found["blur_diameter"], &e["blur_diameter_mm"], e);
    }
}

#[test]
fn the_law_of_a_sensor_has_its_exact_moments() {
    for sensor in list(&read("images.json")["noise"]) {
        let options = [
            ("quantum-efficiency", "quantum_efficiency"),
            ("gain", "gain_dn_per_e"),
            ("read-noise", "read_noise_e"),
            ("dark", "dark_e"),
            ("black-level", "black_level_dn"),
            ("bits", "bits"),
            ("full-well", "full_well_e"),
        ];
        let options = options.map(|(option, key)| format!("--{option}={}", sensor[key]));
        for level in list(&sensor["levels"]) {
            let photons = format!("--photons={}", level["photons"]);
            let mut asked = vec!["calc", "noise", &photons];
            asked.extend(options.iter().map(String::as_str));
            let found = done_json(&asked, "");
            let place = level.to_string();
            // The file has ten to twelve digits of the sums.
            let size = number(&level["mean"]);
            close(&found["mean"], &level["mean"], 2e-11 * size, &place);
            close(
                &found["variance"],
                &level["variance"],
                2e-9 * number(&level["variance"]),
                &place,
            );
            for key in ["ideal_mean", "ideal_variance", "ideal_snr"] {
                close(&found[key], &level[key], 1e-12 * (1.0 + number(&level[key])), &place);
            }
        }
    }
}

/// The lens of the ghosts, with its indices at one wavelength, as a file.
fn ghost_lens(file: &Value) -> Scratch {
    let ghosts = &file["ghosts"];
    let lens = list(&file["lenses"]).iter().find(|lens| lens["id"] == ghosts["lens"]).unwrap();
    let stop = count(&lens["stop_surface"]);
    let row = |(i, row): (usize, &Value)| {
        let index = number(&ghosts["indices"][i]);
        let mut surface = json!({
            "curvature": row["radius"].as_f64().map_or(0.0, f64::recip),
            "thickness": row["thickness"],
            "semi_diameter": row["semi_diameter"],
        });
        if index != 1.0 {
            surface["glass"] = json!({ "index": index });
        }
        if i == stop {
            surface["stop"] = json!(true);
        }
        surface
    };
    let text = json!({
        "aplanat": 1,
        "name": "ghosts",
        "object": "infinity",
        "aperture": {"entrance_pupil_diameter": ghosts["epd"]},
        "fields": {"kind": "angle", "values": [{"y": 0.0}, {"y": 10.0}]},
        "wavelengths": [{"um": ghosts["wavelength_um"]}],
        "surfaces": list(&lens["surfaces"]).iter().enumerate().map(row).collect::<Vec<_>>(),
    });
    Scratch::with("ghosts.json", &text.to_string())
}

#[test]
fn ghosts_by_first_order_optics() {
    let file = read("images.json");
    let lens = ghost_lens(&file);
    let path = lens.0.to_str().unwrap();
    let found = done_json(&["analyze", path, "ghosts", "--field", "0"], "");
    let field = &found["fields"][0];
    let exact = &file["ghosts"];
    assert_eq!(field["pairs"], exact["pairs"]);
    close(&field["transmission"], &exact["transmission_direct"], 1e-12, "transmission");
    close(&field["ghost_flux"], &exact["ghost_flux_share"], 1e-12, "flux");
    for exact in list(&exact["ghosts"]) {
        let is_same = |ghost: &&Value| {
            ["first_reflection", "second_reflection"].iter().all(|key| ghost[key] == exact[key])
        };
        let found = list(&field["ghosts"]).iter().find(is_same).unwrap();
        let [[a, b], [c, d]] = [0, 1].map(|i| [0, 1].map(|k| &found["matrix"][i][k]));
        let pairs = [
            (a, "A"),
            (b, "B"),
            (c, "C"),
            (d, "D"),
            (&found["focal_length"], "ghost_focal_length"),
            (&found["focus"], "ghost_image_from_image_plane"),
            (&found["paraxial_radius"], "sensor_radius_full_beam"),
            (&found["clip_factor"], "clip_factor"),
            (&found["height_per_tangent"], "height_per_tan"),
            (&found["reflected"], "reflectance_product"),
            (&found["transmitted"], "transmitted"),
            (&found["paraxial_irradiance"], "irradiance_over_entrance"),
        ];
        for (found, key) in pairs {
            let size = number(&exact[key]).abs();
            close(found, &exact[key], 1e-10 * size + 1e-13, &format!("{key} of {exact}"));
        }
        assert_eq!(found["clipped_at"], exact["clipped_at"], "{exact}");
        // Light that first-order optics lets arrive does so by real rays too, near the axis.
        assert!(found["fates"]["imaged"].as_u64().unwrap() > 0, "{found}");
    }
}

#[test]
fn rays_of_ghosts_with_their_light() {
    let file = read("images.json");
    let lens = ghost_lens(&file);
    let path = lens.0.to_str().unwrap();
    let mut compared = 0;
    for exact in list(&file["ghosts"]["real_meridional_rays"]) {
        let (sin, cos) = number(&exact["field_deg"]).to_radians().sin_cos();
        let ray = json!({"x": 0.0, "y": exact["y0"], "z": 0.0, "L": 0.0, "M": sin, "N": cos});
        let rays = json!({ "rays": [ray] }).to_string();
        let surface = |key: &str| count(&exact[key]) + 1;
        let ghost =
            format!("--ghost={},{}", surface("first_reflection"), surface("second_reflection"));
        let follow = |more: &[&str]| {
            let arguments = ["trace", path, "--rays", "-", &ghost];
            done_json(&[&arguments[..], more].concat(), &rays)["rays"][0].clone()
        };
        let (clipped, free) = (follow(&[]), follow(&["--unclipped"]));
        let status = exact["status"].as_str().unwrap();
        let fate = match status {
            "ok" => "imaged",
            "tir" => "total_reflection",
            "miss" => "missed",
            other => other,
        };
        if fate == "imaged" || fate == "clipped" {
            assert_eq!(clipped["fate"], fate, "{exact}");
            for (key, name) in [("y", "y"), ("M", "M"), ("N", "N")] {
                close(&free[name], &exact[key], 1e-10, &format!("{key} of {exact}"));
            }
            for (i, key) in ["intensity_s", "intensity_p"].into_iter().enumerate() {
                let size = number(&exact[key]);
                close(
                    &free["intensity"][i],
                    &exact[key],
                    1e-9 * size,
                    &format!("{key} of {exact}"),
                );
            }
        } else {
            assert_eq!(free["fate"], fate, "{exact}");
            assert_eq!(free["step"], exact["step"], "{exact}");
            assert_eq!(free["surface"], exact["surface"], "{exact}");
        }
        if fate == "clipped" {
            assert_eq!(clipped["step"], exact["clipped_step"], "{exact}");
            assert_eq!(clipped["surface"], exact["clipped_surface"], "{exact}");
        }
        compared += 1;
    }
    assert_eq!(compared, 40);
}

/// With little reflection ghosts fall as its square.
#[test]
fn coatings_weaken_ghosts_by_the_square_of_their_reflection() {
    let flux = |coating: &str| {
        let lens = "lenses/double_gauss_rudolph_50.json";
        let found =
            done_json(&["analyze", lens, "ghosts", "--field", "0", "--coating", coating], "");
        number(&found["fields"][0]["ghost_flux"])
    };
    let [one, half] = ["0.02%", "0.01%"].map(flux);
    // Cemented surfaces keep theirs.
    assert!(half < 0.6 * one, "{one:e} {half:e}");
    let [bare, single, v] = ["none", "single-layer", "v"].map(flux);
    assert!(v < single && single < 0.2 * bare, "{bare:e} {single:e} {v:e}");
}

#[test]
fn a_ghost_of_a_real_beam_agrees_with_first_order_optics_near_the_axis() {
    let mut file = read("images.json");
    file["ghosts"]["epd"] = json!(0.2);
    let lenses = file["lenses"].as_array_mut().unwrap();
    for lens in lenses.iter_mut().filter(|lens| lens["id"] == "double_gauss_rudolph_50") {
        lens["surfaces"][0]["semi_diameter"] = json!(0.1);
    }
    let lens = ghost_lens(&file);
    let found = done_json(&["analyze", lens.0.to_str().unwrap(), "ghosts", "--field", "0"], "");
    for ghost in list(&found["fields"][0]["ghosts"]) {
        let whole = number(&ghost["clip_factor"]) == 1.0 && ghost["fates"]["clipped"] == 0;
        if !whole || number(&ghost["paraxial_radius"]) < 0.05 {
            continue;
        }
        // A thousand cells of a disc.
        for (real, paraxial, tolerance) in
            [("radius", "paraxial_radius", 0.02), ("irradiance", "paraxial_irradiance", 0.04)]
        {
            let ratio = number(&ghost[real]) / number(&ghost[paraxial]);
            assert!((ratio - 1.0).abs() < tolerance, "{real} {ratio}: {ghost}");
        }
        let flux = number(&ghost["flux"][0]) / number(&ghost["transmitted"]);
        assert!((flux - 1.0).abs() < 1e-3, "{flux}: {ghost}");
    }
}

#[test]
fn wrong_questions_about_light_are_refused() {
    let lens = "lenses/double_gauss_rudolph_50.json";
    for (arguments, words) in [
        (vec!["calc", "coating", "--to", "0"], ["--to", "positive"]),
        (vec!["calc", "coating", "--to", "1.5", "--angle", "90"], ["--angle", "90"]),
        (vec!["calc", "coating", "--to", "1.5", "--film", "1.38"], ["--film", "1.38:99.64"]),
        (vec!["calc", "coating", "--to", "1.5", "--coating", "gold"], ["gold", "single-layer"]),
        (vec!["calc", "pupil", "--f-number", "0.2"], ["--f-number", "0.5"]),
        (vec!["calc", "pupil", "--seidel", "W999=1"], ["W999", "W040"]),
        (vec!["calc", "pupil", "--noll", "99=1"], ["99", "45"]),
        (vec!["calc", "pupil", "--disc", "0,0,-1"], ["--disc", "positive"]),
        (vec!["calc", "pupil", "--disc", "0,0,0.1", "--common"], ["--common", "two"]),
        (vec!["calc", "pupil", "--polygon", "2,0.1,0"], ["--polygon", "3 to 100"]),
        (vec!["calc", "pupil", "--disc", "0,0,0.1", "--noll", "4=1"], ["--noll", "round"]),
        (vec!["calc", "pupil", "--radius", "0"], ["--radius", "more than 0"]),
        (vec!["calc", "black-body", "--kelvin", "300", "--from", "5", "--to", "4"], ["--to", "4"]),
        (vec!["calc", "noise", "--photons", "-1"], ["--photons", "-1"]),
        (vec!["calc", "noise", "--photons", "1", "--bits", "40"], ["bits", "40"]),
        (
            vec!["calc", "blur", "--focal-length=50", "--f-number=2", "--focus=40", "--object=90"],
            ["--focus", "40"],
        ),
        (vec!["trace", lens, "--rays", "-", "--ghost", "1,2"], ["--ghost", "surface 1"]),
        (vec!["trace", lens, "--rays", "-", "--ghost", "0,2"], ["--ghost", "counted from 1"]),
        (vec!["analyze", lens, "ghosts", "--coating", "120%"], ["--coating", "0.3%"]),
        (vec!["analyze", "lenses/telescope_rc_f8.json", "ghosts"], ["mirror", "surface 1"]),
        (vec!["analyze", "lenses/wood_lens_60.json", "ghosts"], ["gradient", "surface"]),
    ] {
        let ray = r#"{"rays": [{"x": 0, "y": 0, "z": 0, "L": 0, "M": 0, "N": 1}]}"#;
        refused(2, &arguments, ray, &words);
    }
    let text = done(&["analyze", lens, "ghosts", "--ghosts", "3", "--field", "0"], "");
    assert!(text.contains("first order") && text.contains("45 ghosts"), "{text}");
}

/// The table has the share of the rays of a ghost that arrive, of which the JSON has the numbers.
#[test]
fn the_table_of_ghosts_has_the_share_that_arrives() {
    let file = read("images.json");
    let lens = ghost_lens(&file);
    let path = lens.0.to_str().unwrap();
    let arguments = ["analyze", path, "ghosts", "--field", "0"];
    let found = done_json(&arguments, "");
    let text = done(&arguments, "");
    let ghosts = list(&found["fields"][0]["ghosts"]);
    assert!(!ghosts.is_empty());
    for ghost in ghosts {
        let all: f64 = ghost["fates"].as_object().unwrap().values().map(number).sum();
        let share = 100.0 * number(&ghost["fates"]["imaged"]) / all;
        let surface = |key: &str| ghost[key].as_u64().unwrap() + 1;
        let pair = format!("{}, {}", surface("first_reflection"), surface("second_reflection"));
        let line = text.lines().find(|line| line.trim_start().starts_with(&pair)).unwrap();
        assert!(line.contains(&format!(" {share:.0} %")), "{share} in {line}");
    }
}

/// A circle far around an image has all of its light, within the error that is stated.
#[test]
fn a_wide_circle_about_the_image_of_a_pupil_that_is_not_round_has_all_light() {
    let found = pupil(&["--um=0.5", "--disc=0.1,0,0.1"], &["--radius=5".to_owned()]);
    let circle = &found["circles"][0];
    let (energy, error) = (number(&circle["energy"]), number(&circle["error"]));
    assert!(energy <= 1.0 && energy > 0.9 && energy + error >= 1.0 - 1e-12, "{circle}");
}

/// A frequency that no rays resolve takes nothing from the others.
#[test]
fn a_high_frequency_spoils_no_other() {
    let points = |frequencies: &str| {
        let list = format!("--frequencies={frequencies}");
        let asked = ["analyze", "lenses/double_gauss_rudolph_50.json", "mtf", "--field=17", &list];
        done_json(&asked, "")["fields"][0]["geometric"]["points"].clone()
    };
    let (alone, beside) = (points("0,10"), points("0,10,5000"));
    for (i, most) in [(0, 1e-12), (1, 2e-3)] {
        for direction in ["tangential", "sagittal"] {
            let of = |points: &Value| {
                let modulus = &points[i][direction]["modulus"];
                ["value", "error"].map(|key| modulus[key].as_f64().unwrap())
            };
            let ([own, _], [found, error]) = (of(&alone), of(&beside));
            assert!(error <= most, "{found} {error}");
            assert!((found - own).abs() <= error + 1e-12, "{found} {own}");
        }
    }
}

/// One command compares every case of a file of answers; a broken bound is an exit status and a name.
#[test]
fn one_command_compares_a_file_of_answers() {
    let path = crate::reference::folder().join("images.json");
    let path = path.to_str().unwrap();
    let found = done_json(&["measure", "images", path, "--only", "ghosts,photons,ring"], "");
    let kinds: Vec<&str> =
        list(&found["kinds"]).iter().map(|kind| kind["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["ring", "photons", "ghosts"]);
    assert!(list(&found["kinds"]).iter().all(|kind| kind["kept"] == true), "{found}");
    let mut file = read("images.json");
    file["photons"][0]["photons"] = json!("1181.82");
    let wrong = Scratch::with("images-wrong.json", &file.to_string());
    let output = aplanat(&["measure", "images", wrong.path(), "--only", "photons,blur"], "");
    let [text, errors] = [output.stdout, output.stderr].map(|b| String::from_utf8(b).unwrap());
    assert_eq!(output.status.code(), Some(1), "{text} {errors}");
    assert!(text.contains("broken") && text.contains("photons[0].photons"), "{text}");
    assert!(errors.contains("bounds broken: photons"), "{errors}");
    refused(2, &["measure", "images", path, "--only", "mft"], "", &["--only", "mft", "mtf"]);
    let lens = "lenses/double_gauss_rudolph_50.json";
    refused(2, &["measure", "images", lens, "--only", "blur"], "", &["motion", "expected a list"]);
}
