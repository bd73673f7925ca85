//! Figures 5.4 to 5.7: GRIN fields as displays, for one beam or for two.
//!
//! The optimization uses different rays in every step and none of those by which its result is
//! evaluated here: those are as many as the error of an image needs, and are traced with half of its step where the
//! task names one.
//!
//! The images are pictures ([`picture`](crate::picture)), with the sampler of those through a lens and their error by
//! independent replicates. Light is only followed the other way, from the beam onto the screen: a beam has one
//! direction at every point, which no ray that begins in a pixel has but by chance. A pixel is the light
//! on its area, where the loss spreads each ray over nine pixels so that it can be differentiated; the
//! numbers of an image are those of its pixels, without the noise of sampling. Every image is rendered
//! twice, with samples that are independent, to see that the stated errors cover the difference.

pub(super) mod caustic;
pub(super) mod display;
pub(super) mod multifocal;
pub(super) mod resolution;

use super::{
    Claim, DataTable, Effort, ExperimentError, ExperimentOutcome, ExperimentProgress,
    ExperimentResult, NamedPlot, ProgressFn, builtin_task, solve, solve_from,
};
use crate::grin_design::{
    GrinField, GrinOptimizer, GrinTask, LightGoal, LightSource, LightView, ViewReport,
};
use crate::picture::{ProjectedImage, ProjectedView, ProjectionSettings, project_views};
use crate::report::{plot_grin_field, plot_grin_image};

/// The rays along a side of a beam in the evaluation, relative to the optimization.
const FINER: f64 = 1.57;
/// The error of sampling that an image is rendered to as a share of its mean, in full and as a test.
const SAMPLING: [f64; 2] = [0.02, 0.1];
/// The largest difference of two independent images relative to what their errors allow: 1 and its
/// own scatter, since an error from four replicates is known to a third of it for one pixel.
const DIFFERENCE: f64 = 1.2;
/// The share of the work that the optimization takes; the images take the rest.
const SOLVING: f64 = 0.8;
/// The largest fraction of lost rays.
const LEFT_OUT: f64 = 1e-3;
/// The tolerance of the lowest index for rounding.
const ROUNDING: f64 = 1e-9;

/// The task reduced for a test: its first levels only, fewer rays, coarser images.
fn reduced(mut task: GrinTask, levels: usize) -> GrinTask {
    task.levels.truncate(levels);
    for view in &mut task.views {
        if let LightSource::Beam { rays, .. } = &mut view.source {
            *rays = 64;
        }
        if let LightGoal::Image { pixels, .. } | LightGoal::Far { pixels, .. } = &mut view.goal {
            *pixels = 32;
        }
    }
    task
}

/// The task with rays that its optimization does not use, and half of its step.
fn independent_task(task: &GrinTask) -> GrinTask {
    let mut other = task.clone();
    for view in &mut other.views {
        if let LightSource::Beam { rays, .. } = &mut view.source {
            *rays = (FINER * *rays as f64).round() as usize;
        }
    }
    if let Some(tracing) = &mut other.tracing {
        tracing.per_voxel *= 2.0;
    }
    other
}

/// A solved task with the images of its field by independent rays.
struct EvaluatedField {
    optimizer: GrinOptimizer,
    views: Vec<EvaluatedView>,
}

/// The image of a view by independent rays.
struct EvaluatedView {
    name: String,
    picture: ProjectedView,
    /// The peak signal to noise in dB of the image of the loss, in which each ray is spread over nine pixels.
    loss_quality: Option<f64>,
    /// The image by light on its pixels, by other samples.
    again: ProjectedImage,
    /// The largest change of an exit when the step is halved, in mm, and the rays that tell it.
    tracing_error: Option<f64>,
    tracing_rays: usize,
}

/// The part of a work between two shares of it.
fn part_of([from, to]: [f64; 2], shares: [f64; 2]) -> [f64; 2] {
    shares.map(|share| from + share * (to - from))
}

/// Solves a task, which is a part of the whole work, and evaluates it.
fn solve_and_evaluate(
    task: &GrinTask,
    effort: Effort,
    part: [f64; 2],
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<EvaluatedField> {
    let optimizer = solve(task, part_of(part, [0.0, SOLVING]), progress)?;
    let rest = part_of(part, [SOLVING, 1.0]);
    let views = evaluate(task, optimizer.best(), effort, rest, progress)?;
    Ok(EvaluatedField { optimizer, views })
}

/// The settings of an image, by samples of their own.
fn settings(effort: Effort, seed: u32) -> ProjectionSettings {
    let [fine, coarse] = SAMPLING;
    let tolerance = effort.select(fine, coarse);
    ProjectionSettings { tolerance, seed, ..ProjectionSettings::default() }
}

/// Follows the light of a field with rays that its optimization has not used, onto every image.
fn evaluate(
    task: &GrinTask,
    medium: &GrinField,
    effort: Effort,
    part: [f64; 2],
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<Vec<EvaluatedView>> {
    let task = independent_task(task);
    let reports = task.report_views(medium)?;
    let mut project = |seed: u32, [from, to]: [f64; 2]| {
        let mut tell = |share: f64| {
            let done = from + share * (to - from);
            progress(ExperimentProgress { done, doing: "images by light onto a screen" })
        };
        project_views(&task, medium, &settings(effort, seed), &mut tell)
    };
    let pictures = project(0, part_of(part, [0.0, 0.5]))?;
    if pictures.iter().flatten().any(|picture| !picture.light.complete) {
        return Err(ExperimentError::Stopped);
    }
    let again = project(1, part_of(part, [0.5, 1.0]))?;
    let both = task.views.iter().zip(reports).zip(pictures.into_iter().zip(again));
    let view = |((view, report), (picture, again)): (_, (Option<_>, Option<ProjectedView>))| {
        let (view, report): (&LightView, ViewReport) = (view, report);
        let (picture, again): (ProjectedView, _) = picture.zip(again)?;
        let (name, again) = (view.name.clone(), again.light);
        let (tracing_error, tracing_rays) = (report.error, report.result.counts.fates.total());
        let loss_quality = report.result.psnr;
        Some(EvaluatedView { name, picture, loss_quality, again, tracing_error, tracing_rays })
    };
    let views: Vec<EvaluatedView> = both.filter_map(view).collect();
    // An image that was ended early is none.
    let is_whole = |view: &EvaluatedView| view.picture.light.complete && view.again.complete;
    views.iter().all(is_whole).then_some(views).ok_or(ExperimentError::Stopped)
}

/// The columns of the table of views.
const COLUMNS: [&str; 13] = [
    "view",
    "nodes",
    "quality_db",
    "quality_error_db",
    "correlation",
    "correlation_error",
    "light",
    "sampling_error",
    "rays",
    "left_out",
    "tracing_error_mm",
    "index_low",
    "index_high",
];

/// The claims that two independent images of the same light have the error that was asked for, and differ by no more
/// than that. An error is never below what the number of rays leaves, so that images of few rays fail.
fn sampling_claims(name: &str, [image, again]: [&ProjectedImage; 2], effort: Effort) -> [Claim; 2] {
    let [fine, coarse] = SAMPLING;
    let error = image.rms_error().unwrap_or(f64::INFINITY);
    let says = format!("{name}: error of sampling, relative to the mean of the image");
    let sampled = Claim::at_most(says, error, effort.select(fine, coarse));
    let says = format!("{name}: difference of an independent image, relative to the stated errors");
    [sampled, Claim::at_most(says, image.difference(again), DIFFERENCE)]
}

impl EvaluatedView {
    /// The claims about the image: its quality, its correlation, few lost rays, and its error.
    fn claims(&self, [quality, correlation]: [f64; 2], effort: Effort) -> Vec<Claim> {
        let Self { name, picture, again, .. } = self;
        let light = &picture.light;
        let found = picture.quality();
        let says = format!("{name}: peak signal to noise, by independent rays");
        let good =
            Claim::at_least(says, found.value, quality).in_unit("dB").with_error(found.error);
        let found = picture.correlation();
        let says = format!("{name}: correlation with the target");
        let alike = Claim::at_least(says, found.value, correlation).with_error(found.error);
        let says = format!("{name}: fraction of lost rays");
        let kept = Claim::at_most(says, light.lost_share(), LEFT_OUT);
        let mut claims = vec![good, alike, kept];
        claims.extend(sampling_claims(name, [light, again], effort));
        claims
    }

    /// The plot of the image beside its target.
    fn plot(&self, name: &'static str) -> NamedPlot {
        let image = &self.picture.image;
        let canvas = plot_grin_image(name, image, &self.picture.summary());
        NamedPlot { name, canvas }
    }

    /// The number of rays followed.
    fn rays(&self) -> usize {
        self.picture.light.rays + self.again.rays + self.tracing_rays
    }
}

impl EvaluatedField {
    /// Adds a row for every image.
    fn rows(&self, table: &mut DataTable) {
        let extremes = self.optimizer.task().extremes(self.optimizer.best());
        for view in &self.views {
            let [quality, correlation] = [view.picture.quality(), view.picture.correlation()];
            let light = &view.picture.light;
            table.push_row([
                view.name.clone().into(),
                self.optimizer.best().nodes().into(),
                quality.value.into(),
                quality.error.into(),
                correlation.value.into(),
                correlation.error.into(),
                light.mean().into(),
                light.rms_error().unwrap_or(f64::NAN).into(),
                light.rays.into(),
                light.lost_share().into(),
                view.tracing_error.unwrap_or(f64::NAN).into(),
                extremes.low.into(),
                extremes.high.into(),
            ]);
        }
    }

    /// The claims about every image.
    fn claims(&self, limits: [f64; 2], effort: Effort) -> Vec<Claim> {
        self.views.iter().flat_map(|view| view.claims(limits, effort)).collect()
    }

    /// The claims that the field can be manufactured.
    fn manufacturability(&self) -> [Claim; 2] {
        let task = self.optimizer.task();
        let extremes = task.extremes(self.optimizer.best());
        let [low, high] = [task.limits.low, task.limits.high];
        [
            Claim::at_least("smallest index", extremes.low, low - ROUNDING),
            Claim::at_most("largest index", extremes.high, high),
        ]
    }

    /// The plots of its images beside the target images.
    fn pictures(&self, names: &[&'static str]) -> Vec<NamedPlot> {
        self.views.iter().zip(names).map(|(view, name)| view.plot(name)).collect()
    }

    /// The number of rays traced forwards.
    fn rays(&self) -> usize {
        let rendering: usize = self.views.iter().map(EvaluatedView::rays).sum();
        usize::try_from(self.optimizer.rays_traced())
            .unwrap_or(usize::MAX)
            .saturating_add(rendering)
    }
}

/// The outcome of one field that shows images of at least some quality in dB and correlation.
fn outcome_of(
    evaluated: &EvaluatedField,
    names: &[&'static str],
    limits: [f64; 2],
    effort: Effort,
) -> ExperimentOutcome {
    let mut table = DataTable::new("views", &COLUMNS);
    evaluated.rows(&mut table);
    let mut claims = evaluated.claims(limits, effort);
    claims.extend(evaluated.manufacturability());
    let mut pictures = evaluated.pictures(names);
    pictures.extend(plot_grin_field(evaluated.optimizer.task(), evaluated.optimizer.best()));
    ExperimentOutcome {
        claims,
        tables: vec![table],
        pictures,
        rays: evaluated.rays(),
        ..ExperimentOutcome::default()
    }
}

/// A built-in task at full effort; for a test its first levels.
fn task(name: &str, effort: Effort, levels: usize) -> ExperimentResult<GrinTask> {
    let task = builtin_task(name)?;
    Ok(if effort == Effort::Full { task } else { reduced(task, levels) })
}
