//! Figure 5.5: the effect of the resolution of a field, on trilinear grids and with tricubic
//! splines.
//!
//! The gradient of a trilinear field jumps at the faces of its voxels. A Hessian without these
//! jumps is the exact derivative of the computation but not of the physical rays: for fine and
//! rough fields it misleads the optimization. A spline has no jumps.
//!
//! Two claims fail. By the light on its pixels, the image of the smoothed Hessian is worse than that of the exact one
//! at 33 nodes, by 0.08 dB, and the last refinement of the splines gains 0.4 dB in place of 0.5. The image of the
//! loss, in which each ray is spread over nine pixels, gains 0.3 dB and 3.4 dB: what its footprint smooths away is no
//! part of the loss.

use super::{EvaluatedView, SOLVING, evaluate, part_of, reduced, sampling_claims, solve_from};
use crate::analysis::Estimate;
use crate::experiments::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, builtin_task, report_progress,
};
use crate::grin_design::{FieldRepresentation, GrinOptimizer, GrinTask};
use crate::plot::{Axis, Canvas, Chart, Legend, PALETTE, Stroke, draw_image_row, gray_levels};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "5.5",
    title: "Effect of the resolution of a field",
    claim: "The finer the field, the closer its image is to the target",
    omits: "the portrait, which a face replaces",
    seconds: 40.0,
    run,
};

/// The interpolation of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
enum InterpolationKind {
    /// Trilinear with the Hessian between the nodes alone.
    Exact,
    /// Trilinear with the smoothed Hessian, which includes the jumps.
    Smoothed,
    Tricubic,
}

const KINDS: [InterpolationKind; 3] =
    [InterpolationKind::Exact, InterpolationKind::Smoothed, InterpolationKind::Tricubic];

/// The minimum gain of the next resolution, in dB.
const GAIN: f64 = 0.5;
/// The minimum gain of the tricubic field at the finest resolution in dB, in full and as a test.
const SMOOTHER: [f64; 2] = [5.0, 2.0];

/// The minimum gain of the smoothed Hessian at the finest resolution, in dB; on a coarse grid both
/// differ by less.
const SMOOTHED: f64 = 0.1;

impl InterpolationKind {
    const fn name(self) -> &'static str {
        match self {
            Self::Exact => "trilinear, exact",
            Self::Smoothed => "trilinear, smoothed",
            Self::Tricubic => "tricubic",
        }
    }

    fn field(self, half: f64) -> FieldRepresentation {
        match self {
            Self::Tricubic => FieldRepresentation::Tricubic { half },
            Self::Exact | Self::Smoothed => FieldRepresentation::Trilinear { half },
        }
    }
}

/// A field of one kind and resolution.
struct ResolutionRow {
    kind: InterpolationKind,
    optimizer: GrinOptimizer,
    view: EvaluatedView,
}

impl ResolutionRow {
    fn nodes(&self) -> usize {
        self.optimizer.current().nodes()
    }

    /// The claims about the error of the image.
    fn sampling_claims(&self, effort: Effort) -> [Claim; 2] {
        let name = format!("{}, {} nodes", self.kind.name(), self.nodes());
        sampling_claims(&name, [&self.view.picture.light, &self.view.again], effort)
    }

    /// The peak signal to noise in dB.
    fn quality(&self) -> Estimate {
        self.view.picture.quality()
    }
}

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let full = builtin_task("display")?;
    let task = if effort == Effort::Full { full } else { reduced(full, 2) };
    let count = KINDS.len() * task.levels.len();
    let mut rows = Vec::new();
    for kind in KINDS {
        for levels in 1..=task.levels.len() {
            let part = [0, 1].map(|i| (rows.len() + i) as f64 / count as f64);
            rows.push(find(&task, (kind, levels), effort, part, progress)?);
        }
    }
    let mut outcome =
        ExperimentOutcome { claims: claims(&rows, effort), ..ExperimentOutcome::default() };
    let rays = |row: &ResolutionRow| row.optimizer.rays_traced() as usize + row.view.rays();
    outcome.rays = rows.iter().map(rays).sum();
    outcome.tables.push(table(&rows));
    outcome.pictures.push(NamedPlot { name: "quality", canvas: chart(&rows) });
    outcome.pictures.push(NamedPlot { name: "images", canvas: images(&rows) });
    Ok(outcome)
}

/// Solves the first levels of a task, with one of its views.
fn find(
    task: &GrinTask,
    (kind, levels): (InterpolationKind, usize),
    effort: Effort,
    part: [f64; 2],
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<ResolutionRow> {
    let mut task = task.clone();
    task.views.truncate(1);
    task.levels.truncate(levels);
    task.field = kind.field(task.space.corners()[1].x);
    let nodes = task.levels[levels - 1].nodes;
    task.name = format!("{}, {nodes} nodes", kind.name());
    report_progress(progress, part[0], &task.name)?;
    let optimizer = GrinOptimizer::new(&task)?;
    let optimizer =
        if kind == InterpolationKind::Exact { optimizer.with_exact_hessian() } else { optimizer };
    let optimizer = solve_from(optimizer, part_of(part, [0.0, SOLVING]), progress)?;
    let rest = part_of(part, [SOLVING, 1.0]);
    let views = evaluate(&task, optimizer.current(), effort, rest, progress)?;
    let first = views.into_iter().next();
    let view = first.ok_or_else(|| ExperimentError::Failed("a task without images".to_owned()))?;
    Ok(ResolutionRow { kind, optimizer, view })
}

fn rows_of(rows: &[ResolutionRow], kind: InterpolationKind) -> Vec<&ResolutionRow> {
    rows.iter().filter(|row| row.kind == kind).collect()
}

fn claims(rows: &[ResolutionRow], effort: Effort) -> Vec<Claim> {
    let mut claims = Vec::new();
    for kind in KINDS {
        for pair in rows_of(rows, kind).windows(2) {
            let name = kind.name();
            let says =
                format!("{name}: gain from {} to {} nodes", pair[0].nodes(), pair[1].nodes());
            let gain = gain(says, [pair[0].quality(), pair[1].quality()], GAIN);
            claims.push(gain);
        }
    }
    let unknown = Estimate::new(f64::NAN, 0.0, 0);
    let last = |kind| rows_of(rows, kind).last().map_or(unknown, |row| row.quality());
    let [exact, smoothed, tricubic] = KINDS.map(last);
    let nodes = rows.last().map_or(0, ResolutionRow::nodes);
    let [far, near] = SMOOTHER;
    let says = format!("gain of tricubic splines over trilinear grids, {nodes} nodes");
    claims.push(gain(says, [smoothed, tricubic], effort.select(far, near)));
    let says = format!("gain of the smoothed Hessian over the exact one, {nodes} nodes");
    claims.push(gain(says, [exact, smoothed], effort.select(SMOOTHED, -SMOOTHED)));
    claims.extend(rows.iter().flat_map(|row| row.sampling_claims(effort)));
    claims
}

/// The claim that a quality in dB exceeds another one.
fn gain(says: String, [less, more]: [Estimate; 2], limit: f64) -> Claim {
    let gain = Claim::at_least(says, more.value - less.value, limit).in_unit("dB");
    gain.with_error(more.error.hypot(less.error))
}

fn table(rows: &[ResolutionRow]) -> DataTable {
    let columns = [
        "field",
        "nodes",
        "numbers",
        "quality_db",
        "quality_error_db",
        "correlation",
        "sampling_error",
        "steps",
        "rays",
    ];
    let mut table = DataTable::new("resolutions", &columns);
    for row in rows {
        table.push_row([
            row.kind.name().into(),
            row.nodes().into(),
            row.optimizer.current().index_field().parameters().len().into(),
            row.quality().value.into(),
            row.quality().error.into(),
            row.view.picture.correlation().value.into(),
            row.view.picture.light.rms_error().unwrap_or(f64::NAN).into(),
            row.optimizer.steps().into(),
            (row.optimizer.rays_traced() as usize).into(),
        ]);
    }
    table
}

fn chart(rows: &[ResolutionRow]) -> Canvas {
    let place = |row: &ResolutionRow| [row.nodes() as f64, row.quality().value];
    let mut canvas = Canvas::new([1400, 760]);
    let x = Axis::linear("nodes along a side", rows.iter().map(|row| place(row)[0]));
    let y = Axis::linear("peak signal to noise, dB", rows.iter().map(|row| place(row)[1]));
    let chart = Chart::new([120.0, 110.0], [940.0, 660.0], x, y);
    chart.draw(&mut canvas, "quality by resolution");
    let mut legend = Legend::new([980.0, 133.0]);
    for (i, kind) in KINDS.into_iter().enumerate() {
        let points: Vec<[f64; 2]> = rows_of(rows, kind).into_iter().map(place).collect();
        canvas.marked_curve(&chart.to_pixels(&points), PALETTE[i], Stroke::Solid);
        legend.curve(&mut canvas, kind.name(), PALETTE[i], Stroke::Solid);
    }
    canvas
}

/// Draws the images of the tricubic fields and the target image.
fn images(rows: &[ResolutionRow]) -> Canvas {
    let rows = rows_of(rows, InterpolationKind::Tricubic);
    let Some(first) = rows.first().map(|row| &row.view.picture.image) else {
        return Canvas::new([640, 480]);
    };
    let peak = first.target.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let panel = |row: &&ResolutionRow| {
        let title = format!("{} nodes, {:.1} dB", row.nodes(), row.quality().value);
        let image = &row.view.picture.image;
        (title, gray_levels(&image.formed, image.pixels, peak))
    };
    let mut panels: Vec<_> = rows.iter().map(panel).collect();
    panels.push(("target".to_owned(), gray_levels(&first.target, first.pixels, peak)));
    let errors = rows.iter().filter_map(|row| row.view.picture.light.rms_error());
    let error = 100.0 * errors.fold(0.0, f64::max);
    let title = format!("tricubic fields; sampling error {error:.1} % or less");
    draw_image_row(&title, first.pixels, &panels)
}
