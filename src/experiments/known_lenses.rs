//! Figure 5.8: the Luneburg lens and the Maxwell fisheye reconstructed from their ray paths alone,
//! as functions of the radius and on grids.
//!
//! Rays depend on the gradient of `η²` alone, so that a grid whose surface is fixed at 1 may hide a
//! jump in its outermost voxels: the shape is found ten times more accurately than the level, and
//! both errors are reported. This explains the remark of the figure that the difference is largest
//! at the boundary.

use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    ProgressFn, builtin_task, solve,
};
use crate::grin_design::{FieldDifference, GrinOptimizer, GrinTask, RefinementLevel};
use crate::report::plot_grin_field;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "5.8",
    title: "The lenses of Luneburg and Maxwell reconstructed",
    claim: "The reconstructed index matches the analytic lenses",
    omits: "the renderings of the lenses",
    seconds: 25.0,
    run,
};

/// A lens and the largest errors of its reconstruction: in all, and without the offset of `η²`.
struct KnownLensCase {
    name: &'static str,
    /// The limits at full effort, and for a test with a coarser grid.
    limits: [[f64; 2]; 2],
    /// The refinement levels at small effort; if empty, those of the task.
    small: &'static [RefinementLevel],
}

const COARSE: &[RefinementLevel] =
    &[RefinementLevel { nodes: 5, steps: 80 }, RefinementLevel { nodes: 9, steps: 100 }];

const CASES: [KnownLensCase; 4] = [
    KnownLensCase { name: "luneburg-radial", limits: [[1e-4, 1e-4]; 2], small: &[] },
    KnownLensCase { name: "maxwell-radial", limits: [[1e-3, 5e-4]; 2], small: &[] },
    KnownLensCase { name: "luneburg", limits: [[1.5e-2, 2e-3], [6e-2, 1e-2]], small: COARSE },
    KnownLensCase { name: "maxwell", limits: [[1.5e-2, 5e-3]; 2], small: &[] },
];

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let mut outcome = ExperimentOutcome::default();
    let mut table = DataTable::new(
        "lenses",
        &["task", "nodes", "relative", "without_offset", "offset", "spot_mm", "steps", "rays"],
    );
    let cases = &CASES[..effort.select(4, 3)];
    for (i, case) in cases.iter().enumerate() {
        let span = [i, i + 1].map(|part| part as f64 / cases.len() as f64);
        let task = task(case, effort)?;
        let optimizer = solve(&task, span, progress)?;
        let found = task.difference(optimizer.best())?;
        let found = found
            .ok_or_else(|| ExperimentError::Failed(format!("{}: no exact field", case.name)))?;
        let judged = optimizer.score(optimizer.best())?;
        outcome.claims.extend(claims(case, effort, found));
        let left_out = judged.views.iter().map(|v| v.counts.fates.total() - v.counts.valid());
        outcome.claims.push(Claim::at_most(
            format!("{}: excluded rays", case.name),
            left_out.sum::<usize>() as f64,
            0.0,
        ));
        outcome.rays += usize::try_from(optimizer.rays_traced()).unwrap_or(usize::MAX);
        table.push_row(row(case, &optimizer, found, judged.views[0].spot));
        let pictures = plot_grin_field(&task, optimizer.best());
        let names = PICTURES[i];
        outcome.pictures.extend(pictures.into_iter().zip(names).map(|(mut picture, name)| {
            picture.name = name;
            picture
        }));
    }
    outcome.tables.push(table);
    Ok(outcome)
}

const PICTURES: [[&str; 2]; 4] = [
    ["luneburg-radial-profile", "luneburg-radial-section"],
    ["maxwell-radial-profile", "maxwell-radial-section"],
    ["luneburg-profile", "luneburg-section"],
    ["maxwell-profile", "maxwell-section"],
];

fn task(case: &KnownLensCase, effort: Effort) -> ExperimentResult<GrinTask> {
    let mut task = builtin_task(case.name)?;
    if effort == Effort::Small && !case.small.is_empty() {
        task.levels = case.small.to_vec();
    }
    Ok(task)
}

fn claims(case: &KnownLensCase, effort: Effort, found: FieldDifference) -> [Claim; 2] {
    let [relative, shape] = effort.select(case.limits[0], case.limits[1]);
    let name = case.name;
    [
        Claim::at_most(format!("{name}: relative error"), found.relative, relative),
        Claim::at_most(
            format!("{name}: relative error without the offset"),
            found.without_offset,
            shape,
        ),
    ]
}

fn row(
    case: &KnownLensCase,
    optimizer: &GrinOptimizer,
    found: FieldDifference,
    spot: f64,
) -> [super::TableCell; 8] {
    [
        case.name.into(),
        optimizer.best().nodes().into(),
        found.relative.into(),
        found.without_offset.into(),
        found.offset.into(),
        spot.into(),
        optimizer.steps().into(),
        (optimizer.rays_traced() as f64).into(),
    ]
}
