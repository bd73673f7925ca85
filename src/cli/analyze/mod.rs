//! `analyze`: the results that a designer reads, each number with its error, rays and milliseconds.

mod caption;
mod charts;
mod chief;
mod color;
mod contrast;
mod contrast_over_field;
mod csv;
mod each_field;
mod encircled;
mod fan;
mod field_charts;
mod focus;
mod ghosts;
mod illumination;
mod light;
mod options;
mod point_spread;
mod ray_image;
mod seidel;
mod spot;
mod spot_map;
mod thermal;
mod wavefront;

use super::effects::{AllowedSetting, EffectArgs, EffectReport, EffectRule};
use super::error::CliError;
use super::failures::Failures;
use super::input::{LensFile, LoadedLens, Tolerance};
use super::output::{Output, ShortNumber, counted, without_rounding};
use super::output_paths::OutputPaths;
use crate::analysis::{AnalysisError, Coating, ContrastLimit, Estimate, ImageLight};
use crate::effects::{self, Effect, EffectPlan, TracePurpose};
use crate::files;
use crate::lens::{FieldKind, FieldPoint, SurfaceNumber};
use crate::measure::time_ms;
use crate::picture::Scene;
use crate::plot::CurveChart;
use crate::pupil::{Accuracy, RayModel};
use crate::trace::{Fate, Fates};
use clap::ValueEnum;
use light::AskedLight;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// Spot, fans, distortion, ...: each number with its estimated error, rays and milliseconds
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/analyze.txt"))]
pub(super) struct AnalyzeArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The analysis
    what: AnalysisKind,

    /// Tolerance: `0.1%` or `1e-3`; relative for radii, the RMS wavefront and `illumination`; absolute for
    /// contrast, for intensities over the perfect peak, for shares of the light and for coefficients in wavelengths;
    /// absent: 0.1%
    #[arg(long, value_name = "TOLERANCE")]
    error: Option<Tolerance>,

    /// Only this field, in the unit of the lens's fields; absent: all fields
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    field: Option<f64>,

    /// The light of `wavefront`, `opd-fan`, `zernike`, `psf` and `encircled-energy`: a wavelength of the lens in um,
    /// primary, or all of them by their weights (the last two analyses only); absent: primary
    #[arg(long, value_name = "UM")]
    wavelength: Option<AskedLight>,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,

    /// Spatial frequencies of `mtf`, `field-mtf` and `through-focus-mtf` (the first one), in cycles/mm; absent:
    /// 10,20,30,40,50
    #[arg(long, value_name = "NU", value_delimiter = ',')]
    frequencies: Option<Vec<f64>>,

    /// The surface of `footprint`, counted from 1; absent: the first
    #[arg(long, value_name = "N")]
    surface: Option<usize>,

    /// A point of `psf`, as `x,y` in mm from the image point of the chief ray, or of the image for
    /// `illumination`, from the axis; may be repeated
    #[arg(long = "at", value_name = "X,Y", value_parser = parse_point, allow_hyphen_values = true)]
    points: Vec<[f64; 2]>,

    /// The distance in um from the image point of the chief ray that the --plot of `psf` reaches; absent: 5 lambda F,
    /// or the circle with 99 % of the rays where that is larger
    #[arg(long, value_name = "UM", requires = "plot")]
    reach: Option<f64>,

    /// A point of the pupil for `wavefront`, as `px,py` in units of its radius; may be repeated; absent: a
    /// map of the disc
    #[arg(long = "pupil", value_name = "PX,PY", value_parser = parse_point, allow_hyphen_values = true)]
    pupil_points: Vec<[f64; 2]>,

    /// The radii of the circles of `encircled-energy` and `geometric-energy` in mm; absent: ten, up to 6 lambda F
    /// or what holds 95 % of the light if that is within 30 lambda F, or up to all of the spot
    #[arg(long, value_name = "MM", value_delimiter = ',')]
    radii: Vec<f64>,

    /// The scene at the points of `illumination`: the radiance 1 + 0.5 cos(2 pi (FX X + FY Y) + PHASE), X
    /// and Y being the tangents of the light's direction, or mm with --distance; absent: 1
    #[arg(long, value_name = "FX,FY,PHASE", value_parser = parse_wave, allow_hyphen_values = true)]
    wave: Option<[f64; 3]>,

    /// The distance in mm of the plane in front of the first surface that --wave is painted on; absent:
    /// infinity
    #[arg(long, value_name = "MM", requires = "wave")]
    distance: Option<f64>,

    /// The coating of `ghosts` between air and glass: none, single-layer, v, a reflected share as `0.3%`, or layers
    /// from the air as index:nm, `1.38:125.9+2.05:19.4`; absent: none
    #[arg(long, value_name = "COATING", value_parser = parse_coating)]
    coating: Option<Coating>,

    /// The number of pairs of `ghosts` that real rays follow, the brightest by first-order optics; absent: 45
    #[arg(long, value_name = "N")]
    ghosts: Option<usize>,

    /// The temperatures of `thermal` in degrees C; the prescription is that of 20 unless the lens says another;
    /// absent: -20,0,20,40,60
    #[arg(long, value_name = "C", value_delimiter = ',', allow_hyphen_values = true)]
    temperatures: Option<Vec<f64>>,

    /// The linear expansion of the mount for `thermal`, in 1e-6/K; absent: that of the lens, 23.6 (aluminium)
    /// unless it says another
    #[arg(long, value_name = "EXPANSION", allow_negative_numbers = true)]
    mount: Option<f64>,

    /// Writes all numbers as CSV into this file too
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,

    /// Draws the result: .png, .svg or .pdf
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,

    #[command(flatten)]
    effects: EffectArgs,
}

/// The two coordinates of a point.
pub(super) fn parse_point(text: &str) -> Result<[f64; 2], String> {
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    let pair = text.split_once(',').and_then(|(x, y)| Some([number(x)?, number(y)?]));
    pair.ok_or_else(|| "expected two numbers, as in `0.002,-0.001`".to_owned())
}

/// The frequencies and the phase of a wave.
fn parse_wave(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let finite = numbers.filter(|list| list.iter().all(|v| v.is_finite()));
    let wave = finite.and_then(|list| <[f64; 3]>::try_from(list).ok());
    wave.ok_or_else(|| "expected two frequencies and a phase, as in `300,0,0.3`".to_owned())
}

/// A coating.
pub(super) fn parse_coating(text: &str) -> Result<Coating, String> {
    let expected = "expected none, single-layer, v, a reflected share as in `0.3%`, or layers from the \
                    air as index:nm, `1.38:125.9+2.05:19.4`";
    Coating::parse(text).ok_or_else(|| expected.to_owned())
}

/// The analyses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum AnalysisKind {
    /// RMS and geometric radius, centroid, colours
    Spot,
    /// RMS radius over the whole field
    SpotMap,
    /// Transverse ray errors along both sections of the pupil
    Fan,
    /// Chief rays compared with `f tan(theta)` and `f theta`
    Distortion,
    /// Chief rays of a square grid of points against the grid of a lens without distortion
    DistortionGrid,
    /// Chief rays of every wavelength against that of the primary one
    LateralColor,
    /// Crossings of the rays of the axial point with the axis, zone by zone; axial colour
    Longitudinal,
    /// Edge of the beam on a surface
    Footprint,
    /// Tangential and sagittal focus along chief rays
    FieldCurvature,
    /// Light relative to the first field, with the vignetted pupil
    Illumination,
    /// RMS radius at displaced image planes
    ThroughFocus,
    /// RMS and map of the wavefront
    Wavefront,
    /// Path differences along both sections of the pupil
    OpdFan,
    /// Zernike coefficients of the wavefront, in Noll's and the fringe order
    Zernike,
    /// Diffraction image of a point and Strehl ratios
    Psf,
    /// Share of the light within circles, by diffraction
    EncircledEnergy,
    /// Contrast by diffraction and by rays, at one and at all wavelengths
    Mtf,
    /// Contrast by diffraction at displaced image planes
    ThroughFocusMtf,
    /// Contrast from the axis to the edge of the field, at all wavelengths
    FieldMtf,
    /// Density of rays in the image of a point
    GeometricPsf,
    /// Share of the light within circles, by rays
    GeometricEnergy,
    /// Third-order sums of every surface
    Seidel,
    /// Light that two surfaces reflect: size, irradiance, focus and the surfaces
    Ghosts,
    /// Focus and RMS radius at several temperatures, with the image plane where the mount holds it
    Thermal,
}

/// The spatial frequencies in cycles/mm, the surface, the number of ghosts, the temperatures in degrees C and the
/// tolerance that are not asked for otherwise.
const FREQUENCIES: [f64; 5] = [10.0, 20.0, 30.0, 40.0, 50.0];
const SURFACE: usize = 1;
const GHOSTS: usize = 45;
const TEMPERATURES_C: [f64; 5] = [-20.0, 0.0, 20.0, 40.0, 60.0];
const TOLERANCE: f64 = 1e-3;

/// The rule for results at one wavelength.
const ONE_WAVELENGTH: EffectRule = EffectRule {
    effect: Effect::Dispersion,
    allowed: AllowedSetting::AlwaysOff,
    reason: "only the primary wavelength is traced",
};
/// The rule for results at a wavelength that is chosen.
const CHOSEN_WAVELENGTH: EffectRule = EffectRule {
    effect: Effect::Dispersion,
    allowed: AllowedSetting::AlwaysOn,
    reason: "--wavelength chooses the light",
};
/// The rule for results that compare colours.
const COLORS: EffectRule = EffectRule {
    effect: Effect::Dispersion,
    allowed: AllowedSetting::AlwaysOn,
    reason: "the wavelengths are compared",
};
/// The rules for light that leaves the beam, which the plan of a beam says nothing about.
const GHOST_RULES: [EffectRule; 3] = [
    ONE_WAVELENGTH,
    EffectRule {
        effect: Effect::Clipping,
        allowed: AllowedSetting::AlwaysOn,
        reason: "reflected light leaves the beam",
    },
    EffectRule {
        effect: Effect::Asphere,
        allowed: AllowedSetting::AlwaysOn,
        reason: "reflected light leaves the beam",
    },
];
/// The rules for light at a point of the image, which comes from other fields than those of the plan.
const IRRADIANCE_RULES: [EffectRule; 2] = [
    ONE_WAVELENGTH,
    EffectRule {
        effect: Effect::Clipping,
        allowed: AllowedSetting::AlwaysOn,
        reason: "light reaches a point of the image from every direction",
    },
];
/// The rule for fields that the lens does not list.
const ALL_FIELDS: EffectRule = EffectRule {
    effect: Effect::Clipping,
    allowed: AllowedSetting::AlwaysOn,
    reason: "the plan has measured the fields of the lens alone",
};
/// The rule for image heights compared with ideal ones.
const OBJECT_IN_PLACE: EffectRule = EffectRule {
    effect: Effect::FiniteObject,
    allowed: AllowedSetting::AlwaysOn,
    reason: "the ideal heights are those of the object where it is",
};

/// The rule for a comparison of temperatures.
const TEMPERATURES: EffectRule = EffectRule {
    effect: Effect::Temperature,
    allowed: AllowedSetting::AlwaysOn,
    reason: "the analysis compares temperatures",
};

impl AnalysisKind {
    /// The effects that the analysis does not leave to the plan.
    fn effect_rules(self, light: AskedLight) -> &'static [EffectRule] {
        match self {
            Self::Psf | Self::EncircledEnergy if light == AskedLight::All => &[],
            _ if matches!(light, AskedLight::Um(_)) => &[CHOSEN_WAVELENGTH],
            Self::Spot
            | Self::Fan
            | Self::ThroughFocus
            | Self::Mtf
            | Self::GeometricPsf
            | Self::GeometricEnergy => &[],
            Self::Thermal => &[TEMPERATURES],
            Self::LateralColor | Self::Longitudinal | Self::Seidel => &[COLORS],
            Self::Distortion | Self::DistortionGrid => &[ONE_WAVELENGTH, OBJECT_IN_PLACE],
            Self::SpotMap | Self::FieldMtf => &[ALL_FIELDS],
            Self::Ghosts => &GHOST_RULES,
            Self::Illumination => &IRRADIANCE_RULES,
            _ => &[ONE_WAVELENGTH],
        }
    }

    /// The purpose that effects are planned for.
    fn purpose(self, tolerance: f64) -> TracePurpose {
        match self {
            Self::Spot | Self::SpotMap | Self::ThroughFocus | Self::Thermal => {
                TracePurpose::Spot(tolerance)
            }
            Self::Fan | Self::Distortion | Self::DistortionGrid => TracePurpose::Trace,
            _ => TracePurpose::Exact,
        }
    }

    /// The report of the effects: a shift of rays bounds the errors of some analyses only.
    fn effect_report(self, plan: EffectPlan) -> EffectReport {
        match self {
            Self::Spot
            | Self::SpotMap
            | Self::ThroughFocus
            | Self::Thermal
            | Self::Fan
            | Self::Distortion
            | Self::DistortionGrid => EffectReport::counted(plan),
            _ => EffectReport::uncounted(plan.decisions),
        }
    }
}

impl AnalyzeArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        self.check_options()?;
        let mut paths = OutputPaths::reading([("the lens", self.lens.path())]);
        paths.file("--csv", self.csv.as_deref(), &["csv"])?;
        paths.file("--plot", self.plot.as_deref(), &charts::EXTENSIONS)?;
        let run = AnalysisRun::new(self)?;
        match self.what {
            AnalysisKind::Spot => self.finish(&run, spot::spots(&run), output),
            AnalysisKind::SpotMap => self.finish(&run, spot_map::map(&run), output),
            AnalysisKind::Fan => self.finish(&run, fan::fans(&run), output),
            AnalysisKind::Distortion => self.finish(&run, chief::distortions(&run), output),
            AnalysisKind::DistortionGrid => self.finish(&run, chief::grid(&run), output),
            AnalysisKind::LateralColor => self.finish(&run, color::lateral_colors(&run), output),
            AnalysisKind::Longitudinal => self.finish(&run, color::longitudinal(&run), output),
            AnalysisKind::Footprint => {
                let surface = self.surface.unwrap_or(SURFACE);
                self.finish(&run, color::footprints(&run, surface)?, output)
            }
            AnalysisKind::FieldCurvature => self.finish(&run, chief::curvatures(&run), output),
            AnalysisKind::Illumination => self.finish(&run, self.illuminations(&run)?, output),
            AnalysisKind::ThroughFocus => self.finish(&run, focus::through_focus(&run)?, output),
            AnalysisKind::Wavefront => {
                self.finish(&run, wavefront::wavefronts(&run, &self.pupil_points), output)
            }
            AnalysisKind::OpdFan => self.finish(&run, wavefront::path_fans(&run), output),
            AnalysisKind::Zernike => self.finish(&run, wavefront::zernikes(&run), output),
            AnalysisKind::Psf => self.finish(&run, point_spread::point_spreads(&run), output),
            AnalysisKind::EncircledEnergy => {
                encircled::check_radii(&run, &self.radii)?;
                self.finish(&run, encircled::encircled(&run, &self.radii), output)
            }
            AnalysisKind::Mtf => self.finish(&run, contrast::contrasts(&run), output),
            AnalysisKind::ThroughFocusMtf => {
                self.finish(&run, contrast::through_focus(&run), output)
            }
            AnalysisKind::FieldMtf => {
                self.finish(&run, contrast_over_field::over_field(&run), output)
            }
            AnalysisKind::GeometricPsf => self.finish(&run, ray_image::images(&run), output),
            AnalysisKind::GeometricEnergy => {
                self.finish(&run, ray_image::energies(&run, &self.radii), output)
            }
            AnalysisKind::Seidel => self.finish(&run, seidel::sums(&run)?, output),
            AnalysisKind::Ghosts => {
                let (coating, count) = (self.coating.unwrap_or_default(), self.ghosts);
                let lists = ghosts::ghost_lists(&run, coating, count.unwrap_or(GHOSTS))?;
                self.finish(&run, lists, output)
            }
            AnalysisKind::Thermal => {
                let celsius = self.temperatures.as_deref().unwrap_or(&TEMPERATURES_C);
                let found = thermal::temperatures(&run, celsius, self.mount)?;
                self.finish(&run, found, output)
            }
        }
    }

    /// The light at all fields, of the scene that is asked for.
    fn illuminations(
        &self,
        run: &AnalysisRun,
    ) -> Result<Vec<AtField<illumination::IlluminationJson>>, CliError> {
        let wave = self.wave.map(|wave| Scene::wave(wave, self.distance));
        let is_far = self.distance.is_none_or(|distance| distance > 0.0);
        let option = if is_far { "--wave" } else { "--distance" };
        let scene = wave.transpose().map_err(|why| CliError::Input(format!("{option}: {why}")))?;
        Ok(illumination::illuminations(run, scene.as_ref()))
    }

    /// Prints the report of all fields, and writes it as CSV if that is asked for; it is printed too
    /// if it cannot be written.
    fn finish<T: TextLines + Serialize>(
        &self,
        run: &AnalysisRun,
        fields: Vec<AtField<T>>,
        output: &Output,
    ) -> Result<(), CliError> {
        let report = run.report(fields)?;
        let mut failures = Failures::default();
        if let Some(path) = &self.csv {
            let value = serde_json::to_value(&report)
                .map_err(|why| CliError::Failed(format!("{}: {why}", path.display())))?;
            failures.note(files::write_atomic(path, csv::csv(&value).as_bytes()));
        }
        if let Some(path) = &self.plot {
            failures.note(charts::save(run, &report, path));
        }
        failures.note(output.print(&report));
        failures.into_result()
    }

    /// Refuses radii that are no positive numbers, frequencies below zero, more frequencies than are
    /// computed in a short time, and no ghost.
    fn check_numbers(&self) -> Result<(), CliError> {
        if self.ghosts == Some(0) {
            return Err(CliError::Input("--ghosts: found 0; expected 1 or more".to_owned()));
        }
        if let Some(wrong) = self.reach.filter(|um| !(*um > 0.0 && *um <= 1e6)) {
            let text = format!("--reach: found {wrong}; expected um, more than 0 and up to 1e6");
            return Err(CliError::Input(text));
        }
        if let Some(wrong) = self.radii.iter().find(|r| !(**r > 0.0 && r.is_finite())) {
            return Err(CliError::Input(format!(
                "--radii: found {wrong}; expected mm, above zero"
            )));
        }
        let frequencies = self.frequencies.as_deref().unwrap_or_default();
        let count = frequencies.len();
        if count > MOST_FREQUENCIES {
            return Err(CliError::Input(format!(
                "--frequencies: found {count} of them; expected at most {MOST_FREQUENCIES}"
            )));
        }
        if self.what == AnalysisKind::ThroughFocusMtf && frequencies.first() == Some(&0.0) {
            let text =
                "--frequencies: found 0; expected cycles/mm, above zero, for through-focus-mtf";
            return Err(CliError::Input(text.to_owned()));
        }
        match frequencies.iter().find(|nu| !(nu.is_finite() && **nu >= 0.0)) {
            Some(wrong) => Err(CliError::Input(format!(
                "--frequencies: found {wrong}; expected cycles/mm, zero or more"
            ))),
            None => Ok(()),
        }
    }
}

/// The largest number of spatial frequencies, each of which takes an integral over the pupil.
const MOST_FREQUENCIES: usize = 1000;

/// A lens and the options of its analysis.
struct AnalysisRun {
    what: AnalysisKind,
    opened: LoadedLens,
    /// The beginning of an error of the lens at these fields: its file, or the option that names a field.
    blamed: String,
    plan: EffectPlan,
    model: RayModel,
    /// The selected fields.
    fields: Vec<SelectedField>,
    zoom: usize,
    accuracy: Accuracy,
    /// The light of an image or of a wavefront.
    image_light: ImageLight,
    /// The spatial frequencies, in cycles/mm; at least one.
    frequencies: Vec<f64>,
    /// The points of a diffraction image, in mm from the image point of the chief ray.
    points: Vec<[f64; 2]>,
    /// True if the result is drawn as well.
    is_drawn: bool,
    /// The distance in mm that a drawn diffraction image reaches, if it is given.
    reach: Option<f64>,
}

/// A selected field.
#[derive(Debug, Clone, Copy)]
struct SelectedField {
    /// The field in the unit of the lens.
    given: FieldPoint,
    /// The field in the unit of the ray model, an angle where a finite object is moved to infinity.
    traced: FieldPoint,
}

impl AnalysisRun {
    fn new(analyze: &AnalyzeArgs) -> Result<Self, CliError> {
        analyze.check_numbers()?;
        let AnalyzeArgs { what, zoom, .. } = *analyze;
        let asked = what.light(analyze.wavelength)?;
        let choices = analyze.effects.choices(what.effect_rules(asked))?;
        let opened = analyze.lens.open()?;
        let light_um = asked.um(&opened)?;
        opened.check_zoom(zoom)?;
        let listed = &opened.lens.fields_at(zoom).values;
        let chosen = analyze.field.map(|y| opened.field_at(y, zoom)).transpose()?;
        let extra = chosen.filter(|field| !listed.contains(field));
        let all: Vec<FieldPoint> = listed.iter().copied().chain(extra).collect();
        let blamed = opened.blame_field(analyze.field, zoom);
        let refuse = |source| CliError::RayModel { file: opened.file.clone(), source };
        let measured = effects::measure_effects_at(&opened.lens, zoom, &all).map_err(refuse)?;
        let tolerance = analyze.error.map_or(TOLERANCE, |error| error.0);
        let plan = choices.plan(&measured, what.purpose(tolerance));
        let model = effects::build_ray_model_at(&opened.lens, zoom, &all, &plan).map_err(refuse)?;
        let pairs = all.iter().zip(&model.fields);
        let pairs = pairs.map(|(given, traced)| SelectedField { given: *given, traced: *traced });
        let is_selected = |field: &SelectedField| chosen.is_none_or(|only| only == field.given);
        let mut fields: Vec<SelectedField> = pairs.filter(is_selected).collect();
        // Of two equal fields one is enough.
        fields.truncate(chosen.map_or(fields.len(), |_| 1));
        let accuracy = Accuracy { tolerance, ..Accuracy::default() };
        let frequencies = analyze.frequencies.clone().unwrap_or_else(|| FREQUENCIES.to_vec());
        let points = analyze.points.clone();
        let image_light = light::image_light(&model, light_um);
        let is_drawn = analyze.plot.is_some();
        Ok(Self {
            what,
            opened,
            blamed,
            plan,
            model,
            fields,
            zoom,
            accuracy,
            image_light,
            frequencies,
            points,
            is_drawn,
            reach: analyze.reach.map(|um| 1e-3 * um),
        })
    }

    /// The wavelength of a wavefront; the primary one for an image in all light.
    fn wavelength(&self) -> usize {
        match self.image_light {
            ImageLight::Wavelength(index) => index,
            ImageLight::All => self.model.primary,
        }
    }

    /// That wavelength in um.
    fn light_um(&self) -> f64 {
        self.model.channels[self.wavelength()].um
    }

    /// The wavelengths of an image that carry light.
    fn colors(&self) -> Vec<usize> {
        let is_lit = |index: &usize| self.model.channels[*index].weight > 0.0;
        match self.image_light {
            ImageLight::Wavelength(index) => vec![index],
            ImageLight::All => (0..self.model.channels.len()).filter(is_lit).collect(),
        }
    }

    fn primary_um(&self) -> f64 {
        self.model.channels[self.model.primary].um
    }

    /// The rounding error in `f64` of a length from one ray, in mm.
    fn rounding(&self) -> f64 {
        let system = &self.model.channels[self.model.primary].system;
        16.0 * f64::EPSILON * system.total_track()
    }

    /// The estimate of a length from one ray.
    fn single_ray_estimate(&self, value: f64, milliseconds: f64) -> Estimate {
        let milliseconds = Some(milliseconds);
        Estimate { milliseconds, ..Estimate::new(value, self.rounding(), 1) }
    }

    /// The report of all fields; an error if no field has light.
    fn report<T: TextLines + Serialize>(
        &self,
        fields: Vec<AtField<T>>,
    ) -> Result<AnalysisReport<T>, CliError> {
        if let Some(reason) = common_reason(&fields) {
            return Err(self.refuse(reason));
        }
        let first = &self.model.first_order;
        let um = self.light_um();
        let colors = self.colors().into_iter().map(|index| self.model.channels[index].um);
        let light_um = if self.what.has_light() { colors.collect() } else { Vec::new() };
        Ok(AnalysisReport {
            analysis: self.what,
            zoom: self.zoom,
            wavelength_um: um,
            has_more_light: self.what.sums_wavelengths()
                && light_um.len() < self.opened.lens.wavelengths.len(),
            light_um,
            tolerance: self.accuracy.tolerance,
            field_kind: self.opened.lens.fields_at(self.zoom).kind,
            airy_radius: first.working_f_number.map(|f| 1.22 * um * 1e-3 * f),
            fields,
            effects: self.what.effect_report(self.plan.clone()),
        })
    }

    /// The error that no field has a result.
    fn refuse(&self, reason: AnalysisError) -> CliError {
        if reason.is_loss_of_light() {
            return self.no_light(reason);
        }
        CliError::Input(format!("{}: {reason}", self.opened.file))
    }

    /// The error that there is no light, with the surface where most of it is lost.
    fn no_light(&self, reason: AnalysisError) -> CliError {
        let mut ends: BTreeMap<Fate, usize> = BTreeMap::new();
        let mut fates = Fates::default();
        let color = &self.model.channels[self.model.primary];
        for field in &self.fields {
            let Ok(launch) = self.model.launch(field.traced, self.model.primary) else { continue };
            let grid = crate::pupil::pattern_points(crate::pupil::PupilPattern::Square(16));
            for ray in grid.into_iter().filter_map(|p| launch.ray(p)) {
                let fate = color.tracer.trace(ray).fate;
                *ends.entry(fate).or_default() += 1;
                fates.count(fate);
            }
        }
        let most = ends.into_iter().max_by_key(|(_, count)| *count);
        let place = most.map_or("no ray can be launched".to_owned(), |(fate, count)| {
            let surface = SurfaceNumber::new(fate.surface().unwrap_or(0));
            let (name, total) = (fate.name(), fates.total());
            format!("{count} of {total} rays end {name} at surface {surface}")
        });
        if self.blamed != self.opened.file {
            return CliError::Input(format!("{}: {reason}: {place}", self.blamed));
        }
        let file = &self.opened.file;
        CliError::Input(format!("{file}: {reason}: {place}; expected a lens that forms an image"))
    }
}

fn common_reason<T>(fields: &[AtField<T>]) -> Option<AnalysisError> {
    let reason = |field: &AtField<T>| matches!(field.outcome, FieldOutcome::Dark { .. });
    match fields.first().map(|field| &field.outcome) {
        Some(FieldOutcome::Dark { dark }) if fields.iter().all(reason) => Some(*dark),
        _ => None,
    }
}

/// The printed result.
#[derive(Serialize)]
struct AnalysisReport<T> {
    analysis: AnalysisKind,
    zoom: usize,
    wavelength_um: f64,
    /// The wavelengths of an image or of a wavefront.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    light_um: Vec<f64>,
    /// True if the result could be that of more wavelengths.
    #[serde(skip)]
    has_more_light: bool,
    tolerance: f64,
    field_kind: FieldKind,
    airy_radius: Option<f64>,
    fields: Vec<AtField<T>>,
    #[serde(flatten)]
    effects: EffectReport,
}

/// The result at a field.
#[derive(Serialize)]
struct AtField<T> {
    x: f64,
    y: f64,
    #[serde(flatten)]
    outcome: FieldOutcome<T>,
}

/// A result, or the reason why there is none.
#[derive(Serialize)]
#[serde(untagged)]
enum FieldOutcome<T> {
    Transmitted(T),
    Dark {
        #[serde(serialize_with = "collect_text")]
        dark: AnalysisError,
    },
}

fn collect_text<S: Serializer>(text: impl Display, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&text)
}

impl<T> AtField<T> {
    fn new(field: &SelectedField, result: Result<T, AnalysisError>) -> Self {
        let outcome = match result {
            Ok(lit) => FieldOutcome::Transmitted(lit),
            Err(dark) => FieldOutcome::Dark { dark },
        };
        Self { x: field.given.x, y: field.given.y, outcome }
    }
}

/// A result as lines of text.
trait TextLines {
    /// The heading.
    const TITLE: &'static str;
    /// The lines of a field.
    fn lines(&self) -> Vec<String>;
    /// The curves of a field, as charts; none for a result that is drawn over the field.
    fn charts(&self) -> Vec<CurveChart> {
        Vec::new()
    }
    /// The unit, as it follows a number, of the errors of a result that is drawn for each field: by the key of a
    /// number, or with an empty key of all numbers together. Empty for shares.
    fn error_unit(_key: &str) -> &'static str {
        " mm"
    }
}

impl<T: TextLines> Display for AnalysisReport<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = match self.field_kind {
            FieldKind::Angle => "degrees",
            FieldKind::ObjectHeight => "mm at the object",
            FieldKind::ImageHeight => "mm at the image",
        };
        writeln!(f, "{}", T::TITLE)?;
        if let Some(light) = light::light_text(&self.light_um, self.has_more_light) {
            writeln!(f, "{light}")?;
        }
        for field in &self.fields {
            let AtField { x, y, outcome } = field;
            let across = if *x == 0.0 { String::new() } else { format!("x {}, ", ShortNumber(*x)) };
            writeln!(f, "\nfield {across}y {} {unit}", ShortNumber(*y))?;
            match outcome {
                FieldOutcome::Transmitted(lit) => {
                    lit.lines().iter().try_for_each(|line| writeln!(f, "  {line}"))?;
                }
                FieldOutcome::Dark { dark } => writeln!(f, "  {dark}")?,
            }
        }
        write!(f, "\n{}", self.effects)
    }
}

/// A line with a number, its error, rays and milliseconds.
fn estimate_text(name: &str, estimate: &Estimate) -> String {
    let Estimate { value, error, rays, milliseconds } = *estimate;
    let ms = milliseconds.map(|ms| format!(", {ms:.3} ms")).unwrap_or_default();
    let (value, rays) = (ShortNumber(without_rounding(value, error)), counted(rays, "ray"));
    format!("{name:<22} {value:>13} ± {error:.1e}   {rays}{ms}")
}

/// The cause of errors above the tolerance, as it follows the cost of numbers; empty if it was reached.
fn not_reached_text(limit: Option<ContrastLimit>) -> String {
    limit.map_or_else(String::new, |limit| format!(", tolerance not reached: {limit}"))
}

/// The wavelengths that a sum over all of them leaves out, since they have no light.
fn dark_text(dark_share: f64) -> Option<String> {
    (dark_share > 0.0).then(|| {
        format!("{:.1} % of the weight is of wavelengths without light", 100.0 * dark_share)
    })
}

/// Computes a result and passes it with its milliseconds to `note`.
fn with_time<T>(work: impl FnOnce() -> T, note: impl FnOnce(&mut T, f64)) -> T {
    let (mut result, milliseconds) = time_ms(work);
    note(&mut result, milliseconds);
    result
}
