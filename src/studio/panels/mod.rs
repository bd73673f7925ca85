//! The panels of the window.

mod cell_layout;
mod contrast;
mod edit_form;
mod effects;
mod fans;
mod field_curves;
mod figure_view;
mod first_order;
mod footprint;
mod ghosts;
mod glass;
pub(super) mod grin;
mod history;
mod import_report;
mod layout;
mod optimizer;
mod pareto;
mod picture;
mod prescription;
mod pupil;
mod search;
mod seidel;
mod specification;
mod spot;
mod spot_map;
mod system;
mod tolerances;
mod wavefront;
pub(super) mod widgets;
mod zoom;

pub use contrast::ContrastPanel;
pub use effects::EffectsPanel;
pub use fans::FansPanel;
pub use field_curves::FieldCurvesPanel;
pub use first_order::FirstOrderPanel;
pub use footprint::FootprintPanel;
pub use ghosts::GhostsPanel;
pub use glass::GlassPanel;
pub use grin::GrinPanel;
pub use history::HistoryPanel;
pub use import_report::ImportReportPanel;
pub use layout::LayoutPanel;
pub use optimizer::OptimizerPanel;
pub(super) use optimizer::term_edits;
pub use pareto::ParetoPanel;
pub use picture::PicturePanel;
pub use prescription::PrescriptionPanel;
pub(super) use prescription::first_radius_field;
pub use pupil::PupilPanel;
pub use search::SearchPanel;
pub use seidel::SeidelPanel;
pub use specification::SpecificationPanel;
pub use spot::SpotPanel;
pub use spot_map::SpotMapPanel;
pub use system::SystemPanel;
pub use tolerances::TolerancesPanel;
pub use wavefront::WavefrontPanel;
pub use zoom::ZoomPanel;

use std::sync::Arc;

use egui::{Context, Ui};
use serde::{Deserialize, Serialize};

use super::draw::RenderBackend;
use super::number;
use super::text::capitalize;
use crate::analysis::{Estimate, ImageQuality, Spot};
use crate::lens::{Edit, FieldKind, FieldPoint, Lens, ParameterKind, add_variables, apply_edit};
use crate::session::{Analyses, AnalysisResults, SessionView};
use crate::studio::actions::Actions;

/// A part of the window. It shows a view and writes down actions; it changes nothing.
pub trait Panel {
    /// The title on its tab.
    fn title(&self) -> &'static str;

    /// Shows it.
    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions);

    /// True if one of its text fields is being edited.
    fn is_typing(&self, _context: &Context) -> bool {
        false
    }
}

/// A kind of panel, as the saved arrangement of the window stores it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PanelKind {
    /// The lens in section, with its rays.
    Layout,
    /// A slice through a gradient-index field, as it is formed.
    Slice,
    /// The table of surfaces.
    Prescription,
    /// The spot diagram of every field.
    Spot,
    /// The pupil of every field, with what limits it.
    Pupil,
    /// The contrast of every field against spatial frequency.
    Contrast,
    /// The wavefront of every field, and the image of a point by diffraction.
    Wavefront,
    /// The transverse aberration of every field over its pupil.
    Fans,
    /// Distortion, field curvature and illumination over the field.
    FieldCurves,
    /// The edge of every field's beam on a surface.
    Footprint,
    /// The spot over the whole field.
    SpotMap,
    /// Light that two surfaces reflect.
    Ghosts,
    /// A scene seen through the lens.
    Picture,
    /// The glasses of all catalogues.
    Glass,
    /// A lens from a specification.
    Specification,
    /// Manufacturing errors and what they do to the lens.
    Tolerances,
    /// The search for a better lens.
    Optimizer,
    /// The Pareto front of sharpness against light.
    Pareto,
    /// The search over structure.
    Search,
    /// The versions of the design.
    History,
    /// Focal lengths and pupils.
    FirstOrder,
    /// The third-order sums of every surface.
    Seidel,
    /// The physical effects that are computed, and why.
    Effects,
    /// Aperture, fields, wavelengths, object and image.
    System,
    /// The differences between zoom positions.
    Zoom,
    /// The outcome of the lines of a foreign file.
    ImportReport,
}

impl PanelKind {
    /// Every panel. A new one is a file in this folder, an entry here and a place in the window.
    pub const ALL: [Self; 26] = [
        Self::Layout,
        Self::Slice,
        Self::Prescription,
        Self::Spot,
        Self::Pupil,
        Self::Contrast,
        Self::Wavefront,
        Self::Fans,
        Self::FieldCurves,
        Self::Footprint,
        Self::SpotMap,
        Self::Ghosts,
        Self::Picture,
        Self::Glass,
        Self::Specification,
        Self::Tolerances,
        Self::Optimizer,
        Self::Pareto,
        Self::Search,
        Self::History,
        Self::FirstOrder,
        Self::Seidel,
        Self::Effects,
        Self::System,
        Self::Zoom,
        Self::ImportReport,
    ];

    /// The content of the panel, in the words by which a designer looks for it.
    pub const fn contents(self) -> &'static str {
        match self {
            Self::Layout => "The section with its rays, and the handles that shape the lens",
            Self::Slice => "A gradient-index field (GRIN) designed for given light",
            Self::Prescription => "Lens data: radii, thicknesses, glasses, variables, pickups",
            Self::Spot => "Where the rays of each field land: RMS and GEO radius",
            Self::Pupil => "Vignetting: the part of the pupil that gets through, and its limits",
            Self::Contrast => {
                "Modulation transfer function: contrast against spatial frequency, field and focus"
            }
            Self::Wavefront => {
                "OPD maps, point spread (PSF), Strehl ratio, encircled energy, Zernike"
            }
            Self::Fans => "Transverse aberration over the pupil, OPD fans",
            Self::FieldCurves => {
                "Distortion, field curvature, astigmatism, colour, relative illumination, grid"
            }
            Self::Footprint => "The beam of each field on a surface, with its rim",
            Self::SpotMap => "A map of the RMS radius, full field",
            Self::Ghosts => "Light that two surfaces reflect, stray light, by coating",
            Self::Picture => "Image simulation: a scene through the lens",
            Self::Glass => "Glass catalogues as a list and as a map of nd and vd",
            Self::Specification => "A lens from focal length, aperture, field and limits",
            Self::Tolerances => "Manufacturing errors, sensitivities, yield, compensators",
            Self::Optimizer => "Merit function, operands, limits, local optimization",
            Self::Pareto => "The best lenses between sharpness and light",
            Self::Search => "Global search over the structure: elements come and go",
            Self::History => "Every version of the design as a tree; branches, comparison",
            Self::FirstOrder => "Cardinal points: focal lengths, pupils, f-numbers, track",
            Self::Seidel => "Third-order aberrations of each surface",
            Self::Effects => "Which physical effects are computed, and why",
            Self::System => "Aperture, fields, wavelengths, object, image plane, name, notes",
            Self::Zoom => "Multi-configuration: what differs between zoom positions",
            Self::ImportReport => {
                "What was lost, locked or approximated of a file of another program"
            }
        }
    }

    /// A new panel of this kind.
    pub fn panel(self, backend: RenderBackend) -> Box<dyn Panel> {
        match self {
            Self::Layout => Box::new(LayoutPanel::new(backend)),
            Self::Slice => Box::new(GrinPanel::new(backend)),
            Self::Prescription => Box::new(PrescriptionPanel::default()),
            Self::Spot => Box::new(SpotPanel::new(backend)),
            Self::Pupil => Box::new(PupilPanel::default()),
            Self::Contrast => Box::new(ContrastPanel::default()),
            Self::Wavefront => Box::new(WavefrontPanel::default()),
            Self::Fans => Box::new(FansPanel),
            Self::FieldCurves => Box::new(FieldCurvesPanel),
            Self::Footprint => Box::new(FootprintPanel::default()),
            Self::SpotMap => Box::new(SpotMapPanel::default()),
            Self::Ghosts => Box::new(GhostsPanel::default()),
            Self::Picture => Box::new(PicturePanel::default()),
            Self::Glass => Box::new(GlassPanel::default()),
            Self::Specification => Box::new(SpecificationPanel::default()),
            Self::Tolerances => Box::new(TolerancesPanel::default()),
            Self::Optimizer => Box::new(OptimizerPanel::default()),
            Self::Pareto => Box::new(ParetoPanel::default()),
            Self::Search => Box::new(SearchPanel::default()),
            Self::History => Box::new(HistoryPanel::default()),
            Self::FirstOrder => Box::new(FirstOrderPanel),
            Self::Seidel => Box::new(SeidelPanel::default()),
            Self::Effects => Box::new(EffectsPanel),
            Self::System => Box::new(SystemPanel::default()),
            Self::Zoom => Box::new(ZoomPanel::default()),
            Self::ImportReport => Box::new(ImportReportPanel),
        }
    }
}

/// The newest numbers, if the lens has any.
fn design_results(view: &SessionView) -> Option<&Analyses> {
    view.results.as_ref()?.analyses.as_ref().ok()
}

/// The reason why a search cannot start from a lens without light.
const NO_LIGHT: &str = "No light gets through this lens";

/// True if the analysis of the design has failed.
fn is_dark(view: &SessionView) -> bool {
    view.results.is_some() && design_results(view).is_none()
}

/// The results that drawings show: those of the previewed lens if there are any, else the design's.
fn displayed_results(view: &SessionView) -> Option<(&Arc<AnalysisResults>, &Analyses)> {
    let results = view.preview_results.as_ref().or(view.results.as_ref())?;
    Some((results, results.analyses.as_ref().ok()?))
}

/// The share of the pupil through which a field is lit.
fn pupil_share(spot: Option<&Spot>) -> f64 {
    let colors = spot.iter().flat_map(|spot| &spot.channels).flatten();
    colors.map(|color| color.area.value).fold(0.0, f64::max) / std::f64::consts::PI
}

/// The name of the one number for the sharpness of a lens, the same everywhere, and what it is.
pub(super) const RMS_OVER_FIELDS: &str = "RMS over the fields";
pub(super) const RMS_OVER_FIELDS_HINT: &str = "RMS over the fields: the root mean square of the RMS spot radii of all fields, by their weights";

/// The RMS spot radius over the fields with light in mm, as the Pareto front and the search have it.
pub(super) fn rms_over_fields(numbers: &Analyses) -> Option<f64> {
    quality(numbers).spot.ok().map(|spot| spot.value)
}

/// The light of a lens: the mean area of its pupils in mm², over fields and wavelengths by weight.
fn mean_pupil_area(numbers: &Analyses) -> f64 {
    quality(numbers).light.value
}

fn quality(numbers: &Analyses) -> ImageQuality {
    let fields = numbers.spots.value.iter().zip(&numbers.ray_model.value.fields);
    let parts = fields.map(|(spot, field)| (field.weight, ImageQuality::of_spot(spot)));
    ImageQuality::mean(&parts.collect::<Vec<_>>())
}

/// The edit, if the lens stays valid with it.
///
/// # Errors
/// The reason why it would not.
fn valid_edit(lens: &Lens, edit: Edit) -> Result<Edit, String> {
    apply_edit(lens, &edit).map(|_| edit).map_err(|why| why.to_string())
}

/// The edit that lets the optimizer change some kinds of numbers too.
pub(super) fn add_variables_edit(lens: &Lens, kinds: &[ParameterKind]) -> Edit {
    let mut freed = lens.clone();
    add_variables(&mut freed, kinds);
    Edit::SetVariables(freed.variables)
}

/// The smallest error that is shown as a number, in percent.
const SMALLEST_PERCENT: f64 = 0.001;
/// The smallest error of a share that is told as a number.
const SMALLEST_ERROR: f64 = 1e-5;

/// The relative error of a number in percent, as a suffix; nothing if it is only rounding.
fn relative_error(estimate: Estimate) -> String {
    if !number::is_error(estimate.value, estimate.error) || estimate.value == 0.0 {
        return String::new();
    }
    format!(" {}", percent_error(100.0 * (estimate.error / estimate.value).abs()))
}

/// An error in percent.
fn percent_error(percent: f64) -> String {
    if percent < SMALLEST_PERCENT {
        return format!("± <{SMALLEST_PERCENT} %");
    }
    format!("± {} %", number::format_digits(percent, 2))
}

/// The error of a number beside 1, as a share or in percent, in the notation of such numbers.
fn plain_error(error: f64, unit: &str) -> String {
    if error < SMALLEST_ERROR {
        return format!("± <{SMALLEST_ERROR}{unit}");
    }
    format!("± {}{unit}", number::format_digits(error, 1))
}

/// Shows why there are no results.
fn show_missing_results(ui: &mut Ui, view: &SessionView) {
    let why = match view.results.as_deref().map(|results| &results.analyses) {
        Some(Err(why)) => capitalize(why),
        _ => "Computing…".to_owned(),
    };
    ui.weak(why);
}

/// The length from the first vertex to the image plane, which may follow a solve; `None` if the lens does not
/// resolve.
fn total_track(lens: &Lens, zoom: usize) -> Option<f64> {
    let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um).ok()?;
    Some(system.total_track())
}

/// The name of a zoom position.
fn zoom_name(lens: &Lens, position: usize) -> String {
    match lens.zoom.get(position).map(|position| position.name.as_str()) {
        None | Some("") => format!("Zoom {}", position + 1),
        Some(name) => name.to_owned(),
    }
}

/// A field point as it is read: `14°`, `20 mm`, with both coordinates where it has two.
fn field_name(kind: FieldKind, field: FieldPoint) -> String {
    let unit = if kind == FieldKind::Angle { "°" } else { " mm" };
    let y = number::format_digits(field.y, 4);
    if field.x == 0.0 {
        return format!("{y}{unit}");
    }
    format!("({}, {y}){unit}", number::format_digits(field.x, 4))
}

/// A mark of an axis that shows decades.
fn decade_name(exponent: f64) -> String {
    if exponent.fract() == 0.0 {
        format!("1e{exponent}")
    } else {
        format!("{:.1e}", 10_f64.powf(exponent))
    }
}
