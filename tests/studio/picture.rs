//! The panel of pictures: two lenses beside each other, a line between them, light and noise of a pixel.

use aplanat::lens::{Aperture, Lens};
use aplanat::picture::{
    BuiltInScene, Coloring, ExactRenderer, ImageFrame, PlacedPoints, PointGrid, field_diagonal,
    picture_model,
};
use aplanat::session::{
    AnalysisResults, AnalysisSettings, Command, PanelSetting, PictureOptions, SessionView, Timed,
    analyze,
};
use aplanat::studio::panels::PicturePanel;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use std::sync::Arc;

use crate::harness::{PanelState, double_gauss, painted_texts, panel_harness, view};

type Bench = Harness<'static, PanelState<PicturePanel>>;

/// A view of a lens in front of a white card.
fn seen(lens: Lens) -> SessionView {
    let lens = Arc::new(lens);
    let settings = AnalysisSettings {
        picture: true,
        scene: BuiltInScene::White,
        ..AnalysisSettings::default()
    };
    let analyses = analyze(&lens, &settings);
    let results =
        AnalysisResults { version: 1, lens: Arc::clone(&lens), settings, analyses, ms: 1.0 };
    let settings = results.settings.clone();
    let results = Some(Arc::new(results));
    SessionView { lens, version: 1, settings, results, ..SessionView::default() }
}

/// The double Gauss with this diameter of its entrance pupil.
fn with_pupil(diameter: f64) -> Lens {
    Lens { aperture: Aperture::EntrancePupilDiameter(diameter), ..double_gauss() }
}

fn bench(lens: Lens) -> Bench {
    let mut harness = panel_harness(PicturePanel::default(), seen(lens));
    harness.run();
    harness
}

fn press(harness: &mut Bench, label: &str) {
    harness.get_by_label(label).click();
    harness.run();
}

/// The number behind a word in the line of a lens below the picture.
fn number(harness: &Bench, lens: &str, word: &str) -> f64 {
    let lines = painted_texts(harness);
    let line = lines.iter().find(|line| line.starts_with(&format!("{lens}, pixel"))).unwrap();
    let (_, behind) = line.split_once(word).unwrap();
    let digits: String = behind.trim().chars().take_while(|c| !", %".contains(*c)).collect();
    digits.parse().unwrap()
}

#[test]
fn a_kept_picture_is_compared_with_that_of_another_lens_at_the_same_exposure() {
    let mut harness = bench(with_pupil(10.0));
    harness.get_by_label("Histogram");
    press(&mut harness, "Side by side");
    harness.get_by_label_contains("Nothing to compare with");
    press(&mut harness, "Keep");
    harness.state_mut().view = seen(with_pupil(5.0));
    harness.run();
    let kept = harness.get_by_label("Picture of white through the kept lens").rect();
    let present = harness.get_by_label("Picture of white through the present lens").rect();
    assert!(kept.right() <= present.left() && kept.size() == present.size());
    harness.hover_at(present.center());
    harness.run();
    // A quarter of the area of the pupil is a quarter of the light, and shot noise is its root.
    let light = ["Kept", "Present"].map(|lens| number(&harness, lens, "green"));
    assert!((light[0] - 100.0).abs() < 2.0, "{light:?}");
    assert!((light[1] / light[0] - 0.25).abs() < 0.01, "{light:?}");
    let noise = ["Kept", "Present"].map(|lens| number(&harness, lens, "SNR"));
    // The full well of the first sensor bounds its normal exposure: 0.8 of 14335 electrons.
    assert!((noise[0] - (0.8 * 14_335.0_f64).sqrt()).abs() < 2.0, "{noise:?}");
    assert!((noise[1] / noise[0] - 0.5).abs() < 0.01, "{noise:?}");
    press(&mut harness, "Wipe");
    harness.get_by_label("Line");
    press(&mut harness, "Forget");
    harness.get_by_label_contains("Nothing to compare with");
}

#[test]
fn a_picture_is_magnified_by_the_wheel_about_the_pointer() {
    let mut harness = bench(double_gauss());
    let picture = harness.get_by_label("Picture of white through the lens").rect();
    assert!(harness.query_by_label("Whole picture").is_none());
    let corner = picture.min + egui::vec2(3.0, 3.0);
    harness.hover_at(corner);
    harness.run();
    let before = (number(&harness, "Present", "pixel"), number(&harness, "Present", "red"));
    harness.event(egui::Event::Zoom(8.0));
    harness.run();
    harness.get_by_label("Whole picture");
    // The same pixel is under the pointer, and the opposite corner shows one an eighth as far away.
    assert_eq!(number(&harness, "Present", "pixel"), before.0);
    harness.hover_at(picture.max - egui::vec2(3.0, 3.0));
    harness.run();
    assert!((number(&harness, "Present", "pixel") - 96.0 / 8.0).abs() <= 1.0);
    press(&mut harness, "Whole picture");
    assert!(harness.query_by_label("Whole picture").is_none());
}

#[test]
fn the_error_is_measured_everywhere_only_while_it_is_shown() {
    let asked = |harness: &Bench| {
        let last = harness.state().commands.last().cloned();
        matches!(last, Some(Command::Show(PanelSetting::PictureErrors(true))))
    };
    let mut harness = panel_harness(PicturePanel::default(), view());
    harness.run();
    assert!(!asked(&harness));
    harness.get_by_label("Error").click();
    harness.run_steps(2);
    assert!(asked(&harness));
}

/// The images of points are computed while they are shown, and the picture says that they are.
#[test]
fn images_of_points_are_asked_for_while_they_are_shown() {
    let mut harness = bench(double_gauss());
    harness.get_by_label("Points").click();
    harness.run_steps(2);
    let last = harness.state().commands.last().cloned();
    assert!(matches!(last, Some(Command::Show(PanelSetting::PicturePoints(true)))), "{last:?}");
    harness.get_by_label("Computing the images of points …");
}

/// Images of points over the frame of the double Gauss, by few rays.
fn few_points() -> PlacedPoints {
    let (model, bands) = picture_model(&double_gauss(), 0, Coloring::Rgb(1)).unwrap();
    let frame = ImageFrame::new(&model, [6, 4], field_diagonal(&model).unwrap()).unwrap();
    let scene = BuiltInScene::White.build(&model, &frame, None).unwrap();
    let renderer = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let grid = PointGrid { places: [3, 1], cells: 9, samples: 128 };
    renderer.placed_points(&bands, grid, None, &|| false).unwrap()
}

/// The words below a picture with images of points: their scale, their error, and their sizes.
#[test]
fn images_of_points_have_their_sizes_in_words() {
    let points = few_points();
    let mut view = seen(double_gauss());
    let mut results = (*view.results.take().unwrap()).clone();
    let analyses = results.analyses.as_mut().unwrap();
    let shown = analyses.picture.take().unwrap();
    let mut picture = shown.value.clone().unwrap();
    picture.points = Some(points.clone());
    analyses.picture = Some(Arc::new(Timed { value: Ok(picture), ms: shown.ms }));
    view.results = Some(Arc::new(results));
    let mut harness = panel_harness(PicturePanel::default(), view);
    harness.run();
    press(&mut harness, "Points");
    let texts = painted_texts(&harness);
    let words = texts.iter().find(|text| text.starts_with("Points at infinity, enlarged")).unwrap();
    let parts = [
        "each normalized to its own peak; sampling error".to_owned(),
        format!("% of the peak (rms), {} rays", points.rays),
        "µm of the centroid, at least".to_owned(),
    ];
    for part in parts {
        assert!(words.contains(&part), "{words}");
    }
    let radii = points.images.iter().flatten().map(|image| 1e3 * image.half_light);
    let said = words.split("half of the light within ").nth(1).unwrap();
    let least: f64 = said.split(' ').next().unwrap().parse().unwrap();
    let expected = radii.reduce(f64::min).unwrap();
    assert!((least / expected - 1.0).abs() < 0.01, "{words}: {expected}");
}

/// An exact picture has no error against itself.
#[test]
fn an_exact_picture_says_that_there_is_nothing_to_compare_with() {
    let mut view = seen(double_gauss());
    let settings = AnalysisSettings {
        picture_options: PictureOptions { exact: true, ..PictureOptions::default() },
        ..view.settings.clone()
    };
    let mut results = (*view.results.take().unwrap()).clone();
    results.analyses = analyze(&results.lens, &settings);
    results.settings = settings.clone();
    (view.results, view.settings) = (Some(Arc::new(results)), settings);
    let mut harness = panel_harness(PicturePanel::default(), view);
    harness.run();
    press(&mut harness, "Error");
    harness.get_by_label_contains("Exact: rays are followed from every pixel");
    assert!(harness.query_by_label("Measuring the error …").is_none());
}
