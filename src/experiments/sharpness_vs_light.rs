//! Shared parts of figures 3.6 to 3.10: lenses optimized for sharpness and light together (3.26),
//! and the sharpness and light of their fields.

use super::{DataTable, ExperimentError, ExperimentResult, ProgressFn, TableCell, report_progress};
use crate::analysis::{AnalysisError, Estimate, field_quality};
use crate::lens::{Aperture, FieldKind, FieldPoint, Fields, Lens};
use crate::merit::{PupilEdge, Term, WeightedTerm};
use crate::optimize::pareto::{ParetoPoint, ParetoSettings, ParetoSweep, weighted_sum_goal};
use crate::optimize::start_annealed;
use crate::pupil::{Accuracy, RayModel};

/// The accuracy of reported numbers.
const REPORTED: Accuracy = Accuracy { tolerance: 1e-6, max_rays: 100_000 };

/// The monochromatic lens at some field angles, in degrees.
pub(super) fn with_field_angles(mut lens: Lens, angles: &[f64]) -> Lens {
    lens = monochromatic(lens);
    let values = angles.iter().map(|y| FieldPoint { x: 0.0, y: *y, weight: 1.0 }).collect();
    lens.fields = Fields { kind: FieldKind::Angle, values };
    lens
}

/// The lens at its primary wavelength alone, as in the figures.
pub(super) fn monochromatic(mut lens: Lens) -> Lens {
    lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
    lens
}

/// The lens with its stop and its semi-diameters scaled: the choice of an aperture for a search
/// that cannot ask for light.
pub(super) fn with_scaled_aperture(lens: &Lens, factor: f64) -> Lens {
    let mut lens = lens.clone();
    for row in &mut lens.surfaces {
        row.semi_diameter = row.semi_diameter.map(|size| factor * size);
    }
    if let Aperture::StopSemiDiameter(radius) = &mut lens.aperture {
        *radius *= factor;
    }
    lens
}

/// A sweep over decreasing weights of the light.
#[derive(Debug, Clone)]
pub(super) struct WeightSweep {
    /// The weights β in mm², the largest first.
    pub(super) betas: Vec<f64>,
    /// The steps of Adam for each weight.
    pub(super) steps: usize,
    /// The treatment of the pupil edge in derivatives.
    pub(super) pupil: PupilEdge,
    /// The factors by which a semi-diameter may shrink and grow.
    pub(super) semi_diameter_factors: [f64; 2],
}

/// The largest weight in mm²: large enough to retain the marginal rays of a lens that is not sharp
/// yet. Light that is clipped early is not regained.
const LARGEST: f64 = 3e-2;

impl WeightSweep {
    /// A sweep over `weights` weights in some decades, evenly spaced on a logarithmic scale, with
    /// unbiased derivatives.
    pub(super) fn new(decades: f64, weights: usize, steps: usize) -> Self {
        let last = (weights - 1).max(1) as f64;
        let beta = |i: usize| LARGEST * 10f64.powf(-decades * i as f64 / last);
        let betas = (0..weights).map(beta).collect();
        Self { betas, steps, pupil: PupilEdge::Moving, semi_diameter_factors: [0.25, 1.3] }
    }

    /// The sweep down its weights and up again: a search that comes from sharper lenses ends in other
    /// designs than one that comes from brighter ones.
    pub(super) fn and_back(mut self) -> Self {
        let up: Vec<f64> = self.betas.iter().rev().skip(1).copied().collect();
        self.betas.extend(up);
        self
    }

    /// The usual optimization with biased derivatives: all weights are equivalent, so there is only
    /// one.
    pub(super) fn biased(&self) -> Self {
        let steps = 2 * self.steps;
        Self { betas: vec![0.0], steps, pupil: PupilEdge::Frozen, ..self.clone() }
    }
}

/// A named part of the progress of an experiment, from one completed fraction to another.
#[derive(Debug, Clone, Copy)]
pub(super) struct ProgressSpan<'a> {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) name: &'a str,
}

/// The relative accuracy of the spot radii of a search, and of its designs.
const SEARCH_TOLERANCE: f64 = 1e-3;
const EVALUATION_TOLERANCE: f64 = 1e-4;

/// Runs the sweep: the starting lens, limited by its stop and with all variables, and a design for
/// each weight, each search starting from the result of the one before.
pub(super) fn run_sweep(
    lens: &Lens,
    plan: &WeightSweep,
    part: ProgressSpan<'_>,
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<Vec<ParetoPoint>> {
    let settings = ParetoSettings {
        semi_diameter_factors: plan.semi_diameter_factors,
        pupil: plan.pupil,
        ..ParetoSettings::default()
    };
    let start = ParetoSweep::new(lens, &settings)?.start;
    let goal = weighted_sum_goal(&start.lens, start.light, plan.pupil)?;
    let total = (plan.betas.len() * plan.steps) as f64;
    let mut designs = vec![start];
    for (i, beta) in plan.betas.iter().enumerate() {
        let mut goal = goal.clone();
        goal.terms.push(WeightedTerm::new(Term::Throughput, *beta));
        let begin = &designs[designs.len() - 1].lens;
        let search = start_annealed(begin, &goal, SEARCH_TOLERANCE, plan.steps);
        let mut search = search?;
        for step in 0..plan.steps {
            let done = (i * plan.steps + step) as f64 / total;
            report_progress(progress, part.from + (part.to - part.from) * done, part.name)?;
            if search.step().finished {
                break;
            }
        }
        search.verify_best();
        let design = ParetoPoint::evaluate(search.best(), Some(*beta), EVALUATION_TOLERANCE);
        designs.push(design?);
    }
    Ok(designs)
}

/// The sharpness and light of a field of a lens.
#[derive(Debug, Clone, Copy)]
pub(super) struct FieldView {
    /// The field angle in degrees.
    pub(super) angle: f64,
    /// The area of the pupil in mm² with its error.
    pub(super) area: [f64; 2],
    pub(super) rms: [f64; 2],
}

/// The sharpness and light of every field of a lens; adds the rays traced to `rays`.
pub(super) fn field_views(lens: &Lens, rays: &mut usize) -> ExperimentResult<Vec<FieldView>> {
    let model = RayModel::from_lens(lens, 0)?;
    model.fields.iter().map(|field| field_view(&model, *field, rays)).collect()
}

/// The sharpness and light of a field; adds the rays traced to `rays`.
pub(super) fn field_view(
    model: &RayModel,
    field: FieldPoint,
    rays: &mut usize,
) -> ExperimentResult<FieldView> {
    let quality = field_quality(model, field, REPORTED);
    let rms = match quality.spot {
        Err(AnalysisError::NoRays(why)) => return Err(ExperimentError::Failed(why.to_string())),
        Err(_) => Estimate::new(0.0, 0.0, 0),
        Ok(rms) => rms,
    };
    *rays += rms.rays;
    let number = |estimate: Estimate| [estimate.value, estimate.error];
    Ok(FieldView { angle: field.y, area: number(quality.light), rms: number(rms) })
}

/// The RMS spot radius over some fields in mm, and the mean area of their pupils in mm².
pub(super) fn mean_blur_and_light(views: &[FieldView]) -> [f64; 2] {
    let count = views.len() as f64;
    let square: f64 = views.iter().map(|view| view.rms[0].powi(2)).sum();
    let area: f64 = views.iter().map(|view| view.area[0]).sum();
    [(square / count).sqrt(), area / count]
}

/// The focal length of a lens, in mm.
pub(super) fn focal_length(lens: &Lens) -> ExperimentResult<f64> {
    let model = RayModel::from_lens(lens, 0)?;
    model.first_order.efl.ok_or_else(|| ExperimentError::Failed(format!("{} is afocal", lens.name)))
}

/// A table with a row for each field of each design.
pub(super) fn table(
    name: &'static str,
    designs: &[(&str, &ParetoPoint)],
    rays: &mut usize,
) -> ExperimentResult<DataTable> {
    let columns = [
        "design",
        "beta_mm2",
        "focal_length_mm",
        "field_deg",
        "area_mm2",
        "area_error_mm2",
        "rms_mm",
        "rms_error_mm",
    ];
    let mut table = DataTable::new(name, &columns);
    for (name, design) in designs {
        let beta = design.weight.unwrap_or(f64::NAN);
        let focal = focal_length(&design.lens)?;
        for view in field_views(&design.lens, rays)? {
            let numbers = [beta, focal, view.angle].into_iter();
            let numbers = numbers.chain(view.area).chain(view.rms).map(TableCell::from);
            table.push_row(std::iter::once((*name).into()).chain(numbers));
        }
    }
    Ok(table)
}
