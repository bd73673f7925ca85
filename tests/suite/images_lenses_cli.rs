//! The lenses and scenes of `images.json` through the command line, as lens files with their indices.
//!
//! Several wavelengths need glasses: each has a formula through the indices of the file, in a catalogue
//! that the program is told of.

use crate::reference::{Worst, count, number, numbers, read};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::Command;

fn list(value: &Value) -> &Vec<Value> {
    value.as_array().unwrap()
}

/// Whether the rims of a lens clip.
#[derive(Clone, Copy, PartialEq)]
enum Rims {
    Open,
    Clip,
}

/// The wavelengths of a lens file.
#[derive(Clone, Copy, PartialEq)]
enum Colors {
    Primary,
    All,
}

fn rims_of(exact: &Value) -> Rims {
    if exact["pupil"] == "clip" { Rims::Clip } else { Rims::Open }
}

/// A folder with a catalogue of glasses, gone when the test ends.
struct LensFolder {
    path: PathBuf,
    data: Value,
}

impl Drop for LensFolder {
    fn drop(&mut self) {
        // What is left behind is in the temporary folder.
        drop(std::fs::remove_dir_all(&self.path));
    }
}

/// The coefficients of `n² = a + b λ² + c/λ²` through three indices.
fn schott(um: &[f64], index: &[f64]) -> [f64; 3] {
    // λ² n² is a parabola in λ²: Lagrange's.
    let (u, v): (Vec<f64>, Vec<f64>) = (
        um.iter().map(|l| l * l).collect(),
        um.iter().zip(index).map(|(l, n)| (l * n).powi(2)).collect(),
    );
    let mut found = [0.0; 3];
    for i in 0..3 {
        let [j, k] = [(i + 1) % 3, (i + 2) % 3];
        let scale = v[i] / ((u[i] - u[j]) * (u[i] - u[k]));
        found[0] -= scale * (u[j] + u[k]);
        found[1] += scale;
        found[2] += scale * u[j] * u[k];
    }
    found
}

impl LensFolder {
    fn new(data: &Value, test: &str) -> Self {
        let name =
            format!("aplanat-{}-{}-{test}", std::process::id(), data["id"].as_str().unwrap());
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&path).unwrap();
        let um = numbers(&data["wavelengths_um"]);
        let mut catalogue = "CC glasses through the indices of a file\n".to_owned();
        for (i, row) in list(&data["surfaces"]).iter().enumerate() {
            let [a, b, c] = schott(&um, &numbers(&row["n"]));
            writeln!(catalogue, "NM G{i} 1 0 - -\nCD {a:e} {b:e} {c:e}\nLD 0.3 1.0").unwrap();
        }
        std::fs::write(path.join("IMAGES.agf"), catalogue).unwrap();
        Self { path, data: data.clone() }
    }

    /// A lens file for some fields: over the unit disc without rims, or limited by rims alone; with the
    /// primary wavelength by its index, or with all of them.
    fn lens(&self, rims: Rims, fields: &Value, colors: Colors) -> String {
        let (clipped, all_colors) = (rims == Rims::Clip, colors == Colors::All);
        let primary = count(&self.data["primary"]);
        let stop = count(&self.data["stop_surface"]);
        let rows = list(&self.data["surfaces"]);
        let row = |(i, row): (usize, &Value)| {
            let mut surface = json!({
                "curvature": row["radius"].as_f64().map_or(0.0, f64::recip),
                "conic": row["conic"], "thickness": row["thickness"],
            });
            if !list(&row["asphere"]).is_empty() {
                surface["asphere"] = row["asphere"].clone();
            }
            if clipped && !row["semi_diameter"].is_null() {
                surface["semi_diameter"] = row["semi_diameter"].clone();
            }
            if number(&row["n"][primary]) != 1.0 {
                let name = json!(format!("IMAGES G{i}"));
                let index = json!({"index": row["n"][primary]});
                surface["glass"] = if all_colors { name } else { index };
            }
            if i == stop {
                surface["stop"] = json!(true);
            }
            surface
        };
        let aperture = if clipped {
            json!({"stop_semi_diameter": rows[stop]["semi_diameter"]})
        } else {
            json!({"entrance_pupil_diameter": self.data["epd"]})
        };
        let color = |w: usize| {
            let (um, weight) = (&self.data["wavelengths_um"][w], &self.data["weights"][w]);
            json!({"um": um, "weight": weight, "primary": w == primary})
        };
        let colors: Vec<Value> =
            (0..3).filter(|w| all_colors || *w == primary).map(color).collect();
        let lens = json!({
            "aplanat": 1, "name": self.data["id"], "object": "infinity", "aperture": aperture,
            "fields": {"kind": "angle", "values": fields}, "wavelengths": colors,
            "surfaces": rows.iter().enumerate().map(row).collect::<Vec<_>>(),
        });
        let path = self.path.join("lens.json");
        std::fs::write(&path, lens.to_string()).unwrap();
        path.to_str().unwrap().to_owned()
    }

    /// The first field of an analysis.
    fn analyze(&self, lens: &str, kind: &str, options: &[String]) -> Value {
        // Below the bound of every number, and no more: contrast costs a ray for each node.
        let error = if kind == "mtf" { "--error=3e-10" } else { "--error=1e-11" };
        let mut all = vec!["analyze", lens, kind, "--json", error];
        all.extend(options.iter().map(String::as_str));
        self.run(&all)["fields"].clone()
    }

    fn run(&self, arguments: &[&str]) -> Value {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
        let output = command.args(arguments).env("APLANAT_GLASSES", &self.path).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{arguments:?}: {errors}");
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// The fields with their lens files.
    fn fields(&self) -> impl Iterator<Item = (&Value, String)> + '_ {
        list(&self.data["fields"]).iter().map(|field| {
            let place = json!([{"y": field["field_deg"]}]);
            (field, self.lens(rims_of(field), &place, Colors::Primary))
        })
    }

    fn id(&self) -> &str {
        self.data["id"].as_str().unwrap()
    }
}

fn folders(test: &str) -> Vec<LensFolder> {
    list(&read("images.json")["lenses"]).iter().map(|data| LensFolder::new(data, test)).collect()
}

/// Rays through the paraxial entrance pupil, as the file has them.
fn paraxial() -> String {
    "--effects=aiming=off".to_owned()
}

fn allowed(err: &Value) -> f64 {
    (10.0 * number(err)).max(1e-9)
}

/// The cosines of a ray are printed with an error of this.
const COSINE: f64 = 1e-11;

#[test]
fn paths_and_chief_rays() {
    let mut compared = 0;
    for folder in folders("paths") {
        let mut worst = Worst::default();
        let info = folder.run(&[
            "info",
            &folder.lens(Rims::Open, &json!([{"y": 1.0}]), Colors::Primary),
            "--json",
        ]);
        let first = &folder.data["first_order"];
        for (found, key) in [
            (&info["efl"], "efl"),
            (&info["bfl"], "bfl"),
            (&info["entrance_pupil"]["position"], "z_ep"),
            (&info["exit_pupil"]["position"], "z_xp"),
        ] {
            let exact = number(&first[key]);
            worst.note(number(found), exact, 1e-12 * exact.abs() + 1e-12, key);
        }
        for (exact, _) in folder.fields() {
            // No rim clips the rays of the table.
            let open =
                folder.lens(Rims::Open, &json!([{"y": exact["field_deg"]}]), Colors::Primary);
            let rays = list(&exact["opd"]);
            let mut asked = vec![paraxial()];
            asked.extend(rays.iter().map(|ray| format!("--pupil={},{}", ray["px"], ray["py"])));
            let found = folder.analyze(&open, "wavefront", &asked)[0].clone();
            let chief = &exact["chief"];
            for (found, key) in [
                (&found["chief"]["y"], "y"),
                (&found["chief"]["path"], "path_mm"),
                (&found["chief"]["reference"]["exit_pupil"], "sphere_radius_mm"),
            ] {
                let size = number(&chief[key]).abs();
                worst.note(number(found), number(&chief[key]), 1e-12 * size + 1e-12, key);
            }
            for (found, ray) in list(&found["map"]).iter().zip(rays) {
                if ray["waves"].is_null() {
                    assert!(found["waves"].is_null(), "{found} {ray}");
                    continue;
                }
                worst.note(number(&found["waves"]), number(&ray["waves"]), 1e-8, format!("{ray}"));
                for key in ["alpha", "beta"] {
                    worst.note(number(&found[key]), number(&ray[key]), COSINE, format!("{ray}"));
                }
            }
        }
        compared += worst.check(&format!("paths {}", folder.id()), 1.0);
    }
    assert!(compared > 1000, "{compared}");
}

#[test]
fn wavefronts_point_spreads_and_zernike_sums() {
    for folder in folders("spreads") {
        let mut worst = Worst::default();
        for (exact, lens) in folder.fields().filter(|(exact, _)| !exact["psf"].is_null()) {
            let found = folder.analyze(&lens, "wavefront", &[paraxial()])[0].clone();
            for (key, name) in [("rms", "opd_rms_waves"), ("mean", "opd_mean_waves")] {
                let tolerance = allowed(&exact[name]["err"]).max(1e-8);
                worst.note(
                    number(&found[key]["value"]),
                    number(&exact[name]["value"]),
                    tolerance,
                    name,
                );
            }
            let spot = folder.analyze(&lens, "spot", &[paraxial()])[0].clone();
            let (area, known) = (&spot["colors"][0]["lit_area"], &exact["lit_area"]);
            // The disc of the file has its own diameter; that of the program is the paraxial entrance pupil.
            let info = folder.run(&["info", &lens, "--json"]);
            let diameter = number(&info["entrance_pupil"]["diameter"]);
            let scale = (diameter / number(&folder.data["epd"])).powi(2);
            let (area, tolerance) = (scale * number(&area["value"]), allowed(&known["err"]));
            worst.note(area, number(&known["value"]), tolerance, "lit area");
            let points = list(&exact["psf"]);
            let mut asked = vec![paraxial()];
            asked.extend(points.iter().map(|p| format!("--at={},{}", p["x"], p["y"])));
            let found = folder.analyze(&lens, "psf", &asked)[0].clone();
            for (found, exact) in list(&found["points"]).iter().zip(points) {
                let value = number(&found["intensity"]["value"]);
                worst.note(
                    value,
                    number(&exact["value"]),
                    allowed(&exact["err"]),
                    exact.to_string(),
                );
            }
            let Some(terms) = exact["zernike_noll"].as_array() else { continue };
            let found = folder.analyze(&lens, "zernike", &[paraxial()])[0].clone();
            for (found, exact) in list(&found["noll"]).iter().zip(terms) {
                let (found, exact) = (number(&found["value"]), number(&exact["waves"]));
                worst.note(found, exact, 1e-8, "Noll");
            }
        }
        worst.check(&format!("point spread {}", folder.id()), 1.0);
    }
}

/// The contrast of a lens by diffraction and by rays to the bound of the file, real and imaginary part and
/// modulus.
fn compare_contrast(
    folder: &LensFolder,
    exact: &Value,
    [of_waves, of_rays]: [&Value; 2],
    complex: bool,
    worst: &mut Worst,
) {
    for (i, exact) in list(exact).iter().enumerate() {
        let section = exact["lines"].as_str().unwrap();
        for (curve, name, err) in
            [(of_waves, "diffraction", "err"), (of_rays, "geometric", "geometric_err")]
        {
            let frequency = number(&exact["frequency"]);
            let same = |point: &&Value| number(&point["frequency"]) == frequency;
            let point = list(&curve["points"]).iter().find(same).unwrap();
            let (found, tolerance) = (&point[section], allowed(&exact[err]));
            let place = format!("{} {name} {i} {exact}", folder.id());
            worst.note(number(&found["modulus"]["value"]), number(&exact[name]), tolerance, &place);
            let prefix = if name == "diffraction" { "" } else { "geometric_" };
            for part in ["re", "im"].into_iter().filter(|_| complex) {
                let known = &exact[format!("{prefix}{part}")];
                worst.note(number(&found[part]), number(known), tolerance, &place);
            }
        }
    }
}

fn frequencies(exact: &Value) -> String {
    let mut all: Vec<f64> = list(exact).iter().map(|entry| number(&entry["frequency"])).collect();
    all.dedup();
    let all: Vec<String> = all.iter().map(f64::to_string).collect();
    format!("--frequencies={}", all.join(","))
}

/// Every other lens: `measure images` compares all of them, with as many rays.
#[test]
fn contrast_of_one_wavelength() {
    for folder in folders("contrast").iter().step_by(2) {
        let mut worst = Worst::default();
        for (exact, lens) in folder.fields().filter(|(exact, _)| !exact["mtf"].is_null()) {
            let asked = [paraxial(), frequencies(&exact["mtf"])];
            let found = folder.analyze(&lens, "mtf", &asked)[0].clone();
            let curves = [&found["diffraction"], &found["geometric"]];
            compare_contrast(folder, &exact["mtf"], curves, true, &mut worst);
        }
        worst.check(&format!("contrast {}", folder.id()), 1.0);
    }
}

#[test]
fn contrast_of_all_wavelengths() {
    let mut compared = 0;
    for folder in folders("colors") {
        let mut worst = Worst::default();
        for exact in list(&folder.data["fields"]).iter().filter(|exact| !exact["poly"].is_null()) {
            let place = json!([{"y": exact["field_deg"]}]);
            let lens = folder.lens(rims_of(exact), &place, Colors::All);
            let exact = &exact["poly"]["mtf"];
            let found = folder.analyze(&lens, "mtf", &[paraxial(), frequencies(exact)])[0].clone();
            let curves = [&found["polychromatic_diffraction"], &found["polychromatic_geometric"]];
            compare_contrast(&folder, exact, curves, false, &mut worst);
            compared += 1;
        }
        worst.check(&format!("contrast of colours {}", folder.id()), 1.0);
    }
    assert_eq!(compared, 3);
}

#[test]
fn distortion_of_every_colour_and_both_pupils() {
    for folder in folders("distortion") {
        let mut worst = Worst::default();
        let points = list(&folder.data["distortion"]["points"]);
        let fields: Vec<Value> = points
            .iter()
            .map(|point| {
                // Two angles of a field are its size and its azimuth.
                let slopes = ["x_deg", "y_deg"].map(|key| number(&point[key]).to_radians().tan());
                let length = slopes[0].hypot(slopes[1]);
                let size = length.atan().to_degrees();
                let [x, y] = slopes.map(|v| if length > 0.0 { size * v / length } else { 0.0 });
                json!({"x": x, "y": y})
            })
            .collect();
        // Rims have no say.
        let lens = folder.lens(Rims::Open, &json!(fields), Colors::All);
        for (aiming, key) in [("off", "paraxial_pupil"), ("on", "stop_centre")] {
            let aiming = format!("--effects=aiming={aiming}");
            let found = folder.analyze(&lens, "lateral-color", &[aiming]);
            let fields = list(&found).iter().zip(points);
            let pairs = fields.flat_map(|(found, exact)| {
                list(&found["colors"]).iter().zip(list(&exact["colors"]))
            });
            // Where the reference has no ray it has no number.
            for (found, exact) in pairs.filter(|(_, exact)| !exact[key][0].is_null()) {
                let (found, exact) = (numbers(&found["point"]), numbers(&exact[key]));
                let place = format!("{key} {exact:?}");
                worst.note(found[0], exact[0], 1e-11, &place);
                worst.note(found[1], exact[1], 1e-11, &place);
            }
        }
        worst.check(&format!("distortion {}", folder.id()), 1.0);
    }
}

/// The irradiance that the command line finds at a point of the image for a wave of the scene.
fn light_of_wave(folder: &LensFolder, lens: &str, point: &Value, wave: &Value) -> f64 {
    let far = wave["kind"] == "infinity";
    let keys = if far { ["fx", "fy"] } else { ["gx", "gy"] };
    let [x, y] = keys.map(|key| &wave[key]);
    let at = format!("--at={},{}", point["x"], point["y"]);
    let mut asked = vec![at, format!("--wave={x},{y},{}", wave["phase"])];
    asked.extend((!far).then(|| format!("--distance={}", wave["distance"])));
    let found = folder.analyze(lens, "illumination", &asked);
    number(&found[0]["points"][0]["irradiance"]["value"])
}

#[test]
fn irradiance_of_white_cards_and_of_waves() {
    let file = read("images.json");
    let scene = &file["scene"];
    for folder in folders("light") {
        let mut worst = Worst::default();
        for exact in list(&folder.data["irradiance"]) {
            let lens =
                folder.lens(Rims::Clip, &json!([{"y": exact["field_deg"]}]), Colors::Primary);
            let at = format!("--at=0,{}", number(&exact["image_y"]));
            let found = folder.analyze(&lens, "illumination", &[paraxial(), at])[0].clone();
            let place = exact["field_deg"].to_string();
            let tolerance = allowed(&exact["backward_err"]);
            let solid = number(&exact["backward_projected_solid_angle"]);
            worst.note(
                number(&found["points"][0]["irradiance"]["value"]),
                solid,
                tolerance,
                &place,
            );
            worst.note(
                number(&found["cone"]["value"]),
                number(&exact["forward_cone"]),
                1e-9,
                &place,
            );
            worst.note(number(&found["point"][1]), number(&exact["centroid_y"]), 1e-9, &place);
        }
        if scene["lens"] == folder.data["id"] {
            let lens = folder.lens(Rims::Clip, &json!([{"y": 0.0}]), Colors::Primary);
            for point in list(&scene["points"]) {
                list(&point["scenes"]).iter().for_each(|wave| {
                    let value = light_of_wave(&folder, &lens, point, wave);
                    worst.note(value, number(&wave["value"]), 1e-9, format!("{point}"));
                });
            }
        }
        worst.check(&format!("irradiance {}", folder.id()), 1.0);
    }
}
