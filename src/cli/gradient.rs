//! The derivative of an integral over the pupil by every number of a lens.

use super::failure::Failure;
use super::input::{LensFile, Opened, Tolerance};
use super::output::{Number, Output, Table};
use crate::lens::{Fields, GRADE_TERMS, Law, Lens, Medium, RADIAL_TERMS, at_zoom};
use crate::measure::timed;
use crate::pupil::{
    Accuracy, Bench, Cost, Derivative, Estimator, NoDerivative, Region, differentiate,
    limited_by_stop, plan,
};
use crate::trace::{Gradient as Slopes, SurfaceGradient};
use clap::ValueEnum;
use serde::Serialize;
use std::fmt::{self, Display};

/// An integral over the pupil and its derivative by every number of the lens
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/gradient.txt"))]
pub(super) struct Gradient {
    #[command(flatten)]
    lens: LensFile,

    /// What is integrated
    #[arg(long, value_enum, default_value_t = TermName::Spot)]
    term: TermName,

    /// How the motion of the pupil's edge is counted
    #[arg(long, value_enum, default_value_t = Method::Auto)]
    method: Method,

    /// Only this field, in the unit of the lens's fields; the sum over all of them where it is absent
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    field: Option<f64>,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,

    /// The error allowed of the derivatives, relative to the largest of their kind: `0.1%` or `1e-3`
    #[arg(long, default_value = "1e-6", value_name = "TOLERANCE")]
    error: Tolerance,

    /// No more rays than this for one field and wavelength
    #[arg(long, default_value_t = 2_000_000, value_name = "N")]
    rays: usize,
}

/// The integrals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum TermName {
    /// The square of the distance from the centroid of the spot
    Spot,
    /// Minus one: the light that gets through
    Throughput,
}

/// The ways to differentiate an integral whose region moves with the lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Method {
    /// What the form of the pupil and the tolerance call for
    Auto,
    /// The rays that get through are kept: exact while nothing is clipped, biased elsewhere
    Biased,
    /// The motion of the edge is integrated along it
    Boundary,
    /// The motion of the edge is spread over the pupil
    Warp,
    /// Central differences with the edge found anew
    Difference,
}

impl Method {
    fn estimator(self) -> Option<Estimator> {
        match self {
            Self::Auto => None,
            Self::Biased => Some(Estimator::Biased),
            Self::Boundary => Some(Estimator::Boundary),
            Self::Warp => Some(Estimator::Warp),
            Self::Difference => Some(Estimator::Difference),
        }
    }
}

impl Gradient {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        let opened = self.lens.open()?;
        opened.check_zoom(self.zoom)?;
        let refuse = |source| Failure::Bench { file: opened.file.clone(), source };
        let lens = limited_by_stop(&self.one_position(&opened)?).map_err(refuse)?;
        let bench = Bench::of(&lens, 0).map_err(refuse)?;
        let (found, ms) = timed(|| self.differentiate(&bench));
        let found = found.map_err(|cause| Failure::Failed(format!("{}: {cause}", opened.file)))?;
        output.print(&Report::new(self, &lens, &found, ms))
    }

    /// The lens at the zoom position and field that are asked for.
    fn one_position(&self, opened: &Opened) -> Result<Lens, Failure> {
        let mut lens = at_zoom(&opened.lens, self.zoom);
        if let Some(y) = self.field {
            let values = vec![opened.field(y, self.zoom)?];
            lens.fields = Fields { kind: lens.fields.kind, values };
        }
        Ok(lens)
    }

    /// The sum over the fields, each with the mean over the wavelengths by weight.
    fn differentiate(&self, bench: &Bench) -> Result<Found, NoDerivative> {
        let accuracy = Accuracy { tolerance: self.error.0, most_rays: self.rays };
        let mut found = Found::new(bench);
        for field in &bench.fields {
            let regions: Result<Vec<_>, _> = (0..bench.colors.len())
                .map(|wavelength| bench.launch(*field, wavelength).map(Region::new))
                .collect();
            let regions = regions?;
            let cost = self.cost(bench, &regions);
            for (region, color) in regions.iter().zip(&bench.colors) {
                let (estimator, reason) = match self.method.estimator() {
                    Some(asked) => (asked, "asked for".to_owned()),
                    None => plan(region, accuracy)?,
                };
                let derivative = differentiate(region, &cost, estimator, accuracy)?;
                let light = region.lit(VALUE).moments;
                let coarse = cost.over(&region.lit(VALUE - 1).moments);
                let value = cost.over(&light);
                let share = field.weight * color.weight / found.weights;
                found.add(&derivative, share, (value, (value - coarse).abs()));
                found.planned = (estimator, reason);
            }
        }
        Ok(found)
    }

    /// The cost about the centroid of all wavelengths.
    fn cost(&self, bench: &Bench, regions: &[Region<'_>]) -> Cost {
        if self.term == TermName::Throughput {
            return Cost::throughput();
        }
        let (mut area, mut sum) = (0.0, [0.0; 2]);
        for (region, color) in regions.iter().zip(&bench.colors) {
            let light = region.lit(VALUE).moments;
            area += color.weight * light.area;
            sum = [0, 1].map(|i| sum[i] + color.weight * light.area * light.centroid[i]);
        }
        Cost::spread(if area > 0.0 { sum.map(|s| s / area) } else { [0.0; 2] })
    }
}

/// The order of quadrature of the value.
const VALUE: usize = 6;

/// What was found.
struct Found {
    value: f64,
    value_error: f64,
    by: Slopes<f64>,
    error: Slopes<f64>,
    rays: usize,
    weights: f64,
    planned: (Estimator, String),
}

impl Found {
    fn new(bench: &Bench) -> Self {
        let zero = || Slopes::zero(bench.colors[0].tracer.surfaces());
        let weights = bench.colors.iter().map(|color| color.weight).sum();
        let planned = (Estimator::Boundary, String::new());
        Self { value: 0.0, value_error: 0.0, by: zero(), error: zero(), rays: 0, weights, planned }
    }

    fn add(&mut self, derivative: &Derivative, share: f64, (value, error): (f64, f64)) {
        self.value += share * value;
        self.value_error += share * error;
        self.by.add(&derivative.by, share);
        self.error.add(&derivative.error, share.abs());
        self.rays += derivative.rays;
    }
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    term: TermName,
    method: &'static str,
    reason: String,
    value: f64,
    error: f64,
    rays: usize,
    ms: f64,
    d: Columns,
    d_error: Columns,
    #[serde(skip)]
    unit: &'static str,
    /// What the coefficients of the gradient behind each surface belong to.
    #[serde(skip)]
    coefficients: Vec<Coefficients>,
}

/// What each coefficient of a gradient belongs to; nothing where its law has none.
type Coefficients = [Option<String>; GRADE_TERMS];

/// One entry a surface; nothing where the surface has no such number.
#[derive(Serialize)]
struct Columns {
    curvature: Vec<f64>,
    thickness: Vec<f64>,
    semi_diameter: Vec<Option<f64>>,
    conic: Vec<Option<f64>>,
    index: Vec<f64>,
    asphere: Vec<Option<Vec<f64>>>,
    /// The ten coefficients of a gradient; only where the lens has one.
    #[serde(skip_serializing_if = "are_none")]
    gradient: Vec<Option<Vec<f64>>>,
}

fn are_none(column: &[Option<Vec<f64>>]) -> bool {
    column.iter().all(Option::is_none)
}

impl Columns {
    fn new(lens: &Lens, slopes: &Slopes<f64>) -> Self {
        let rows = || lens.surfaces.iter().zip(&slopes.surfaces);
        let column = |of: fn(&SurfaceGradient<f64>) -> f64| rows().map(|(_, s)| of(s)).collect();
        let asphere = |count: usize, terms: &[f64]| (count > 0).then(|| terms[..count].to_vec());
        let gradient = |medium: &Medium, s: &SurfaceGradient<f64>| {
            matches!(medium, Medium::Gradient(_)).then(|| s.grade.to_vec())
        };
        Self {
            curvature: column(|s| s.curvature),
            thickness: column(|s| s.thickness),
            semi_diameter: rows().map(|(r, s)| r.semi_diameter.map(|_| s.semi_diameter)).collect(),
            conic: rows().map(|(r, s)| (r.conic != 0.0).then_some(s.conic)).collect(),
            index: column(|s| s.index),
            asphere: rows().map(|(r, s)| asphere(r.asphere.len(), &s.terms)).collect(),
            gradient: rows().map(|(r, s)| gradient(&r.medium, s)).collect(),
        }
    }
}

impl Report {
    fn new(asked: &Gradient, lens: &Lens, found: &Found, ms: f64) -> Self {
        let (estimator, reason) = &found.planned;
        Self {
            term: asked.term,
            method: estimator.name(),
            reason: reason.clone(),
            value: found.value,
            error: found.value_error,
            rays: found.rays,
            ms,
            d: Columns::new(lens, &found.by),
            d_error: Columns::new(lens, &found.error),
            unit: if asked.term == TermName::Spot { "mm^4" } else { "mm^2" },
            coefficients: lens.surfaces.iter().map(|row| coefficients(&row.medium)).collect(),
        }
    }
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { value, error, rays, ms, d, d_error, method, reason, unit, .. } = self;
        writeln!(f, "{} {unit} ± {error:.1e}   {rays} rays, {ms:.3} ms", Number(*value))?;
        writeln!(f, "{method}: {reason}\n")?;
        let names = ["surface", "d/d curvature", "d/d thickness", "d/d semi-diameter", "d/d index"];
        let mut table = Table::new(&names);
        for i in 0..d.curvature.len() {
            let cell = |value: f64, error: f64| format!("{value:.6e} ± {error:.0e}");
            let rim = d.semi_diameter[i].zip(d_error.semi_diameter[i]);
            let cells = [
                cell(d.curvature[i], d_error.curvature[i]),
                cell(d.thickness[i], d_error.thickness[i]),
                rim.map_or("-".to_owned(), |(value, error)| cell(value, error)),
                cell(d.index[i], d_error.index[i]),
            ];
            table.row(std::iter::once(i.to_string()).chain(cells));
        }
        write!(f, "{table}")?;
        self.write_gradients(f)
    }
}

fn coefficients(medium: &Medium) -> Coefficients {
    let Medium::Gradient(gradient) = medium else { return Coefficients::default() };
    std::array::from_fn(|k| {
        gradient.term(k)?;
        Some(match k.checked_sub(RADIAL_TERMS) {
            None if gradient.law == Law::Sech => "g r".to_owned(),
            None => format!("r^{}", 2 * k + 2),
            Some(j) => format!("z^{}", j + 1),
        })
    })
}

impl Report {
    /// The coefficients of every gradient-index medium.
    fn write_gradients(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (by, error)) in self.d.gradient.iter().zip(&self.d_error.gradient).enumerate() {
            let (Some(by), Some(error)) = (by, error) else { continue };
            let title = format!("gradient after surface {i}, coefficient of");
            let mut table = Table::new(&[&title, "derivative"]);
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
