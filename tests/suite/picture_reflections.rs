//! What the surfaces of a lens reflect, in pictures: losses and ghosts, each with its gate.

use crate::cli::{Scratch, done, done_json, refused};
use crate::pictures::{bundled, render, samples};
use crate::reference::number;
use aplanat::analysis::{Coating, ghosts};
use aplanat::lens::{FieldPoint, Lens, Medium, glass};
use aplanat::picture::{
    BuiltInScene, Coloring, ExactRenderer, GhostLight, GhostReport, ImageFrame, LightLosses,
    Pattern, Picture, Scene, SceneLayer, picture_model,
};
use std::ops::ControlFlow;

/// The product of what surfaces let pass at normal incidence.
fn passed(indices: &[f64]) -> f64 {
    indices.windows(2).map(|n| 1.0 - ((n[0] - n[1]) / (n[0] + n[1])).powi(2)).product()
}

/// Bare surfaces around clear glass, or around the glasses of a lens.
fn bare(glasses: Option<&Lens>) -> LightLosses<'_> {
    LightLosses { coating: Coating::Bare, glasses }
}

#[test]
fn losses_are_fresnel_s_near_the_axis_and_scale_a_picture() {
    let lens = bundled("achromat_ac254_100");
    let (model, bands) = picture_model(&lens, 0, Coloring::Rgb(1)).unwrap();
    let frame = ImageFrame::new(&model, [6, 4], 1.0).unwrap();
    let scene = Scene::uniform(1.0);
    let renderer = || ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let clear = renderer().render(&samples(64), &|_| ControlFlow::Continue(()));
    // One share for each colour, and each ray by itself.
    for (tolerance, close) in [(0.5, 1e-9), (1e-7, 2e-3)] {
        let coated = renderer().with_losses(&model, &bands, bare(None), tolerance).unwrap();
        let report = coated.losses().unwrap().clone();
        assert_eq!(report.by_ray, tolerance < 0.1, "{report:?}");
        let green = &model.channels[bands[1].wavelengths[0].0].system;
        let indices: Vec<f64> = std::iter::once(green.index_before)
            .chain(green.surfaces.iter().map(|surface| surface.index))
            .collect();
        let exact = passed(&indices);
        assert!((report.transmission / exact - 1.0).abs() < 2e-3, "{report:?} {exact}");
        assert!(report.variation < 0.02 && report.error < 1e-4, "{report:?}");
        let dim = coated.render(&samples(64), &|_| ControlFlow::Continue(()));
        for (dim, clear) in dim.values.iter().zip(&clear.values) {
            let share = dim[1] / clear[1] / report.transmission;
            assert!((share - 1.0).abs() < close, "{share}");
        }
        assert!((dim.white / clear.white / report.transmission - 1.0).abs() < 1e-12);
    }
}

/// Nearly plane-parallel glasses take away what the catalogue says for their thickness; a glass without data is
/// named and taken as clear.
#[test]
fn glasses_absorb_what_their_catalogue_says() {
    let mut lens = bundled("achromat_ac254_100");
    for row in &mut lens.surfaces {
        row.curvature *= 0.01;
    }
    let (model, bands) = picture_model(&lens, 0, Coloring::Rgb(1)).unwrap();
    let frame = ImageFrame::new(&model, [2, 2], 1.0).unwrap();
    let scene = Scene::uniform(1.0);
    let report = |glasses: Option<&Lens>| {
        let renderer = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
        let found = renderer.with_losses(&model, &bands, bare(glasses), 0.5).unwrap();
        found.losses().unwrap().clone()
    };
    let [clear, real] = [report(None), report(Some(&lens))];
    let um = model.channels[bands[1].wavelengths[0].0].um;
    let expected: f64 = lens
        .surfaces
        .iter()
        .map(|row| match &row.medium {
            Medium::Glass(name) => {
                let properties = glass::find(name).unwrap().properties().unwrap();
                properties.internal_transmission(um, row.thickness).unwrap()
            }
            _ => 1.0,
        })
        .product();
    assert!(expected < 0.9999 && clear.absorbed == 0.0, "{expected} {clear:?}");
    assert!((real.absorbed - (1.0 - expected)).abs() < 1e-12, "{real:?} {expected}");
    // Rays run at small angles.
    let ratio = real.transmission / clear.transmission;
    assert!((ratio / expected - 1.0).abs() < 1e-6, "{ratio} {expected}");
    assert!(real.unknown_absorption.is_empty());
    let mut model_glass = lens.clone();
    model_glass.surfaces[0].medium = Medium::Index(1.5);
    assert_eq!(report(Some(&model_glass)).unknown_absorption.len(), 1);
}

/// A small light on the axis, at infinity.
fn light(radius: f64, radiance: f64) -> Scene {
    let pattern = Pattern::Uniform { radiance: [radiance; 3], cover: 1.0 };
    let half_size = [radius; 2];
    let layer =
        SceneLayer { distance: None, center: [0.0; 2], half_size, velocity: [0.0; 2], pattern };
    Scene::new(vec![layer], [0.0; 3], 1.0).unwrap()
}

/// The light of all ghosts of a small source, counted on the sensor, is that of the analysis of each, whose
/// rays begin on a grid.
#[test]
fn ghosts_in_a_picture_carry_the_light_of_their_analysis() {
    let lens = bundled("double_gauss_rudolph_50");
    let (model, bands) = picture_model(&lens, 0, Coloring::Gray).unwrap();
    let middle = bands[0].wavelengths[bands[0].wavelengths.len() / 2].0;
    let small = ImageFrame::new(&model, [32, 32], 20.0).unwrap();
    // A sensor that takes up all of them.
    let frame = ImageFrame::new(&model, [32, 32], 400.0).unwrap();
    let half = 0.02;
    let scene = light(half, 1.0);
    let picture = render(&model, &bands, &Scene::uniform(1.0), small, samples(4));
    let picture = Picture { frame, ..picture };
    let found =
        GhostLight::new((&model, &bands), &scene, &picture, (Coating::Bare, 1e-12)).unwrap();
    let [followed, all] = found.report.pairs;
    // Those left out carry a thousandth of the light.
    assert!(found.report.on && all == 45 && followed > 20, "{:?}", found.report);
    let mut dark = Picture { values: vec![[0.0; 3]; 32 * 32], ..picture };
    found.add_to(&mut dark);
    let pixel = frame.pitch * frame.pitch;
    let counted = dark.values.iter().map(|value| value[0]).sum::<f64>() * pixel;
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let (_, each) = ghosts(&model, (axis, middle), Coating::Bare, (45, 4000)).unwrap();
    let flux: f64 = each.iter().map(|g| 0.5 * (g.patch.flux[0] + g.patch.flux[1])).sum();
    let pupil = model.first_order.entrance_pupil.diameter.unwrap();
    let arriving = 4.0 * half * half * std::f64::consts::PI * 0.25 * pupil * pupil;
    let exact = flux * arriving;
    assert!((counted / exact - 1.0).abs() < 0.05, "{counted:e} {exact:e}");
}

#[test]
fn ghosts_are_in_a_picture_only_where_they_matter() {
    let lens = bundled("double_gauss_rudolph_50");
    let (model, bands) = picture_model(&lens, 0, Coloring::Gray).unwrap();
    let frame = ImageFrame::new(&model, [12, 8], 20.0).unwrap();
    let scene = Scene::uniform(1.0);
    let picture = render(&model, &bands, &scene, frame, samples(16));
    let report = |coating: Coating| {
        let ghosts = GhostLight::new((&model, &bands), &scene, &picture, (coating, 0.01)).unwrap();
        let mut changed = picture.clone();
        ghosts.add_to(&mut changed);
        assert_eq!(changed == picture, !ghosts.report.on);
        assert_eq!(ghosts.report.on, ghosts.report.change > 0.01);
        ghosts.report
    };
    let [bare, weak] = [Coating::Bare, Coating::Flat(1e-4)].map(report);
    assert!(bare.on && !weak.on, "{bare:?} {weak:?}");
    assert!(weak.change < 0.1 * bare.change, "{bare:?} {weak:?}");
}

/// The layers of a class, given one by one, take and throw back the same light: losses and ghosts see layers.
#[test]
fn a_coating_by_its_layers_is_that_of_its_class() {
    let lens = bundled("double_gauss_rudolph_50");
    let (model, bands) = picture_model(&lens, 0, Coloring::Gray).unwrap();
    let frame = ImageFrame::new(&model, [12, 8], 20.0).unwrap();
    let scene = Scene::uniform(1.0);
    let picture = render(&model, &bands, &scene, frame, samples(16));
    let quarter = format!("1.38:{}", 550.0 / 4.0 / 1.38);
    let layers = Coating::parse(&quarter).unwrap();
    let [by_class, by_layers, bare] =
        [Coating::SingleLayer, layers, Coating::Bare].map(|coating| {
            let taken = LightLosses { coating, glasses: None };
            let renderer = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
            let renderer = renderer.with_losses(&model, &bands, taken, 0.01).unwrap();
            let ghosts =
                GhostLight::new((&model, &bands), &scene, &picture, (coating, 0.01)).unwrap();
            [renderer.losses().unwrap().transmission, ghosts.report.change]
        });
    for (found, exact) in by_layers.iter().zip(by_class) {
        assert!((found / exact - 1.0).abs() < 1e-9, "{by_layers:?} {by_class:?}");
    }
    assert!(bare[0] < 0.9 * by_layers[0] && bare[1] > 2.0 * by_layers[1], "{bare:?} {by_layers:?}");
    let out = Scratch::new("layers.png");
    let wrong = ["picture", LENS, "--scene=white", "--coating=1.38:100+", "--out", out.path()];
    refused(2, &wrong, "", &["1.38:100+", "index:nm"]);
}

const LENS: &str = "lenses/double_gauss_rudolph_50.json";

/// Small lights on black are found by the rays that look for them, so that no cell is the noise of a few.
#[test]
fn the_ghosts_of_small_lights_are_known() {
    let lens = bundled("double_gauss_rudolph_50");
    let (model, bands) = picture_model(&lens, 0, Coloring::Gray).unwrap();
    let frame = ImageFrame::new(&model, [12, 8], 40.0).unwrap();
    let scene = BuiltInScene::Lights.build(&model, &frame, None).unwrap();
    let white = ExactRenderer::new(&model, &bands, &scene, frame).unwrap().white();
    let picture = render(&model, &bands, &Scene::uniform(1.0), frame, samples(16));
    let picture = Picture { white, ..picture };
    let ghosts =
        GhostLight::new((&model, &bands), &scene, &picture, (Coating::Bare, 1e-9)).unwrap();
    let GhostReport { change, error, .. } = ghosts.report;
    assert!(change > 0.0 && error < 0.3 * change, "{change} {error}");
}

/// In many cells each has few rays; the light that they have found is not taken for none.
#[test]
fn the_ghosts_of_small_lights_in_many_cells_are_shown() {
    for coating in ["none", "single-layer"] {
        let out = Scratch::new("lights.png");
        let coating = format!("--coating={coating}");
        let asked = ["picture", LENS, "--scene=lights", "--pixels=96x64", "--quick", &coating];
        let arguments =
            [&asked[..], &["--error=0.1%", "--device=cpu", "--out", out.path()]].concat();
        let ghosts = &done_json(&arguments, "")["ghosts"];
        let [change, error] = ["change", "error"].map(|key| ghosts[key].as_f64().unwrap());
        assert!(ghosts["on"] == true && change > 0.0 && error > 0.0, "{coating}: {ghosts}");
    }
}

#[test]
fn a_picture_through_a_coated_lens_says_so_in_its_file() {
    let (out, map) = (Scratch::new("coated.png"), Scratch::new("errors.png"));
    let map_option = format!("--error-map={}", map.path());
    let arguments = [
        "picture",
        LENS,
        "--scene=white",
        "--pixels=24x16",
        "--coating=none",
        "--quick",
        "--out",
        out.path(),
        &map_option,
    ];
    let report = done_json(&arguments, "");
    let losses = &report["losses"];
    let reflected = number(&losses["transmission"]) / (1.0 - number(&losses["absorbed"]));
    assert!((reflected - 0.665).abs() < 5e-3, "{losses}");
    let left_out = report["left_out"].as_array().unwrap();
    assert!(left_out.iter().all(|effect| effect["effect"] != "losses"), "{left_out:?}");
    assert!(left_out.iter().any(|effect| effect["effect"] == "polarisation"), "{left_out:?}");
    assert_eq!(report["ghosts"]["on"], number(&report["ghosts"]["change"]) > 0.01);
    assert_eq!(report["error_map"]["tiles"], 2);
    let heat = image::open(&map.0).unwrap();
    assert_eq!([heat.width(), heat.height()], [24, 16]);
    let file = std::fs::read(&out.0).unwrap();
    let stored = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
    let texts = &stored.info().utf8_text;
    let data = texts.iter().find(|text| text.keyword == "Aplanat picture").unwrap();
    assert!(data.get_text().unwrap().contains("transmission"));
    let text = done(&arguments, "");
    assert!(
        text.contains("losses on: no coating, 65.9 % arrives on the axis, glass absorbs 0.29 %")
            && text.contains("error of all 2"),
        "{text}"
    );
}

#[test]
fn lenses_whose_reflections_are_not_known_are_refused() {
    let out = Scratch::new("mirror.png");
    let base = ["picture", "lenses/telescope_rc_f8.json", "--scene=white", "--pixels=6x4"];
    let more = ["--coating=v", "--out", out.path()];
    refused(2, &[&base[..], &more].concat(), "", &["surface 1", "mirror"]);
    let wrong = ["picture", LENS, "--scene=white", "--coating=gold", "--out", out.path()];
    refused(2, &wrong, "", &["gold", "single-layer"]);
}
