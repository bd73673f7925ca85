//! What panels export has the numbers that the command line prints.

use crate::cli::{done, done_json, refused};
use crate::pictures::bundled;
use aplanat::lens::Lens;
use aplanat::plot::CurveChart;
use aplanat::report::{AnalysisFigure, FigureKind, PaperKind};
use aplanat::session::{
    AnalysisResults, AnalysisSettings, Command, ContrastPage, FieldPage, PanelSetting, Session,
    analysis_figure, analyze,
};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

const LENS: &str = "lenses/cooke_triplet_100_f27.json";

fn triplet() -> Lens {
    bundled("cooke_triplet_100_f27")
}

/// The figure of what is computed at once.
fn figure(kind: FigureKind, settings: AnalysisSettings) -> AnalysisFigure {
    let lens = Arc::new(triplet());
    let analyses = analyze(&lens, &settings);
    let results = AnalysisResults { version: 1, lens, settings, analyses, ms: 1.0 };
    analysis_figure(kind, &results).unwrap()
}

/// The value of a curve at a place.
fn value_at(chart: &CurveChart, curve: &str, x: f64) -> f64 {
    let curve = chart.curves.iter().find(|own| own.name == curve).unwrap();
    let point = curve.pieces.iter().flatten().find(|point| (point[0] - x).abs() < 1e-9).unwrap();
    point[1]
}

fn export(kind: FigureKind, path: &Path) -> Command {
    Command::ExportPaper { kind: PaperKind::Figure(kind), path: path.to_owned() }
}

fn list(value: &Value) -> &Vec<Value> {
    value.as_array().unwrap()
}

#[test]
fn exported_fans_are_those_of_the_command_line() {
    let settings = AnalysisSettings { fans: true, path_fans: true, ..AnalysisSettings::default() };
    let rays = figure(FigureKind::Fans, settings.clone());
    let printed = done_json(&["analyze", LENS, "fan"], "");
    assert_eq!(rays.rows.len(), list(&printed["fields"]).len());
    let mut compared = 0;
    for (row, field) in rays.rows.iter().zip(list(&printed["fields"])) {
        for (k, color) in list(&field["colors"]).iter().enumerate() {
            for point in list(&color["tangential"]) {
                let (Some(pupil), Some(dy)) = (point["pupil"].as_f64(), point["dy"].as_f64())
                else {
                    continue;
                };
                let curve = &row[0].curves[k];
                let own = curve.pieces.iter().flatten().find(|own| (own[0] - pupil).abs() < 1e-12);
                let Some(own) = own else { continue };
                assert!((own[1] - 1e3 * dy).abs() < 1e-6, "{own:?} {point}");
                compared += 1;
            }
        }
    }
    // Both have five places of the pupil in common, which are lost at the rim.
    assert!(compared > 30, "{compared}");
    // Paths are counted in the waves of each wavelength: the primary one is that of the command line.
    let paths = figure(FigureKind::PathFans, settings);
    let printed = done_json(&["analyze", LENS, "opd-fan"], "");
    for (row, field) in paths.rows.iter().zip(list(&printed["fields"])) {
        for (chart, section, place) in [(&row[0], "tangential", "py"), (&row[1], "sagittal", "px")]
        {
            for end in [0.0, 0.5, -0.5] {
                let of = |point: &&Value| (point[place].as_f64().unwrap() - end).abs() < 1e-12;
                let Some(waves) = list(&field[section]).iter().find(of).unwrap()["waves"].as_f64()
                else {
                    continue;
                };
                let own = value_at(chart, "588 nm", end);
                assert!((own - waves).abs() < 1e-6, "{section} {end}: {own} {waves}");
            }
        }
    }
}

#[test]
fn exported_curves_over_field_and_zones_are_those_of_the_command_line() {
    let of = |field_page, kind| {
        let settings =
            AnalysisSettings { field_curves: true, field_page, ..AnalysisSettings::default() };
        figure(kind, settings)
    };
    let zones = of(FieldPage::Longitudinal, FigureKind::Longitudinal);
    let printed = done_json(&["analyze", LENS, "longitudinal"], "");
    let colors = list(&printed["fields"][0]["colors"]);
    for (curve, color) in zones.rows[0][0].curves.iter().zip(colors) {
        for zone in list(&color["zones"]) {
            let pupil = zone["pupil"].as_f64().unwrap();
            let own = curve.pieces.iter().flatten().find(|own| (own[1] - pupil).abs() < 1e-9);
            let printed = zone["focus"].as_f64();
            let wrong = own.zip(printed).map(|(own, printed)| (own[0] - printed).abs());
            assert_eq!(own.is_some(), printed.is_some(), "{own:?} {zone}");
            assert!(wrong.is_none_or(|wrong| wrong < 1e-9), "{own:?} {zone}");
        }
    }
    let grid = of(FieldPage::Grid, FigureKind::Grid);
    let printed = done_json(&["analyze", LENS, "distortion-grid"], "");
    let points = list(&printed["fields"][0]["points"]);
    let real = &grid.tables[0].curves[1].pieces[0];
    assert_eq!(real.len(), points.len());
    for (own, point) in real.iter().zip(points) {
        for k in 0..2 {
            assert!((own[k] - point["real"][k].as_f64().unwrap()).abs() < 1e-9);
        }
    }
    let curves = of(FieldPage::Curves, FigureKind::FieldCurves);
    let printed = done_json(&["analyze", LENS, "distortion"], "");
    let edge = list(&printed["fields"]).last().unwrap();
    let distortion = &curves.rows[0][0];
    let own = value_at(distortion, "image plane", edge["y"].as_f64().unwrap());
    let expected = 100.0 * edge["in_plane"]["value"].as_f64().unwrap();
    assert!((own - expected).abs() < 1e-6, "{own} {expected}");
}

#[test]
fn seidel_sums_are_the_same_in_both_and_add_up() {
    let own = figure(FigureKind::Seidel, AnalysisSettings::default());
    let printed = done_json(&["analyze", LENS, "seidel"], "");
    let found = &printed["fields"][0];
    let names = ["s1", "s2", "s3", "s4", "s5", "c1", "c2"];
    for (chart, name) in own.tables.iter().zip(names) {
        let bars = &chart.curves[0].pieces[0];
        let mut sum = 0.0;
        for (bar, surface) in bars.iter().zip(list(&found["surfaces"])) {
            let expected = 1e3 * surface[name].as_f64().unwrap();
            assert!((bar[1] - expected).abs() < 1e-9 * expected.abs().max(1e-6), "{name} {bar:?}");
            sum += expected;
        }
        let total = 1e3 * found["total"][name].as_f64().unwrap();
        assert!((sum - total).abs() < 1e-9 * (1.0 + total.abs()), "{name}: {sum} {total}");
        assert!((chart.curves[1].pieces[0][0][1] - total).abs() < 1e-9, "{name}");
    }
    let text = done(&["analyze", LENS, "seidel"], "");
    assert!(text.contains("S1") && text.contains("sum"), "{text}");
    let grin = ["analyze", "lenses/wood_lens_60.json", "seidel"];
    refused(2, &grin, "", &["third-order", "gradient-index"]);
}

/// Numbers that follow in the background, and a file of them.
#[test]
fn contrast_and_images_by_rays_are_exported_with_the_numbers_of_the_command_line() {
    let mut session = Session::new(triplet(), || {}).unwrap();
    for setting in [
        PanelSetting::Contrasts(true),
        PanelSetting::ContrastPage(ContrastPage::Field),
        PanelSetting::ContrastFrequency(Some(40.0)),
        PanelSetting::Wavefronts(true),
        PanelSetting::RayImages(true),
    ] {
        session.apply(Command::Show(setting));
    }
    let path = std::env::temp_dir().join(format!("aplanat-figure-{}.csv", std::process::id()));
    let early = export(FigureKind::Energy, &path);
    session.apply(early);
    assert!(!path.exists(), "nobody asked for the images of a point by diffraction");
    let is_there = |results: &AnalysisResults| {
        let found = results.analyses.as_ref();
        found.is_ok_and(|found| found.field_contrast.is_some() && found.ray_images.is_some())
    };
    for _ in 0..3000 {
        if session.results().is_some_and(|results| is_there(&results)) {
            break;
        }
        session.poll();
        std::thread::sleep(Duration::from_millis(20));
    }
    let results = session.results().unwrap();
    let own = analysis_figure(FigureKind::FieldContrast, &results).unwrap();
    let printed = ["analyze", LENS, "field-mtf", "--frequencies", "10,20,40", "--error", "0.3%"];
    let printed = done_json(&printed, "");
    let heights = list(&printed["fields"][0]["heights"]);
    assert_eq!(heights.len(), 11);
    for height in heights {
        let y = height["height"].as_f64().unwrap();
        for (point, nu) in list(&height["points"]).iter().zip(["10", "20", "40"]) {
            for (section, name) in [("tangential", "T"), ("sagittal", "S")] {
                let modulus = &point[section]["modulus"];
                let [value, error] = ["value", "error"].map(|key| modulus[key].as_f64().unwrap());
                let own = value_at(&own.rows[0][0], &format!("{nu}/mm {name}"), y);
                assert!(
                    (own - value).abs() <= 2.0 * error + 1e-9,
                    "{y} {nu} {name}: {own} {value}"
                );
            }
        }
    }
    let saved = export(FigureKind::RayEnergy, &path);
    session.apply(saved);
    let table = std::fs::read_to_string(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    assert!(table.starts_with("# Encircled energy by rays\r\n"), "{table}");
    let rows: Vec<&str> = table.lines().filter(|line| line.starts_with("Encircled")).collect();
    assert!(rows.len() > 3 * 20, "{table}");
    check_energies(&results);
}

/// Shares of light grow up to the whole, and agree with those of the command line at the same circles.
fn check_energies(results: &AnalysisResults) {
    let images = results.analyses.as_ref().unwrap().ray_images.clone().unwrap();
    let first = images.value.fields[0].value.as_ref().unwrap();
    let shares: Vec<f64> = first.image.energy.iter().map(|share| share.value).collect();
    assert!(shares.is_sorted() && (shares[shares.len() - 1] - 1.0).abs() < 1e-9, "{shares:?}");
    let radii: Vec<String> = first.radii[2..12].iter().map(ToString::to_string).collect();
    let list_of_radii = radii.join(",");
    let printed = ["analyze", LENS, "geometric-energy", "--field", "0", "--radii", &list_of_radii];
    let printed = done_json(&printed, "");
    for (circle, own) in
        list(&printed["fields"][0]["circles"]).iter().zip(&first.image.energy[2..12])
    {
        let energy = &circle["energy"];
        let [value, error] = ["value", "error"].map(|key| energy[key].as_f64().unwrap());
        let allowed = 2.0 * (error + own.error) + 2e-3;
        assert!((value - own.value).abs() <= allowed, "{circle} {own:?}");
    }
}

#[test]
fn images_by_rays_are_printed_and_drawn() {
    let folder = std::env::temp_dir().join(format!("aplanat-rays-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for (kind, word) in [
        ("geometric-psf", "lg density"),
        ("geometric-energy", "share of the light"),
        ("seidel", "S4 Petzval"),
        ("field-mtf", "tangential"),
    ] {
        let svg = folder.join(format!("{kind}.svg"));
        let csv = folder.join(format!("{kind}.csv"));
        let [svg, csv] = [&svg, &csv].map(|path| path.to_str().unwrap());
        let options = ["--error", "2%", "--plot", svg, "--csv", csv];
        // Others refuse it.
        let own: &[&str] = if kind == "field-mtf" { &["--frequencies", "20"] } else { &[] };
        let command = [&["analyze", LENS, kind][..], &options, own].concat();
        assert!(done(&command, "").contains("ms"), "{kind}");
        assert!(std::fs::read_to_string(svg).unwrap().contains(word), "{kind}");
        assert!(std::fs::read_to_string(csv).unwrap().lines().count() > 10, "{kind}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
