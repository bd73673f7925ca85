//! Pages of the analysis panels, and the files that they ask for.

use aplanat::report::{FigureFormat, FigureKind};
use aplanat::session::{Analyses, Command, ContrastPage, FieldPage, PanelSetting, SessionView};
use aplanat::studio::file_dialog::FileRequest;
use aplanat::studio::panels::{
    ContrastPanel, FansPanel, FieldCurvesPanel, Panel, SeidelPanel, WavefrontPanel,
};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{PanelState, painted_texts, panel_harness, view};
use crate::panels::results_with_all;

type Bench<P> = Harness<'static, PanelState<P>>;

/// A panel on the double Gauss with some settings, once numbers are there.
fn bench<P: Panel + 'static>(
    panel: P,
    settings: Vec<PanelSetting>,
    are_there: impl Fn(&Analyses) -> bool,
) -> Bench<P> {
    let mut harness = panel_harness(panel, results_with_all(settings, are_there));
    harness.run_steps(3);
    harness
}

fn press<P: Panel>(harness: &mut Bench<P>, label: &str) {
    harness.get_by_label(label).click();
    harness.run_steps(3);
}

fn has_asked<P>(harness: &Bench<P>, setting: &PanelSetting) -> bool {
    harness.state().commands.contains(&Command::Show(setting.clone()))
}

/// A panel asks for a file of what it shows.
fn asks_for<P: Panel>(harness: &mut Bench<P>, kind: FigureKind) {
    press(harness, "Export");
    press(harness, "SVG…");
    let wanted = FileRequest::ExportFigure(kind, FigureFormat::Vector);
    assert_eq!(harness.state().requests.last(), Some(&wanted));
}

/// The number of drawn charts whose description begins like this.
fn charts<P>(harness: &Bench<P>, words: &str) -> usize {
    harness.get_all_by_label_contains(words).count()
}

#[test]
fn fans_show_rays_or_paths_and_export_what_they_show() {
    let fans = vec![PanelSetting::Fans(true)];
    let mut harness = bench(FansPanel, fans.clone(), |all| all.fans.is_some());
    let fields = harness.state().view.lens.fields.values.len();
    assert_eq!(charts(&harness, " tangential: "), fields);
    asks_for(&mut harness, FigureKind::Fans);
    press(&mut harness, "OPD");
    assert!(has_asked(&harness, &PanelSetting::PathFans(true)));
    let paths = [fans, vec![PanelSetting::PathFans(true)]].concat();
    let mut harness = bench(FansPanel, paths, |all| all.path_fans.is_some());
    assert_eq!(charts(&harness, " sagittal: "), fields);
    let texts = painted_texts(&harness);
    assert!(texts.iter().any(|text| text.starts_with("in wavelengths, all plots to")), "{texts:?}");
    asks_for(&mut harness, FigureKind::PathFans);
}

#[test]
fn field_curves_have_zones_and_a_grid() {
    let shown = |page| vec![PanelSetting::FieldCurves(true), PanelSetting::FieldPage(page)];
    let mut harness =
        bench(FieldCurvesPanel, shown(FieldPage::Curves), |all| all.field_curves.is_some());
    press(&mut harness, "Longitudinal");
    assert!(has_asked(&harness, &PanelSetting::FieldPage(FieldPage::Longitudinal)));
    press(&mut harness, "Grid");
    assert!(has_asked(&harness, &PanelSetting::FieldPage(FieldPage::Grid)));
    let mut harness =
        bench(FieldCurvesPanel, shown(FieldPage::Longitudinal), |all| all.longitudinal.is_some());
    harness.get_by_label_contains("Longitudinal aberration: ");
    harness.get_by_label_contains("axial colour 486 nm: ");
    asks_for(&mut harness, FigureKind::Longitudinal);
    let mut harness = bench(FieldCurvesPanel, shown(FieldPage::Grid), |all| all.grid.is_some());
    harness.get_by_label_contains("Distortion grid: ");
    harness.get_by_label_contains("largest distance from the ideal point");
    asks_for(&mut harness, FigureKind::Grid);
}

#[test]
fn seidel_sums_are_bars_as_well() {
    let mut harness = panel_harness(SeidelPanel::default(), view());
    harness.run_steps(3);
    harness.get_by_label("Sum");
    press(&mut harness, "Bars");
    for sum in ["S1 spherical aberration", "S5 distortion", "C2 lateral colour"] {
        assert_eq!(charts(&harness, &format!("{sum}, µm: ")), 1, "{sum}");
    }
    asks_for(&mut harness, FigureKind::Seidel);
}

#[test]
fn contrast_has_pages_over_field_and_focus_with_a_frequency() {
    let shown = |page: ContrastPage| -> Vec<PanelSetting> {
        let frequency = PanelSetting::ContrastFrequency(Some(30.0));
        vec![PanelSetting::Contrasts(true), PanelSetting::ContrastPage(page), frequency]
    };
    let mut harness = bench(ContrastPanel::default(), shown(ContrastPage::Field), |all| {
        all.field_contrast.is_some()
    });
    harness.get_by_label_contains("Contrast: 7.5/mm T ");
    harness.get_by_label("Spatial frequency");
    press(&mut harness, "Auto");
    assert!(has_asked(&harness, &PanelSetting::ContrastFrequency(None)));
    press(&mut harness, "Focus");
    assert!(has_asked(&harness, &PanelSetting::ContrastPage(ContrastPage::Focus)));
    let mut harness = bench(ContrastPanel::default(), shown(ContrastPage::Focus), |all| {
        all.focus_contrasts.is_some()
    });
    harness.get_by_label_contains("30 cycles/mm: ");
    asks_for(&mut harness, FigureKind::FocusContrast);
}

#[test]
fn images_of_a_point_are_by_diffraction_or_by_rays() {
    let shown = vec![PanelSetting::Wavefronts(true), PanelSetting::RayImages(true)];
    let view: SessionView =
        results_with_all(shown, |all| all.ray_images.is_some() && all.wavefronts.is_some());
    let mut harness = panel_harness(WavefrontPanel::default(), view);
    harness.run_steps(3);
    press(&mut harness, "Point spread");
    press(&mut harness, "Rays");
    let fields = harness.state().view.lens.fields.values.len();
    assert_eq!(charts(&harness, "Point spread by rays at "), fields);
    // Its first page shows none.
    assert!(has_asked(&harness, &PanelSetting::RayImages(false)));
    asks_for(&mut harness, FigureKind::RayImage);
    press(&mut harness, "Encircled energy");
    harness.get_by_label_contains("Encircled energy: ");
    asks_for(&mut harness, FigureKind::RayEnergy);
}
