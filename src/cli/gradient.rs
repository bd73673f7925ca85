//! `gradient`: an integral over the pupil and its derivatives with respect to all numbers of a lens.

use super::effects::{AllowedSetting, EffectArgs, EffectReport, EffectRule};
use super::error::CliError;
use super::input::{LensFile, LoadedLens, Tolerance};
use super::output::{Output, ShortNumber, TextTable, counted};
use crate::effects::{self, Effect, EffectOverride, EffectPlan, TracePurpose};
use crate::lens::{
    APERTURE_NUMBERS, Fields, Lens, Medium, MediumPlace, PROFILE_TERMS, ProfileLaw, RADIAL_TERMS,
    Row, SurfaceNumber, at_zoom,
};
use crate::measure::{Integral, time_ms};
use crate::pupil::{
    Accuracy, DerivativeError, DerivativeEstimator, PupilDerivative, QuadraticIntegrand, RayModel,
    Region, choose_estimator, differentiate,
};
use crate::trace::{SurfaceGradient, SurfaceParameter, SystemGradient as Slopes};
use clap::ValueEnum;
use serde::Serialize;
use std::fmt::{self, Display};

/// An integral over the pupil and its derivatives with respect to all numbers of the lens
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/gradient.txt"))]
pub(super) struct GradientArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The integrand
    #[arg(long, value_enum, default_value_t = Integral::Spot)]
    term: Integral,

    /// The treatment of the motion of the pupil's edge
    #[arg(long, value_enum, default_value_t = Method::Auto)]
    method: Method,

    /// Only this field, in the unit of the lens's fields; absent: the sum over all fields
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    field: Option<f64>,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,

    /// Tolerance of the derivatives, relative to the largest of their kind: `0.1%` or `1e-3`
    #[arg(long, default_value = "1e-6", value_name = "TOLERANCE")]
    error: Tolerance,

    /// Number of rays for one field and wavelength beyond which the accuracy is not raised
    #[arg(long, default_value_t = 2_000_000, value_name = "N")]
    rays: usize,

    #[command(flatten)]
    effects: EffectArgs,
}

/// The rule for the pupil whose derivatives are asked for.
const PUPIL_OF_THE_STOP: EffectRule = EffectRule {
    effect: Effect::Aiming,
    allowed: AllowedSetting::AlwaysOn,
    reason: "the pupil has a derivative by the semi-diameter of the stop only where the real stop \
             limits it",
};

/// The estimators of derivatives of an integral whose region moves with the lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    /// Chosen for the shape of the pupil and the tolerance
    Auto,
    /// The transmitted rays are held fixed: exact while nothing is clipped, else biased
    Biased,
    /// The motion of the edge is integrated along it
    Boundary,
    /// The motion of the edge is spread over the pupil
    Warp,
    /// Central differences with the edge located anew
    Difference,
}

impl Method {
    fn estimator(self) -> Option<DerivativeEstimator> {
        match self {
            Self::Auto => None,
            Self::Biased => Some(DerivativeEstimator::Biased),
            Self::Boundary => Some(DerivativeEstimator::Boundary),
            Self::Warp => Some(DerivativeEstimator::Warp),
            Self::Difference => Some(DerivativeEstimator::Difference),
        }
    }
}

impl GradientArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let choices = self.effects.choices(&[PUPIL_OF_THE_STOP])?;
        let opened = self.lens.open()?;
        opened.check_zoom(self.zoom)?;
        let blamed = opened.blame_field(self.field, self.zoom);
        let refuse = |source| CliError::RayModel { file: opened.file.clone(), source };
        let mut lens = self.selected_lens(&opened)?;
        if let Some(why) = lens.stop().and_then(|stop| lens.surfaces[stop].stop_fault()) {
            return Err(CliError::Input(format!("{}: {why}", opened.file)));
        }
        let measured = effects::measure_effects(&lens, 0).map_err(refuse)?;
        let plan = choices.plan(&measured, TracePurpose::Exact);
        let model = effects::build_ray_model(&lens, 0, &plan).map_err(refuse)?;
        remove_omitted(&mut lens, &plan);
        lens.surfaces[model.stop()].semi_diameter = Some(model.stop_radius());
        let (found, ms) = time_ms(|| self.differentiate(&model));
        let found = found.map_err(|cause| match cause {
            DerivativeError::Dark(..) | DerivativeError::Launch(_) => {
                CliError::Input(format!("{blamed}: {cause}"))
            }
            DerivativeError::Unbounded => CliError::Input(format!("{}: {cause}", opened.file)),
            _ => CliError::Failed(format!("{}: {cause}", opened.file)),
        })?;
        if found.least_rays > self.rays {
            return Err(CliError::Input(format!(
                "--rays: found {}; expected at least {}, without which no error is known",
                self.rays, found.least_rays
            )));
        }
        let effects = EffectReport::uncounted(plan.decisions);
        output.print(&GradientReport::new(self, &lens, &found, ms, effects))
    }

    /// The lens at the selected zoom position and field.
    fn selected_lens(&self, opened: &LoadedLens) -> Result<Lens, CliError> {
        let mut lens = at_zoom(&opened.lens, self.zoom);
        if let Some(y) = self.field {
            let values = vec![opened.field_at(y, self.zoom)?];
            lens.fields = Fields { kind: lens.fields.kind, values };
        }
        Ok(lens)
    }

    /// The sum over the fields, each with the mean over the wavelengths by weight.
    fn differentiate(&self, model: &RayModel) -> Result<IntegralDerivative, DerivativeError> {
        let accuracy = Accuracy { tolerance: self.error.0, max_rays: self.rays };
        let mut found = IntegralDerivative::new(model);
        for field in &model.fields {
            let regions: Result<Vec<_>, _> = (0..model.channels.len())
                .map(|wavelength| model.launch(*field, wavelength).map(Region::new))
                .collect();
            let regions = regions?;
            let cost = self.cost(model, &regions);
            for (region, color) in regions.iter().zip(&model.channels) {
                let (estimator, reason) = match self.method.estimator() {
                    Some(chosen) => (chosen, "chosen by --method".to_owned()),
                    None => choose_estimator(region, accuracy)?,
                };
                let derivative = differentiate(region, &cost, estimator, accuracy)?;
                found.least_rays = found.least_rays.max(least_rays(&derivative, region));
                let light = region.trace_pupil(VALUE_ORDER).moments;
                let coarse = cost.integrate(&region.trace_pupil(VALUE_ORDER - 1).moments);
                let value = cost.integrate(&light);
                let share = field.weight * color.weight / found.weights;
                found.add(&derivative, share, (value, (value - coarse).abs()));
                found.planned = (estimator, reason);
            }
        }
        Ok(found)
    }

    /// The integrand about the centroid of all wavelengths.
    fn cost(&self, model: &RayModel, regions: &[Region<'_>]) -> QuadraticIntegrand {
        if self.term == Integral::Throughput {
            return QuadraticIntegrand::throughput();
        }
        let (mut area, mut sum) = (0.0, [0.0; 2]);
        for (region, color) in regions.iter().zip(&model.channels) {
            let light = region.trace_pupil(VALUE_ORDER).moments;
            area += color.weight * light.area;
            sum = [0, 1].map(|i| sum[i] + color.weight * light.area * light.centroid[i]);
        }
        QuadraticIntegrand::spread(if area > 0.0 { sum.map(|s| s / area) } else { [0.0; 2] })
    }
}

/// The smallest limit of rays with which a derivative without an error would have one, which takes
/// a second order of about twice the rays; 0 if it has one.
fn least_rays(derivative: &PupilDerivative, region: &Region<'_>) -> usize {
    if derivative.error.largest(SurfaceParameter::Curvature).is_finite() {
        return 0;
    }
    3 * derivative.rays - 2 * region.rays
}

/// Removes the numbers from a lens that have no derivative because their effect is left out.
/// A semi-diameter that no ray reaches has one, which is 0.
fn remove_omitted(lens: &mut Lens, plan: &EffectPlan) {
    let clipping = plan.decision(Effect::Clipping).map(|decision| decision.choice);
    for (i, row) in lens.surfaces.iter_mut().enumerate() {
        if plan.as_conic.contains(&i) {
            row.asphere.clear();
        }
        if plan.homogeneous.contains(&i)
            && let Medium::Grin(gradient) = &row.medium
        {
            row.medium = gradient.base.clone();
        }
        if plan.unclipped.contains(&i) && clipping == Some(EffectOverride::Off) {
            row.semi_diameter = None;
        }
    }
}

/// The quadrature order of the value.
const VALUE_ORDER: usize = 6;

/// An integral with its derivatives.
struct IntegralDerivative {
    value: f64,
    value_error: f64,
    by: Slopes<f64>,
    error: Slopes<f64>,
    rays: usize,
    /// The smallest limit of rays that gives every derivative an error; 0 if all have one.
    least_rays: usize,
    weights: f64,
    /// True if every derivative of every field and wavelength is within the tolerance.
    reached: bool,
    planned: (DerivativeEstimator, String),
}

impl IntegralDerivative {
    fn new(model: &RayModel) -> Self {
        let zero = || Slopes::zero(model.channels[0].tracer.surfaces());
        let weights = model.channels.iter().map(|color| color.weight).sum();
        let planned = (DerivativeEstimator::Boundary, String::new());
        Self {
            value: 0.0,
            value_error: 0.0,
            by: zero(),
            error: zero(),
            rays: 0,
            least_rays: 0,
            weights,
            reached: true,
            planned,
        }
    }

    fn add(&mut self, derivative: &PupilDerivative, share: f64, (value, error): (f64, f64)) {
        self.value += share * value;
        self.value_error += share * error;
        self.by.add(&derivative.gradient, share);
        self.error.add(&derivative.error, share.abs());
        self.rays += derivative.rays;
        self.reached &= derivative.reached;
    }
}

/// The printed result.
#[derive(Serialize)]
struct GradientReport {
    term: Integral,
    method: &'static str,
    reason: String,
    value: f64,
    error: f64,
    reached: bool,
    rays: usize,
    ms: f64,
    d: DerivativeColumns,
    d_error: DerivativeColumns,
    #[serde(flatten)]
    effects: EffectReport,
    #[serde(skip)]
    unit: &'static str,
    /// The labels of the gradient-index coefficients behind each surface.
    #[serde(skip)]
    coefficients: Vec<CoefficientLabels>,
}

/// The label of each coefficient of a gradient-index medium; `None` if its law does not have it.
type CoefficientLabels = [Option<String>; PROFILE_TERMS];

/// Derivatives, one entry a surface; `None` if the surface has no such number.
#[derive(Serialize)]
struct DerivativeColumns {
    curvature: Vec<f64>,
    thickness: Vec<f64>,
    semi_diameter: Vec<Option<f64>>,
    conic: Vec<Option<f64>>,
    index: Vec<f64>,
    asphere: Vec<Option<Vec<f64>>>,
    /// The ten coefficients of a gradient-index medium; only if the lens has one.
    #[serde(skip_serializing_if = "are_none")]
    gradient: Vec<Option<Vec<f64>>>,
    /// The numbers of a freeform; only if the lens has one.
    #[serde(skip_serializing_if = "are_none")]
    freeform: Vec<Option<Vec<f64>>>,
    /// By the numbers of apertures of other forms, five for each: two sizes, the centre and the angle in
    /// degrees; only if the lens has one.
    #[serde(skip_serializing_if = "are_none")]
    apertures: Vec<Option<Vec<f64>>>,
}

fn are_none(column: &[Option<Vec<f64>>]) -> bool {
    column.iter().all(Option::is_none)
}

impl DerivativeColumns {
    fn new(lens: &Lens, slopes: &Slopes<f64>) -> Self {
        let rows = || lens.surfaces.iter().zip(&slopes.surfaces);
        let column = |of: fn(&SurfaceGradient<f64>) -> f64| rows().map(|(_, s)| of(s)).collect();
        let asphere = |count: usize, terms: &[f64]| (count > 0).then(|| terms[..count].to_vec());
        let gradient = |medium: &Medium, s: &SurfaceGradient<f64>| {
            matches!(medium, Medium::Grin(_)).then(|| s.grin_terms.to_vec())
        };
        let freeform = |row: &Row, s: &SurfaceGradient<f64>| {
            let count = row.freeform.as_ref()?.numbers.len();
            Some((0..count).map(|k| s.by(SurfaceParameter::Freeform(k))).collect())
        };
        let apertures = |row: &Row, s: &SurfaceGradient<f64>| {
            let count = APERTURE_NUMBERS * row.apertures.len();
            let all = (0..count).map(|k| s.by(SurfaceParameter::Aperture(k)));
            (count > 0).then(|| all.collect())
        };
        Self {
            curvature: column(|s| s.curvature),
            thickness: column(|s| s.thickness),
            semi_diameter: rows().map(|(r, s)| r.semi_diameter.map(|_| s.semi_diameter)).collect(),
            conic: rows().map(|(r, s)| (r.conic != 0.0).then_some(s.conic)).collect(),
            index: column(|s| s.index),
            asphere: rows().map(|(r, s)| asphere(r.asphere.len(), &s.terms)).collect(),
            gradient: rows().map(|(r, s)| gradient(&r.medium, s)).collect(),
            freeform: rows().map(|(r, s)| freeform(r, s)).collect(),
            apertures: rows().map(|(r, s)| apertures(r, s)).collect(),
        }
    }
}

impl GradientReport {
    fn new(
        args: &GradientArgs,
        lens: &Lens,
        found: &IntegralDerivative,
        ms: f64,
        effects: EffectReport,
    ) -> Self {
        let (estimator, reason) = &found.planned;
        Self {
            term: args.term,
            method: estimator.name(),
            reason: reason.clone(),
            value: found.value,
            error: found.value_error,
            reached: found.reached,
            rays: found.rays,
            ms,
            d: DerivativeColumns::new(lens, &found.by),
            d_error: DerivativeColumns::new(lens, &found.error),
            effects,
            unit: if args.term == Integral::Spot { "mm^4" } else { "mm^2" },
            coefficients: lens.surfaces.iter().map(|row| coefficient_labels(&row.medium)).collect(),
        }
    }
}

impl Display for GradientReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { value, error, rays, ms, d, d_error, method, reason, unit, .. } = self;
        let rays = counted(*rays, "ray");
        writeln!(f, "{} {unit} ± {error:.1e}   {rays}, {ms:.3} ms", ShortNumber(*value))?;
        writeln!(f, "{method}: {reason}")?;
        if !self.reached {
            let why = match *method {
                "difference" => "the steps of differences have a fixed size",
                "warp" => "--rays allows no more samples",
                _ => "the orders of quadrature, or --rays, do not go higher",
            };
            writeln!(f, "the tolerance was not reached by every derivative: {why}")?;
        }
        writeln!(f)?;
        let names = ["surface", "d/d curvature", "d/d thickness", "d/d semi-diameter", "d/d index"];
        let mut table = TextTable::new(&names);
        for i in 0..d.curvature.len() {
            let cell = |value: f64, error: f64| format!("{value:.6e} ± {error:.0e}");
            let rim = d.semi_diameter[i].zip(d_error.semi_diameter[i]);
            let cells = [
                cell(d.curvature[i], d_error.curvature[i]),
                cell(d.thickness[i], d_error.thickness[i]),
                rim.map_or("-".to_owned(), |(value, error)| cell(value, error)),
                cell(d.index[i], d_error.index[i]),
            ];
            table.row(std::iter::once(SurfaceNumber::new(i).to_string()).chain(cells));
        }
        write!(f, "{table}")?;
        self.write_gradients(f)?;
        write!(f, "\n{}", self.effects)
    }
}

fn coefficient_labels(medium: &Medium) -> CoefficientLabels {
    let Medium::Grin(gradient) = medium else { return CoefficientLabels::default() };
    std::array::from_fn(|k| {
        gradient.term(k)?;
        Some(match k.checked_sub(RADIAL_TERMS) {
            None if gradient.law == ProfileLaw::Sech => "g r".to_owned(),
            None => format!("r^{}", 2 * k + 2),
            Some(j) => format!("z^{}", j + 1),
        })
    })
}

impl GradientReport {
    /// Writes a table of the coefficients of each gradient-index medium.
    fn write_gradients(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (by, error)) in self.d.gradient.iter().zip(&self.d_error.gradient).enumerate() {
            let (Some(by), Some(error)) = (by, error) else { continue };
            let title = format!("gradient index {}, coefficient of", MediumPlace::behind(i));
            let mut table = TextTable::new(&[&title, "derivative"]);
            for ((by, error), power) in by.iter().zip(error).zip(&self.coefficients[i]) {
                if let Some(power) = power {
                    table.row([power.clone(), format!("{by:.6e} ± {error:.0e}")]);
                }
            }
            write!(f, "\n{table}")?;
        }
        Ok(())
    }
}
