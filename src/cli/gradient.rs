//! The derivative of a merit term by every number of a lens.

use super::failure::Failure;
use super::input::{LensFile, Opened, Tolerance};
use super::output::{Number, Output, Table};
use crate::lens::{Fields, Lens, Parameter, Quantity, at_zoom, free};
use crate::measure::timed;
use crate::merit::{Detail, Goal, Merit, MeritError, PupilEdge, Term, Weighted};
use clap::ValueEnum;
use serde::Serialize;
use std::fmt::{self, Display};

/// A merit term and its derivative by every number of the lens
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/gradient.txt"))]
pub(super) struct Gradient {
    #[command(flatten)]
    lens: LensFile,

    /// What is differentiated
    #[arg(long, value_enum, default_value_t = TermName::Spot)]
    term: TermName,

    /// How the edge of the pupil is treated
    #[arg(long, value_enum, default_value_t = Method::Biased)]
    method: Method,

    /// Only this field, in the unit of the lens's fields; all fields of the lens where it is absent
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    field: Option<f64>,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,

    /// The error allowed of the radius of a spot: `0.1%` or `1e-3`
    #[arg(long, default_value = "1e-6", value_name = "TOLERANCE")]
    error: Tolerance,
}

/// The terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum TermName {
    /// The mean square radius of the spots
    Spot,
    /// The mean square distance of the chief rays from their paraxial image points
    Distortion,
    /// The light that gets through
    Throughput,
}

/// The ways to differentiate an integral whose region moves with the lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum Method {
    /// The rays that get through are kept: exact while nothing is clipped, biased elsewhere
    Biased,
    /// The motion of the edge is integrated along it
    Boundary,
    /// The motion of the edge is spread over the pupil
    Warp,
    /// Central differences
    Difference,
}

fn unavailable(what: &str, name: &impl ValueEnum, available: &str) -> Failure {
    let value = name.to_possible_value();
    let name = value.as_ref().map_or("?", |value| value.get_name());
    Failure::Input(format!("the {what} `{name}` is not available yet; expected {available}"))
}

impl Gradient {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        if self.method != Method::Biased {
            return Err(unavailable("method", &self.method, "`biased`"));
        }
        let term = match self.term {
            TermName::Spot => Term::Spot,
            TermName::Distortion => Term::Distortion,
            TermName::Throughput => {
                return Err(unavailable("term", &self.term, "`spot` or `distortion`"));
            }
        };
        let opened = self.lens.open()?;
        opened.check_zoom(self.zoom)?;
        let lens = self.one_position(&opened)?;
        let refuse = |source| Failure::Merit { file: opened.file.clone(), source };
        let ((derivative, parts), ms) = {
            let (result, ms) = timed(|| differentiate(&lens, term, self.error.0));
            (result.map_err(refuse)?, ms)
        };
        output.print(&Report::new(self, &lens, &derivative, &parts, ms))
    }

    /// The lens at the zoom position and field that are asked for, with every number free.
    fn one_position(&self, opened: &Opened) -> Result<Lens, Failure> {
        let mut lens = at_zoom(&opened.lens, self.zoom);
        if let Some(y) = self.field {
            let values = vec![opened.field(y, self.zoom)?];
            lens.fields = Fields { kind: lens.fields.kind, values };
        }
        lens.variables.clear();
        for parameter in every_number(&lens) {
            free(&mut lens, parameter);
        }
        Ok(lens)
    }
}

/// Every number that a ray depends on.
fn every_number(lens: &Lens) -> Vec<Parameter> {
    let of = |(i, row): (usize, &crate::lens::Row)| {
        let quantities =
            [Quantity::Curvature, Quantity::Thickness, Quantity::Conic, Quantity::Index];
        let terms = (0..row.asphere.len()).map(Quantity::Asphere);
        let all: Vec<Quantity> = quantities.into_iter().chain(terms).collect();
        all.into_iter().map(move |quantity| Parameter::new(i, quantity))
    };
    lens.surfaces.iter().enumerate().flat_map(of).collect()
}

/// A value with what it rests on, and its derivatives in the order of the variables.
struct Derivative {
    value: f64,
    error: f64,
    rays: usize,
}

fn differentiate(
    lens: &Lens,
    term: Term,
    tolerance: f64,
) -> Result<(Derivative, Vec<f64>), MeritError> {
    let goal = Goal {
        terms: vec![Weighted { term, weight: 1.0 }],
        pupil: PupilEdge::Kept,
        zoom_ratios: Vec::new(),
    };
    let merit = Merit::new(lens, &goal, tolerance)?;
    let values = merit.values(lens);
    let sum = merit.sum(&values, Detail::Gradient)?;
    let trusted = merit.terms(&values)?;
    let (error, rays) = trusted.first().map_or((0.0, 0), |term| (term.error, term.rays));
    let slopes = sum.gradient.iter().copied().collect();
    Ok((Derivative { value: sum.value, error, rays }, slopes))
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    term: TermName,
    method: Method,
    value: f64,
    error: f64,
    rays: usize,
    ms: f64,
    d: Slopes,
}

/// One entry a surface; nothing where the surface has no such number, or it follows another.
#[derive(Serialize)]
struct Slopes {
    curvature: Vec<Option<f64>>,
    thickness: Vec<Option<f64>>,
    semi_diameter: Vec<Option<f64>>,
    conic: Vec<Option<f64>>,
    index: Vec<Option<f64>>,
    asphere: Vec<Option<Vec<Option<f64>>>>,
}

impl Report {
    fn new(asked: &Gradient, lens: &Lens, found: &Derivative, slopes: &[f64], ms: f64) -> Self {
        let Derivative { value, error, rays } = *found;
        let (term, method) = (asked.term, asked.method);
        Self { term, method, value, error, rays, ms, d: Slopes::new(lens, slopes) }
    }
}

impl Slopes {
    fn new(lens: &Lens, slopes: &[f64]) -> Self {
        let by = |parameter: Parameter| {
            let place = lens.variables.iter().position(|v| v.parameter == parameter)?;
            Some(slopes[place])
        };
        let rows = || 0..lens.surfaces.len();
        let column = |quantity: Quantity| rows().map(|i| by(Parameter::new(i, quantity))).collect();
        let terms = |i: usize| {
            let count = lens.surfaces[i].asphere.len();
            let term = |term: usize| by(Parameter::new(i, Quantity::Asphere(term)));
            (count > 0).then(|| (0..count).map(term).collect())
        };
        Self {
            curvature: column(Quantity::Curvature),
            thickness: column(Quantity::Thickness),
            // The rays are kept, so that a rim changes nothing.
            semi_diameter: lens.surfaces.iter().map(|r| r.semi_diameter.map(|_| 0.0)).collect(),
            conic: column(Quantity::Conic),
            index: column(Quantity::Index),
            asphere: rows().map(terms).collect(),
        }
    }
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { value, error, rays, ms, d, .. } = self;
        writeln!(f, "{} mm^2 ± {error:.1e}   {rays} rays, {ms:.3} ms\n", Number(*value))?;
        let mut table =
            Table::new(&["surface", "d/d curvature", "d/d thickness", "d/d conic", "d/d index"]);
        for i in 0..d.curvature.len() {
            let cell = |v: Option<f64>| v.map_or("-".to_owned(), |v| format!("{v:.6e}"));
            let cells = [d.curvature[i], d.thickness[i], d.conic[i], d.index[i]].map(cell);
            table.row(std::iter::once(i.to_string()).chain(cells));
        }
        write!(f, "{table}")
    }
}
