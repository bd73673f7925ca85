//! Figure 5.10 and table 5.2: a plume of gas reconstructed from the positions and directions of
//! rays that leave it, by the exact adjoint of curved rays and by straight rays, for plumes of up
//! to a thousand times the strength.
//!
//! The plume is synthetic. Its measurements are traced through its formula, by another integrator
//! and with far finer steps than in the reconstruction, so that no method profits from its own
//! errors. The straight-ray method solves the same measurements by linear least squares, on the
//! same grid and within the same bounds, and its best iterate counts, a choice that requires
//! knowledge of the answer. The method of Atcheson et al. (2008) is added: three volumes for the
//! gradient, integrated at the end. For weak plumes the better of the two is as good as the
//! adjoint; their errors there are due to discretisation and slow convergence, not to the curvature
//! of the rays.
//!
//! Table 5.2 prints `‖(η̂ - η)/η‖` over 64³ voxels, not divided by their number. It is reported
//! too, but it depends more on the contrast than on the method: a constant index reaches 0.0088 on
//! the data of the table. The error relative to the contrast measures the reconstruction.

use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, TableCell, builtin_task, report_progress, solve,
};
use crate::grin::IndexField;
use crate::grin_design::{
    GrinField, GrinTask, LightSource, RefinementLevel, SourceDirections, StraightRays,
    ViewMeasurement,
};
use crate::math::Vec3;
use crate::plot::{
    Axis, BLACK, Canvas, Chart, Color, GREY, Legend, PALETTE, Stroke, TextAlign, gray_level,
};
use crate::report::plot_grin_field;
use rayon::prelude::*;
use std::ops::ControlFlow;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "5.10",
    title: "A plume of gas reconstructed from its deflections, by curved and by straight rays",
    claim: "Curved rays reconstruct the plume at any strength, straight rays only a weak one",
    omits: "the measured gas, which a synthetic one replaces; the renderings of its isosurfaces",
    seconds: 120.0,
    run,
};

/// A task, the strength of its plume, and the values that table 5.2 prints for other data.
struct PlumeCase {
    task: &'static str,
    times: f64,
    printed: [f64; 2],
}

const CASES: [PlumeCase; 4] = [
    PlumeCase { task: "plume", times: 1.0, printed: [0.0014, 0.0110] },
    PlumeCase { task: "plume-10x", times: 10.0, printed: [0.014, 0.113] },
    PlumeCase { task: "plume-100x", times: 100.0, printed: [0.29, 1.28] },
    PlumeCase { task: "plume-1000x", times: 1000.0, printed: [3.8, 19.3] },
];

/// The largest errors for the weakest and the strongest plume, relative to the contrast.
const WEAK: f64 = 0.02;
const STRONG: f64 = 0.05;
/// The largest error of a test, with fewer rays and a coarser grid.
const COARSE: f64 = 0.10;
/// The largest ratio of the errors of two methods that count as equally good.
const TIE: f64 = 2.0;
/// The minimum ratio of the errors of straight and curved rays for the strongest plume, in full and
/// as a test.
const BETTER: [f64; 2] = [5.0, 2.0];
/// The number of voxels along a side in the norm of table 5.2.
const VOXELS: usize = 64;
/// The number of cells along a side of the plot of a section.
const CELLS: usize = 100;

const FEW: &[RefinementLevel] = &[
    RefinementLevel { nodes: 5, steps: 10 },
    RefinementLevel { nodes: 9, steps: 15 },
    RefinementLevel { nodes: 17, steps: 25 },
];

/// A field with its error.
struct ReconstructedPlume {
    medium: GrinField,
    error: f64,
    frobenius: f64,
}

/// The results for one strength.
struct PlumeRow {
    case: &'static PlumeCase,
    task: GrinTask,
    measured: ViewMeasurement,
    adjoint: ReconstructedPlume,
    chords: ReconstructedPlume,
    /// The error of the straight-ray method after its last step.
    last: f64,
    step: usize,
    gradients: ReconstructedPlume,
    /// The error of a constant index.
    constant: f64,
    left_out: usize,
}

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let cases: Vec<&'static PlumeCase> =
        CASES.iter().filter(|case| effort == Effort::Full || is_extreme(case)).collect();
    let (mut outcome, mut rows) = (ExperimentOutcome::default(), Vec::new());
    for (i, case) in cases.iter().enumerate() {
        let at = |part: f64| (i as f64 + part) / cases.len() as f64;
        let task = task(case, effort)?;
        let optimizer = solve(&task, [at(0.0), at(0.7)], progress)?;
        outcome.rays += usize::try_from(optimizer.rays_traced()).unwrap_or(usize::MAX);
        let judged = optimizer.score(optimizer.best())?;
        let left_out = judged.views.iter().map(|v| v.counts.total() - v.counts.valid()).sum();
        let adjoint = found(&task, optimizer.best().clone())?;
        rows.push(row(case, task, (adjoint, left_out), effort, at, progress)?);
    }
    outcome.claims = claims(&rows, effort);
    outcome.tables.push(table(&rows));
    outcome.pictures.push(NamedPlot { name: "errors", canvas: chart(&rows) });
    outcome.pictures.push(NamedPlot { name: "sections", canvas: sections(&rows) });
    if let Some(row) = rows.last() {
        let light = plot_grin_field(&row.task, &row.adjoint.medium).into_iter().nth(1);
        outcome
            .pictures
            .extend(light.map(|NamedPlot { canvas, .. }| NamedPlot { name: "light", canvas }));
    }
    Ok(outcome)
}

/// True for the weakest and the strongest plume.
fn is_extreme(case: &PlumeCase) -> bool {
    case.times == 1.0 || case.times == 1000.0
}

fn task(case: &PlumeCase, effort: Effort) -> ExperimentResult<GrinTask> {
    let mut task = builtin_task(case.task)?;
    if effort == Effort::Small {
        task.levels = FEW.to_vec();
        for view in &mut task.views {
            if let LightSource::Parallel { rays, directions, .. } = &mut view.source {
                (*rays, *directions) = (300, SourceDirections::Around(12));
            }
        }
    }
    Ok(task)
}

/// Adds the results of the straight-ray methods to that of the adjoint.
fn row(
    case: &'static PlumeCase,
    task: GrinTask,
    (adjoint, left_out): (ReconstructedPlume, usize),
    effort: Effort,
    at: impl Fn(f64) -> f64,
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<PlumeRow> {
    let (nodes, steps) = (adjoint.medium.nodes(), effort.select(60, 25));
    let doing = format!("{}, by straight rays", task.name);
    report_progress(progress, at(0.7), &doing)?;
    let chords = StraightRays::new(&task)?;
    let (mut best, mut last, mut step): (Option<(f64, GrinField)>, _, _) = (None, f64::NAN, 0);
    let (mut count, mut ended) = (0, Ok(()));
    let visit = |medium: &GrinField| {
        count += 1;
        last = error(&task, medium);
        if best.as_ref().is_none_or(|(least, _)| last < *least) {
            (best, step) = (Some((last, medium.clone())), count);
        }
        ended = report_progress(progress, at(0.7 + 0.2 * count as f64 / steps as f64), &doing);
        if ended.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    };
    let end = chords.reconstruct(nodes, steps, visit)?;
    ended?;
    let best = best.map_or(end, |(_, medium)| medium);
    let doing = format!("{}, by gradients along straight rays", task.name);
    report_progress(progress, at(0.9), &doing)?;
    let gradients = chords.reconstruct_by_gradients(nodes, steps)?;
    let measured = task.measurements()?.into_iter().next();
    let even = GrinField::initial(&task, nodes)?;
    Ok(PlumeRow {
        case,
        measured: measured
            .ok_or_else(|| ExperimentError::Failed("nothing is measured".to_owned()))?,
        adjoint,
        chords: found(&task, best)?,
        last,
        step,
        gradients: found(&task, gradients)?,
        constant: found(&task, even)?.frobenius,
        left_out,
        task,
    })
}

/// The error relative to the contrast.
fn error(task: &GrinTask, medium: &GrinField) -> f64 {
    let difference = task.difference(medium).ok().flatten();
    difference.map_or(f64::NAN, |difference| difference.relative_to_contrast)
}

fn found(task: &GrinTask, medium: GrinField) -> ExperimentResult<ReconstructedPlume> {
    let exact =
        task.exact.as_ref().ok_or_else(|| ExperimentError::Failed("no exact field".to_owned()))?;
    let exact = exact.field::<f64>()?;
    let [low, high] = task.space.corners();
    let at = |low: f64, high: f64, i: usize| low + (high - low) * i as f64 / (VOXELS - 1) as f64;
    let square = |n: usize| {
        let (i, j, k) = (n % VOXELS, n / VOXELS % VOXELS, n / VOXELS / VOXELS);
        let p = Vec3::new(at(low.x, high.x, i), at(low.y, high.y, j), at(low.z, high.z, k));
        let index = exact.sample(p).index;
        ((medium.index_field().sample(p).index - index) / index).powi(2)
    };
    let squares: Vec<f64> = (0..VOXELS.pow(3)).into_par_iter().map(square).collect();
    let frobenius = squares.iter().sum::<f64>().sqrt();
    Ok(ReconstructedPlume { error: error(task, &medium), medium, frobenius })
}

fn claims(rows: &[PlumeRow], effort: Effort) -> Vec<Claim> {
    let mut claims = Vec::new();
    for row in rows {
        let name = format!("{} times", row.case.times);
        let says = format!("{name}: excluded rays");
        claims.push(Claim::exactly(says, row.left_out as f64, 0.0));
        let limit = if row.case.times < 1000.0 { WEAK } else { STRONG };
        let says = format!("{name}: error by curved rays, relative to the contrast");
        claims.push(Claim::at_most(says, row.adjoint.error, effort.select(limit, COARSE)));
        let worse = row.chords.error.min(row.gradients.error) / row.adjoint.error;
        let says = format!(
            "{name}: error by straight rays, the better method, relative to that by curved rays"
        );
        if row.case.times == 1.0 {
            claims.push(Claim::at_most(says, worse.max(1.0 / worse), TIE));
        } else if row.case.times == 1000.0 {
            claims.push(Claim::at_least(says, worse, effort.select(BETTER[0], BETTER[1])));
        }
    }
    claims
}

fn table(rows: &[PlumeRow]) -> DataTable {
    let mut table = DataTable::new(
        "errors",
        &[
            "times",
            "deflection_deg",
            "rays",
            "left_out",
            "adjoint_of_contrast",
            "chords_of_contrast",
            "chords_best_step",
            "chords_last_of_contrast",
            "gradients_of_contrast",
            "constant_frobenius",
            "adjoint_frobenius",
            "chords_frobenius",
            "gradients_frobenius",
            "printed_adjoint_frobenius",
            "printed_atcheson_frobenius",
        ],
    );
    for row in rows {
        let numbers: [TableCell; 15] = [
            row.case.times.into(),
            row.measured.deflection.to_degrees().into(),
            row.measured.counts.total().into(),
            reasons(row).into(),
            row.adjoint.error.into(),
            row.chords.error.into(),
            row.step.into(),
            row.last.into(),
            row.gradients.error.into(),
            row.constant.into(),
            row.adjoint.frobenius.into(),
            row.chords.frobenius.into(),
            row.gradients.frobenius.into(),
            row.case.printed[0].into(),
            row.case.printed[1].into(),
        ];
        table.push_row(numbers);
    }
    table
}

/// The numbers of excluded rays with the reasons.
fn reasons(row: &PlumeRow) -> String {
    let measured = row.measured.counts.excluded();
    let mut reasons: Vec<String> =
        measured.map(|(reason, count)| format!("{count} {reason} in the measurement")).collect();
    if row.left_out > 0 {
        reasons.push(format!("{} in the reconstructed field", row.left_out));
    }
    if reasons.is_empty() { "none".to_owned() } else { reasons.join("; ") }
}

/// A method: its name, and its result in a row.
type PlumeMethod = (&'static str, fn(&PlumeRow) -> &ReconstructedPlume);

const METHODS: [PlumeMethod; 3] = [
    ("curved rays", |row| &row.adjoint),
    ("straight rays", |row| &row.chords),
    ("gradients along them", |row| &row.gradients),
];

fn chart(rows: &[PlumeRow]) -> Canvas {
    let mut canvas = Canvas::new([1300, 800]);
    let x = Axis::logarithmic("relative strength", rows.iter().map(|row| row.case.times), 0.1);
    let errors = METHODS.iter().flat_map(|(_, of)| rows.iter().map(|row| of(row).error));
    let y = Axis::logarithmic("error relative to the contrast", errors, 1e-4);
    let chart = Chart::new([140.0, 110.0], [960.0, 700.0], x, y);
    chart.draw(&mut canvas, "reconstruction of a synthetic plume");
    let mut legend = Legend::new([1000.0, 133.0]);
    for (i, (name, of)) in METHODS.iter().enumerate() {
        let points: Vec<[f64; 2]> =
            rows.iter().map(|row| [row.case.times, of(row).error]).collect();
        let places = chart.to_pixels(&points);
        canvas.marked_curve(&places, PALETTE[i], Stroke::Solid);
        legend.curve(&mut canvas, name, PALETTE[i], Stroke::Solid);
    }
    canvas
}

/// Draws the plume and its reconstruction by each method, in the plane of x and z.
fn sections(rows: &[PlumeRow]) -> Canvas {
    let (side, top) = (2.0 * CELLS as f64, 70.0);
    let (across, down) = (side + 30.0, side + 50.0);
    let size = [60.0 + 4.0 * across, top + 30.0 + down * rows.len() as f64];
    let mut canvas = Canvas::new(size.map(|length| length as u32));
    for (k, row) in rows.iter().enumerate() {
        let corner = |column: usize| [40.0 + across * column as f64, top + 34.0 + down * k as f64];
        let title = format!("{} times", row.case.times);
        canvas.text([corner(0)[0], corner(0)[1] - 26.0], &title, GREY, TextAlign::Left);
        let exact = row.task.exact.as_ref().and_then(|exact| exact.field::<f64>().ok());
        let exact = exact.as_deref();
        let found = METHODS.iter().map(|(_, of)| Some(of(row).medium.index_field()));
        for (column, field) in [exact].into_iter().chain(found).enumerate() {
            if let Some(field) = field {
                canvas.raster(corner(column), CELLS, 2, &section_levels(row, field));
            }
        }
    }
    let names = ["the plume"].into_iter().chain(METHODS.iter().map(|(name, _)| *name));
    for (column, name) in names.enumerate() {
        let x = 40.0 + across * column as f64 + 0.5 * side;
        canvas.text([x, 30.0], name, BLACK, TextAlign::Middle);
    }
    canvas
}

/// The grey levels of a section, from the lowest to the highest index allowed.
fn section_levels(row: &PlumeRow, field: &dyn IndexField<f64>) -> Vec<Color> {
    let [low, high] = row.task.space.corners();
    let limits = row.task.limits;
    let at = |low: f64, high: f64, i: usize| low + (high - low) * (i as f64 + 0.5) / CELLS as f64;
    let shade = |n: usize| {
        let p = Vec3::new(at(low.x, high.x, n % CELLS), 0.0, at(high.z, low.z, n / CELLS));
        let share = (field.sample(p).index - limits.low) / (limits.high - limits.low);
        gray_level(0.2 + 0.75 * share.clamp(-0.2, 1.05))
    };
    (0..CELLS * CELLS).map(shade).collect()
}
