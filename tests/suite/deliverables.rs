//! Reports, drawings and solids: what they contain, read back, and what is refused.

use super::cli::{Scratch, aplanat, done, done_json, refused};
use serde_json::json;
use std::collections::HashMap;
use std::f64::consts::PI;

const GAUSS: &str = "lenses/double_gauss_rudolph_50.json";
const ACHROMAT: &str = "lenses/achromat_ac254_100.json";
const SINGLET: &str = "lenses/singlet_la1131.json";
const PHONE: &str = "lenses/phone_us7558005_1.json";
const TELESCOPE: &str = "lenses/telescope_rc_f8.json";
const ROD: &str = "lenses/grin_rod_melles_griot.json";
const ZOOM: &str = "lenses/zoom_nikkor_28_80.json";

/// A lens file with these surfaces.
fn lens_file(name: &str, surfaces: &serde_json::Value) -> Scratch {
    let lens = json!({"aplanat": 1, "name": name, "source": "", "notes": "", "object": "infinity",
        "aperture": {"entrance_pupil_diameter": 4.0},
        "fields": {"kind": "angle", "values": [{"y": 0.0}]},
        "wavelengths": [{"um": 0.5875618}], "surfaces": surfaces});
    Scratch::with(&format!("{name}.json"), &lens.to_string())
}

/// The files of a drawing command with this ending.
fn drawn(lens: &str, ending: &str, more: &[&str]) -> String {
    let out = Scratch::new(&format!("drawn-{}.{ending}", more.len()));
    done(&[&["drawing", lens, "--out", out.path()], more].concat(), "");
    std::fs::read_to_string(&out.0).unwrap()
}

#[test]
fn a_report_has_every_part_and_every_number_its_error() {
    let out = Scratch::new("report.html");
    for lens in [GAUSS, PHONE, TELESCOPE, ROD, ZOOM] {
        done(&["report", lens, "--out", out.path(), "--error", "1%"], "");
        let html = std::fs::read_to_string(&out.0).unwrap();
        for part in [
            "Layout",
            "Prescription",
            "First-order data",
            "Spots",
            "Geometric MTF",
            "Effects",
            "Bill of material",
            "Diffraction is off here",
            "</svg>",
            "\u{b1} ",
        ] {
            assert!(html.contains(part), "{lens}: {part}");
        }
        assert!(!html.contains("NaN") && !html.contains("inf<"), "{lens}");
        assert!(!html.contains("<script"), "{lens}");
    }
}

#[test]
fn a_report_counts_surfaces_from_one_and_has_the_numbers_of_info() {
    let out = Scratch::new("achromat.html");
    done(&["report", ACHROMAT, "--out", out.path()], "");
    let html = std::fs::read_to_string(&out.0).unwrap();
    let info = done_json(&["info", ACHROMAT], "");
    let efl = info["efl"].as_f64().unwrap();
    let (_, cell) = html.split_once("<td class=\"l\">focal length</td><td>").unwrap();
    let found: f64 = cell[..cell.find('<').unwrap()].parse().unwrap();
    assert!((found / efl - 1.0).abs() < 1e-6, "{found} {efl}");
    assert!(html.contains("<td class=\"l\">1</td>") && !html.contains("<td class=\"l\">0</td>"));
}

#[test]
fn a_pdf_report_is_one_and_the_same_each_time() {
    let bytes = || {
        let out = Scratch::new("report.pdf");
        let pages = done_json(&["report", ZOOM, "--out", out.path(), "--error", "1%"], "");
        assert!(pages["pages"].as_u64().unwrap() >= 4, "{pages}");
        std::fs::read(&out.0).unwrap()
    };
    let [one, two] = [bytes(), bytes()];
    assert!(one.starts_with(b"%PDF-") && one.len() > 20_000, "{}", one.len());
    assert!(one == two, "two runs differ");
}

#[test]
fn a_name_cannot_write_into_the_page() {
    let surfaces = json!([{"curvature": 0.02, "thickness": 3.0, "glass": "SCHOTT N-BK7",
        "semi_diameter": 4.0, "stop": true}, {"curvature": 0.0, "thickness": 90.0, "semi_diameter": 4.0}]);
    let lens = lens_file("named", &surfaces);
    let text = std::fs::read_to_string(&lens.0).unwrap();
    std::fs::write(&lens.0, text.replace("\"named\"", "\"<script>'\\u0001 & \u{5149}\"")).unwrap();
    for ending in ["html", "pdf"] {
        let out = Scratch::new(&format!("named.{ending}"));
        done(&["report", lens.path(), "--out", out.path()], "");
        let bytes = std::fs::read(&out.0).unwrap();
        assert!(!String::from_utf8_lossy(&bytes).contains("<script>"), "{ending}");
    }
    let step = drawn(lens.path(), "step", &[]);
    assert!(step.contains("FILE_NAME('<script>''  & \\X2\\5149\\X0\\'"), "{}", &step[..400]);
    assert_eq!(StepModel::read(&step).of("PRODUCT").len(), 1);
}

#[test]
fn wrong_targets_and_elements_are_refused_by_name() {
    let svg = Scratch::new("refused.svg");
    refused(2, &["report", GAUSS, "--out", "report.docx"], "", &["docx", ".pdf"]);
    refused(2, &["drawing", GAUSS, "--out", "lens.png"], "", &["png", ".svg", ".step"]);
    let arguments = ["drawing", GAUSS, "--out", svg.path(), "--element"];
    refused(2, &[&arguments[..], &["0"]].concat(), "", &["no element 0", "1 to 6"]);
    refused(2, &[&arguments[..], &["7"]].concat(), "", &["no element 7", "1 to 6"]);
    let arguments = ["drawing", TELESCOPE, "--out", svg.path(), "--element", "1"];
    refused(2, &arguments, "", &["no element of glass", TELESCOPE]);
    refused(2, &["drawing", ZOOM, "--out", svg.path(), "--zoom", "9"], "", &["zoom position 9"]);
    assert!(!svg.0.exists());
}

#[test]
fn elements_that_are_no_solids_are_refused_by_their_numbers() {
    let front = |more: serde_json::Value| {
        let mut row = json!({"curvature": 0.1, "thickness": 1.0, "glass": "SCHOTT N-BK7",
            "semi_diameter": 5.0, "stop": true});
        row.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        row
    };
    let back = json!({"curvature": -0.1, "thickness": 20.0, "semi_diameter": 5.0});
    let step = Scratch::new("refused.step");
    let refuse = |name: &str, surfaces: serde_json::Value, words: &[&str]| {
        let lens = lens_file(name, &surfaces);
        refused(2, &["drawing", lens.path(), "--out", step.path()], "", words);
        assert!(!step.0.exists());
    };
    // Two sags of 0.1·25/(1 + √0.75) = 1.3397 mm leave no edge.
    refuse(
        "knife",
        json!([front(json!({})), back]),
        &["element 1", "surfaces 1 and 2", "mm of glass"],
    );
    let touching = 2.0 * 10.0 * (1.0 - 0.75_f64.sqrt());
    refuse(
        "zero",
        json!([front(json!({"thickness": touching})), back]),
        &["element 1", "0.000000 mm"],
    );
    let tilted = json!([front(json!({"thickness": 4.0, "tilt": [1.0, 0.0]})), back]);
    refuse("wedge", tilted, &["element 1", "tilted", "axis of revolution"]);
    let beyond = front(json!({"thickness": 9.0, "curvature": 0.19, "semi_diameter": 5.5}));
    refuse("beyond", json!([beyond, back]), &["element 1", "surface 1", "5.5"]);
}

#[test]
fn a_layout_is_to_scale_and_the_dxf_has_the_lens_in_its_own_size() {
    let dxf = drawn(SINGLET, "dxf", &[]);
    let file = dxf::Drawing::load(&mut dxf.as_bytes()).unwrap();
    let arcs: Vec<_> = file
        .entities()
        .filter_map(|entity| match &entity.specific {
            dxf::entities::EntityType::Arc(arc) => Some((arc, entity.common.layer.clone())),
            _ => None,
        })
        .collect();
    // A plano-convex lens has one surface that is an arc: its own radius about its own centre.
    let text = std::fs::read_to_string(SINGLET).unwrap();
    let lens: serde_json::Value = serde_json::from_str(&text).unwrap();
    let rows = lens["surfaces"].as_array().unwrap();
    let i = rows.iter().position(|row| row["curvature"].as_f64().unwrap_or(0.0) != 0.0).unwrap();
    let curvature = rows[i]["curvature"].as_f64().unwrap();
    let z: f64 = rows[..i].iter().map(|row| row["thickness"].as_f64().unwrap()).sum();
    assert_eq!(arcs.len(), 1);
    let (arc, layer) = &arcs[0];
    assert!((arc.radius * curvature.abs() - 1.0).abs() < 1e-6, "{} {curvature}", arc.radius);
    assert!((arc.center.x - z - 1.0 / curvature).abs() < 1e-4, "{:?}", arc.center);
    assert!(arc.center.y.abs() < 1e-6 && layer == "OUTLINE", "{:?} {layer}", arc.center);
    // It is the part of the circle at the vertex of the surface.
    let turn = (arc.end_angle - arc.start_angle).rem_euclid(360.0);
    let middle = (arc.start_angle + 0.5 * turn).to_radians();
    let at = [arc.center.x + arc.radius * middle.cos(), arc.center.y + arc.radius * middle.sin()];
    assert!(turn < 180.0 && (at[0] - z).abs() < 1e-4 && at[1].abs() < 1e-4, "{turn} {at:?}");
    let svg = drawn(GAUSS, "svg", &[]);
    assert!(svg.contains("width=\"297mm\"") && svg.contains("Scale 2:1"), "{}", &svg[..200]);
}

#[test]
fn layouts_of_hard_lenses_are_drawn() {
    for lens in [
        TELESCOPE,
        ROD,
        PHONE,
        "tests/files/folded_singlet.zmx",
        "lenses/microscope_us5000548_1.json",
    ] {
        let svg = drawn(lens, "svg", &[]);
        assert!(svg.contains("</svg>") && !svg.contains("NaN"), "{lens}");
    }
}

#[test]
fn an_element_drawing_has_its_radii_signs_material_and_tolerances() {
    let text = std::fs::read_to_string(ACHROMAT).unwrap();
    let mut lens: serde_json::Value = serde_json::from_str(&text).unwrap();
    // Half a fringe of 546.07 nm over a semi-diameter h is a change of the curvature of λ/h² / 2.
    let height = lens["surfaces"][0]["semi_diameter"].as_f64().unwrap();
    let curvature = 0.5 * 546.07e-6 / (height * height);
    lens["tolerances"] = json!({"errors": [
        {"kind": "curvature", "first": 0, "half_range": curvature},
        {"kind": "irregularity", "first": 0, "half_range": 0.25 * 0.5 * 546.07e-6},
        {"kind": "surface_tilt_x", "first": 1, "half_range": 2.0 / 60.0},
        {"kind": "thickness", "first": 0, "half_range": 0.05},
        {"kind": "index", "first": 0, "half_range": 0.0005}]});
    let scratch = Scratch::with("toleranced.json", &lens.to_string());
    let svg = drawn(scratch.path(), "svg", &["--element", "1"]);
    for words in [
        "3/ 0.5(0.25)",
        "4/ 2'",
        "\u{b1} 0.05",
        "\u{b1} 0.0005",
        " CX<",
        "0/ -",
        "1/ -",
        "2/ -",
        "5/ -",
        "3/ -",
        "Left surface (1)",
        "Right surface (2)",
        "Cemented to element 2 at surface 2",
    ] {
        assert!(svg.contains(words), "{words}");
    }
    let second = drawn(ACHROMAT, "svg", &["--element", "2"]);
    assert!(second.contains(" CC<") && second.contains("4/ -"), "{second}");
    // A sphere is no asphere of the constant 0.
    assert!(!svg.contains("asphere") && !second.contains("asphere"));
    // A plane and an asphere.
    assert!(drawn(SINGLET, "svg", &["--element", "1"]).contains("R plane"));
    assert!(drawn(PHONE, "svg", &["--element", "1"]).contains("asphere, k"));
    assert!(drawn(ROD, "svg", &["--element", "1"]).contains("gradient index"));
}

/// A parameter of an entity.
#[derive(Debug, Clone, PartialEq)]
enum Parameter {
    List(Vec<Self>),
    Ref(u64),
    Real(f64),
    /// A word between dots, a string or a sign.
    Word(String),
}

/// The entities of a STEP file by their numbers: their kinds and parameters. Those of several kinds, which
/// are units here, are left out.
struct StepModel(HashMap<u64, (String, Parameter)>);

/// The parameters of a list behind its opening bracket, and what follows its closing one.
fn list(mut text: &str) -> (Parameter, &str) {
    let mut found = Vec::new();
    loop {
        if let Some(rest) = text.strip_prefix(')') {
            return (Parameter::List(found), rest);
        }
        let (parameter, rest) = parameter(text.strip_prefix(',').unwrap_or(text));
        found.push(parameter);
        text = rest;
    }
}

fn parameter(text: &str) -> (Parameter, &str) {
    if let Some(inner) = text.strip_prefix('(') {
        return list(inner);
    }
    if let Some(string) = text.strip_prefix('\'') {
        let doubled = string.replace("''", "__");
        let end = doubled.find('\'').unwrap();
        return (Parameter::Word(string[..end].to_owned()), &string[end + 1..]);
    }
    // A number with a type, as `LENGTH_MEASURE(1.E-6)`.
    if let Some((_, inner)) = text.split_once('(').filter(|(kind, _)| !kind.contains([',', ')'])) {
        return list(inner);
    }
    let (word, rest) = text.split_at(text.find([',', ')']).unwrap());
    let parameter = if let Some(number) = word.strip_prefix('#') {
        Parameter::Ref(number.parse().unwrap())
    } else if word.starts_with(['.', '$', '*']) {
        Parameter::Word(word.trim_matches('.').to_owned())
    } else {
        assert!(word.contains('.') || word.parse::<i64>().is_ok(), "{word}");
        Parameter::Real(word.parse().unwrap())
    };
    (parameter, rest)
}

impl StepModel {
    fn read(text: &str) -> Self {
        assert!(text.starts_with("ISO-10303-21;") && text.ends_with("END-ISO-10303-21;\n"));
        let entity = |line: &str| {
            let (number, what) = line.strip_prefix('#')?.strip_suffix(';')?.split_once('=')?;
            let (kind, inner) = what.split_once('(').filter(|(kind, _)| !kind.is_empty())?;
            let (parameters, rest) = list(inner);
            assert_eq!(rest, "", "{line}");
            Some((number.parse().unwrap(), (kind.to_owned(), parameters)))
        };
        Self(text.lines().filter_map(entity).collect())
    }

    fn of(&self, kind: &str) -> Vec<u64> {
        let own = self.0.iter().filter(|(_, (name, _))| name == kind);
        let mut numbers: Vec<u64> = own.map(|(id, _)| *id).collect();
        numbers.sort_unstable();
        numbers
    }

    fn kind(&self, id: u64) -> &str {
        &self.0[&id].0
    }

    fn parameters(&self, id: u64) -> &[Parameter] {
        match &self.0[&id].1 {
            Parameter::List(list) => list,
            _ => panic!("{id} has no list"),
        }
    }

    fn reference(parameter: &Parameter) -> u64 {
        match parameter {
            Parameter::Ref(id) => *id,
            other => panic!("{other:?} is no reference"),
        }
    }

    fn child(&self, id: u64, place: usize) -> u64 {
        Self::reference(&self.parameters(id)[place])
    }

    fn children(&self, id: u64, place: usize) -> Vec<u64> {
        match &self.parameters(id)[place] {
            Parameter::List(list) => list.iter().map(Self::reference).collect(),
            other => panic!("{other:?} is no list"),
        }
    }

    fn number(&self, id: u64, place: usize) -> f64 {
        match &self.parameters(id)[place] {
            Parameter::Real(value) => *value,
            other => panic!("{other:?} is no number"),
        }
    }

    fn sense(&self, id: u64, place: usize) -> bool {
        match &self.parameters(id)[place] {
            Parameter::Word(word) => word == "T",
            other => panic!("{other:?} is no sense"),
        }
    }

    fn vector(&self, id: u64) -> [f64; 3] {
        match &self.parameters(id)[1] {
            Parameter::List(list) => [0, 1, 2].map(|i| match &list[i] {
                Parameter::Real(value) => *value,
                other => panic!("{other:?} is no number"),
            }),
            other => panic!("{other:?} is no list"),
        }
    }

    /// The origin and the axis of the frame of a surface or curve.
    fn frame(&self, id: u64) -> ([f64; 3], [f64; 3]) {
        let place = self.child(id, 1);
        (self.vector(self.child(place, 1)), self.vector(self.child(place, 2)))
    }

    /// The signed volume between a face and the plane z = 0, for an axis along z: the integral of z over
    /// the projection of the face, positive where its outside is towards +z.
    fn volume_below(&self, face: u64) -> f64 {
        let surface = self.child(face, 2);
        let rims: Vec<([f64; 3], f64)> = self
            .children(face, 1)
            .into_iter()
            .flat_map(|bound| self.children(self.child(bound, 1), 1))
            .map(|oriented| self.child(self.child(oriented, 3), 3))
            .filter(|curve| self.kind(*curve) == "CIRCLE" && self.frame(*curve).1[2].abs() > 0.5)
            .map(|circle| (self.frame(circle).0, self.number(circle, 2)))
            .collect();
        let square = |radius: f64| PI * radius * radius;
        match self.kind(surface) {
            "CYLINDRICAL_SURFACE" => 0.0,
            "PLANE" => {
                let (origin, _) = self.frame(surface);
                let mut areas: Vec<f64> = rims.iter().map(|(_, radius)| square(*radius)).collect();
                areas.sort_by(f64::total_cmp);
                let area = areas.pop().unwrap() - areas.pop().unwrap_or(0.0);
                let up = if self.sense(face, 3) { 1.0 } else { -1.0 };
                up * area * origin[2]
            }
            "SPHERICAL_SURFACE" => {
                let (center, _) = self.frame(surface);
                let radius = self.number(surface, 2);
                let (rim, height) = rims[0];
                assert!((height.hypot(rim[2] - center[2]) / radius - 1.0).abs() < 1e-12);
                // Half of the sphere is above its centre, half below.
                let upper = rim[2] > center[2];
                let cap = 2.0 / 3.0 * PI * (radius.powi(3) - (rim[2] - center[2]).abs().powi(3));
                let volume = center[2] * square(height) + if upper { cap } else { -cap };
                let outwards_is_up = upper == self.sense(face, 3);
                if outwards_is_up { volume } else { -volume }
            }
            other => panic!("{other}"),
        }
    }
}

#[test]
fn every_solid_is_closed_and_its_volume_is_that_of_the_element() {
    for lens in [GAUSS, ACHROMAT, SINGLET] {
        let out = Scratch::new("solids.step");
        let printed = done_json(&["drawing", lens, "--out", out.path()], "");
        let volumes: Vec<f64> = printed["solids"]["elements"]
            .as_array()
            .unwrap()
            .iter()
            .map(|element| element["volume"].as_f64().unwrap())
            .collect();
        let model = StepModel::read(&std::fs::read_to_string(&out.0).unwrap());
        let solids = model.of("MANIFOLD_SOLID_BREP");
        assert_eq!(solids.len(), volumes.len());
        assert_eq!(model.of("PRODUCT").len(), volumes.len());
        for (solid, volume) in solids.into_iter().zip(volumes) {
            let faces = model.children(model.child(solid, 1), 1);
            let found: f64 = faces.iter().map(|face| model.volume_below(*face)).sum();
            println!("{lens}: {found} against {volume}");
            assert!((found / volume - 1.0).abs() < 1e-11, "{lens}: {found} {volume}");
            assert_closed(&model, &faces);
        }
    }
}

/// Every edge of a closed shell is met twice, once in each direction.
fn assert_closed(model: &StepModel, faces: &[u64]) {
    let mut met: HashMap<u64, Vec<bool>> = HashMap::new();
    for face in faces {
        for bound in model.children(*face, 1) {
            assert!(model.sense(bound, 2));
            for oriented in model.children(model.child(bound, 1), 1) {
                met.entry(model.child(oriented, 3)).or_default().push(model.sense(oriented, 4));
            }
        }
    }
    assert!(met.len() >= 3);
    assert!(met.values().all(|senses| senses.len() == 2 && senses[0] != senses[1]), "{met:?}");
}

#[test]
fn an_asphere_is_a_revolved_spline_with_its_deviation() {
    let out = Scratch::new("phone.step");
    let printed = done_json(&["drawing", PHONE, "--out", out.path(), "--element", "1"], "");
    let deviation = printed["solids"]["deviation"].as_f64().unwrap();
    assert!(deviation > 0.0 && deviation <= 1e-6, "{deviation}");
    let model = StepModel::read(&std::fs::read_to_string(&out.0).unwrap());
    let splines = model.of("B_SPLINE_CURVE_WITH_KNOTS");
    assert_eq!((splines.len(), model.of("SURFACE_OF_REVOLUTION").len()), (2, 2));
    for spline in splines {
        let points = model.children(spline, 2);
        let ends = [points[0], points[points.len() - 1]].map(|point| model.vector(point));
        assert!(ends[0][0] == 0.0 && ends[1][0] > 0.1, "{ends:?}");
        let rims = model.of("CIRCLE").into_iter();
        let on_rim = |circle: u64| {
            let (center, _) = model.frame(circle);
            (center[2] - ends[1][2]).abs() < 1e-12
                && (model.number(circle, 2) - ends[1][0]).abs() < 1e-12
        };
        assert!(rims.filter(|circle| on_rim(*circle)).count() == 1);
    }
}

#[test]
fn mirrors_are_left_out_of_solids_and_named() {
    let step = Scratch::new("mirrors.step");
    let words = ["no element of glass"];
    refused(2, &["drawing", TELESCOPE, "--out", step.path()], "", &words);
    // A Mangin mirror: light crosses one body twice.
    let surfaces = json!([
        {"curvature": -0.01, "thickness": 4.0, "glass": "SCHOTT N-BK7", "semi_diameter": 10.0, "stop": true},
        {"curvature": -0.008, "thickness": -4.0, "glass": "mirror", "semi_diameter": 10.0},
        {"curvature": -0.01, "thickness": -80.0, "semi_diameter": 10.0}]);
    let lens = lens_file("mangin", &surfaces);
    let output = aplanat(&["drawing", lens.path(), "--out", step.path(), "--json"], "");
    let printed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(printed["solids"]["elements"].as_array().unwrap().len(), 1, "{printed}");
    assert_eq!(printed["solids"]["left_out"], json!([]));
}

#[test]
fn weights_are_those_of_the_catalogue() {
    let out = Scratch::new("weights.html");
    done(&["report", SINGLET, "--out", out.path()], "");
    let html = std::fs::read_to_string(&out.0).unwrap();
    // N-BK7 has 2.51 g/cm³.
    let step = Scratch::new("weights.step");
    let printed = done_json(&["drawing", SINGLET, "--out", step.path()], "");
    let volume = printed["solids"]["elements"][0]["volume"].as_f64().unwrap();
    let row = format!("<td>{volume:.2}</td><td>2.51</td><td>{:.3}</td>", 2.51e-3 * volume);
    assert!(html.contains(&row), "{row}");
    // A model glass has no density.
    let surfaces = json!([
        {"curvature": 0.02, "thickness": 3.0, "glass": {"nd": 1.6, "vd": 50.0}, "semi_diameter": 4.0,
         "stop": true},
        {"curvature": 0.0, "thickness": 80.0, "semi_diameter": 4.0}]);
    let lens = lens_file("unknown-weight", &surfaces);
    done(&["report", lens.path(), "--out", out.path()], "");
    let html = std::fs::read_to_string(&out.0).unwrap();
    assert!(
        html.contains("<td>unknown</td><td>unknown</td>")
            && html.contains("The weight is not known")
    );
}
