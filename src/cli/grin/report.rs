//! The report of a gradient-index design: result, limits, time and memory.

use super::straight_rays::StraightRayResult;
use crate::analysis::Estimate;
use crate::cli::output::{ShortNumber, TextTable};
use crate::files::{self, Volume};
use crate::grin_design::{
    self, FieldDifference, FieldScore, GrinOptimizer, LimitCheck, ViewResult,
};
use crate::measure::MemoryUse;
use crate::picture::ProjectedView;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// The cost of a search.
pub(super) struct GrinCostSummary {
    pub(super) ms: f64,
    pub(super) processor_ms: Option<f64>,
    pub(super) memory: Option<MemoryUse>,
    pub(super) end: GrinEnd,
}

/// The reason for which a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum GrinEnd {
    /// All levels were done, until they converged or by all of their steps.
    Finished,
    /// `--iterations` were made.
    IterationLimit,
    /// `--minutes` were over.
    TimeLimit,
    /// It was asked to end.
    Stopped,
}

impl GrinEnd {
    /// The end as it follows the cost.
    const fn words(self) -> &'static str {
        match self {
            Self::Finished => "",
            Self::IterationLimit => ", iteration limit reached",
            Self::TimeLimit => ", time limit reached",
            Self::Stopped => ", stopped",
        }
    }
}

/// The printed result.
#[derive(Serialize)]
pub(super) struct GrinReport {
    name: String,
    stopped: bool,
    end: GrinEnd,
    loss: f64,
    /// The unit of the loss.
    #[serde(skip)]
    loss_unit: &'static str,
    views: Vec<ViewSummary>,
    error: Option<FieldDifference>,
    pub(super) lines: Option<StraightRayResult>,
    index: [f64; 2],
    slope: f64,
    limits: Vec<LimitReport>,
    nodes: usize,
    parameters: usize,
    steps: usize,
    rays: u64,
    integrator: &'static str,
    step: f64,
    ms: f64,
    processor_ms: Option<f64>,
    memory: Option<MemoryUse>,
    /// The images that are written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) images: Vec<ImageReport>,
    pub(super) files: Vec<PathBuf>,
    /// The best field, if it could not be saved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) field: Option<UnsavedField>,
    /// Images of an earlier run in the same folder.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) stale: Vec<PathBuf>,
}

/// A field that could not be saved: its values at the nodes of a grid, in mm, x fastest.
#[derive(Serialize)]
pub(super) struct UnsavedField {
    counts: [usize; 3],
    low: [f64; 3],
    spacing: [f64; 3],
    index: Vec<f64>,
}

impl From<Volume> for UnsavedField {
    fn from(volume: Volume) -> Self {
        let grid = &volume.grid;
        let [low, spacing] = [grid.low(), grid.spacing()].map(|v| [v.x, v.y, v.z]);
        Self { counts: grid.counts(), low, spacing, index: volume.values }
    }
}

/// The result of a view.
#[derive(Serialize)]
struct ViewSummary {
    name: String,
    weight: f64,
    spot: f64,
    quality_db: Option<f64>,
    rays: usize,
    excluded: BTreeMap<&'static str, usize>,
    retrace_error: f64,
}

/// The image of a view as it is written, with its error by sampling.
#[derive(Serialize)]
pub(super) struct ImageReport {
    view: String,
    /// Peak signal to noise and correlation with the target, each with its error; none of a black image.
    quality_db: Option<[f64; 2]>,
    correlation: Option<[f64; 2]>,
    /// The share of the light that lands on the image, and its error.
    light: [f64; 2],
    /// The error of the pixels as a share of the mean of the image; none of a black image.
    error: Option<f64>,
    /// True if that is as small as it was asked to be.
    reached: bool,
    rays: usize,
    lost: BTreeMap<&'static str, usize>,
    beside: usize,
    ms: f64,
}

impl ImageReport {
    pub(super) fn new(view: &str, seen: &ProjectedView, ms: f64) -> Self {
        let pair = |found: Estimate| [found.value, found.error];
        let light = &seen.light;
        let lost = light.fates.iter().filter(|(fate, _)| !fate.has_arrived());
        let error = light.rms_error();
        Self {
            view: view.to_owned(),
            quality_db: error.map(|_| pair(seen.quality())),
            correlation: error.map(|_| pair(seen.correlation())),
            light: pair(light.light()),
            error,
            reached: light.reached,
            rays: light.rays,
            lost: lost.map(|(fate, count)| (fate.name(), count)).collect(),
            beside: light.beside,
            ms,
        }
    }
}

impl Display for ImageReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rays, ms, error, quality_db, correlation, .. } = self;
        let (Some(error), Some(quality), Some(correlation)) = (error, quality_db, correlation)
        else {
            return write!(f, "no light on the screen by {rays} rays, {ms:.0} ms");
        };
        write!(f, "{:.2} ± {:.2} dB, ", quality[0], quality[1])?;
        write!(f, "correlation {:.4} ± {:.4}; ", correlation[0], correlation[1])?;
        let short = if self.reached { "" } else { ", more than asked for" };
        write!(f, "pixels ± {:.1} % of the mean{short}, {rays} rays, {ms:.0} ms", 100.0 * error)
    }
}

/// A manufacturing limit and the extreme of the field.
#[derive(Serialize)]
struct LimitReport {
    name: &'static str,
    value: f64,
    limit: f64,
    margin: f64,
    kept: bool,
    at: [f64; 3],
}

impl From<LimitCheck> for LimitReport {
    fn from(check: LimitCheck) -> Self {
        let LimitCheck { name, value, limit, margin, at } = check;
        Self { name, value, limit, margin, kept: check.is_satisfied(), at: [at.x, at.y, at.z] }
    }
}

impl Display for LimitReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, value, limit, margin, at: [x, y, z], .. } = self;
        let unit = if *name == "slope" { " / mm" } else { "" };
        write!(f, "{name} {value:.6}{unit}, limit {limit}: ")?;
        let what = if self.kept { "satisfied, margin" } else { "violated by" };
        // A negative margin within rounding is printed as 0.
        let margin = if self.kept { margin.max(0.0) } else { -margin };
        write!(f, "{what} {margin:.2e} at ({x:.3}, {y:.3}, {z:.3}) mm")
    }
}

impl GrinReport {
    pub(super) fn new(
        runner: &GrinOptimizer,
        cost: &GrinCostSummary,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        let (task, best) = (runner.task(), runner.best());
        let FieldScore { loss, views } = runner.score(best)?;
        let view = |(view, result): (&grin_design::LightView, &ViewResult)| ViewSummary {
            name: view.name.clone(),
            weight: view.weight,
            spot: result.spot,
            quality_db: result.psnr,
            rays: result.counts.total(),
            excluded: result.counts.excluded().collect(),
            retrace_error: result.retrace_error,
        };
        let error = task.difference(best)?;
        let extremes = task.extremes(best);
        let (integrator, step) = runner.tracing();
        Ok(Self {
            name: task.name.clone(),
            stopped: cost.end != GrinEnd::Finished,
            end: cost.end,
            loss_unit: loss_unit(&task.views),
            loss,
            views: task.views.iter().zip(&views).map(view).collect(),
            error,
            lines: None,
            index: [extremes.low, extremes.high],
            slope: extremes.slope,
            limits: task.limit_checks(&extremes).into_iter().map(LimitReport::from).collect(),
            nodes: best.nodes(),
            parameters: best.index_field().parameters().len(),
            steps: runner.steps(),
            rays: runner.rays_traced(),
            integrator: integrator.name(),
            step,
            ms: cost.ms,
            processor_ms: cost.processor_ms,
            memory: cost.memory,
            images: Vec::new(),
            files: Vec::new(),
            field: None,
            stale: Vec::new(),
        })
    }
}

impl Display for GrinReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, steps, rays, ms, .. } = self;
        let end = self.end.words();
        writeln!(
            f,
            "{name}: {steps} steps, {rays} rays forward and back, {:.2} s{end}",
            1e-3 * ms
        )?;
        let Self { nodes, parameters, integrator, step, .. } = self;
        writeln!(f, "{nodes} nodes, {parameters} numbers; {integrator}, step {step:.4} mm")?;
        let [low, high] = self.index.map(|index| format!("{index:.6}"));
        writeln!(f, "index {low} to {high}, slope at most {:.4} / mm", self.slope)?;
        self.limits.iter().try_for_each(|limit| writeln!(f, "{limit}"))?;
        self.error.iter().try_for_each(|error| write_error(error, f))?;
        self.lines.iter().try_for_each(|lines| write!(f, "{lines}"))?;
        if let Some(MemoryUse { before_mb, peak_mb }) = &self.memory {
            write!(f, "memory {:.1} MB more than the {before_mb:.1} before", peak_mb - before_mb)?;
        }
        match self.processor_ms {
            Some(ms) => writeln!(f, "; processor time {:.2} s, all threads", 1e-3 * ms)?,
            None => writeln!(f)?,
        }
        writeln!(f, "loss {:.4e}{}\n", self.loss, self.loss_unit)?;
        let result = result_head(&self.views);
        let mut table = TextTable::new(&["view", "weight", result, "rays", "excluded"]);
        for view in &self.views {
            let lost = view.excluded.iter().map(|(reason, count)| format!("{count} {reason}"));
            let lost: Vec<String> = lost.collect();
            table.row([
                view.name.clone(),
                ShortNumber(view.weight).to_string(),
                match view.quality_db {
                    Some(quality) => format!("{quality:.1} dB"),
                    None if result == SPOTS => format!("{:.3e}", view.spot),
                    None => format!("{:.3e} mm", view.spot),
                },
                view.rays.to_string(),
                if lost.is_empty() { "none".to_owned() } else { lost.join(", ") },
            ]);
        }
        write!(f, "{table}")?;
        self.images.iter().try_for_each(|image| writeln!(f, "image {}: {image}", image.view))?;
        self.files.iter().try_for_each(|file| writeln!(f, "written: {}", file.display()))?;
        let Some(field) = &self.field else { return Ok(()) };
        let json = files::json::pretty(field);
        writeln!(f, "the field could not be saved; these are its values, x fastest:\n\n{json}")
    }
}

/// The unit of the loss of some views, as it follows the number: that of images has none.
pub(super) fn loss_unit(views: &[grin_design::LightView]) -> &'static str {
    let counted = views.iter().filter(|view| view.weight > 0.0);
    let (images, spots): (Vec<_>, Vec<_>) = counted.partition(|view| view.goal.is_image());
    match (images.is_empty(), spots.is_empty()) {
        (true, _) => " mm^2",
        (false, true) => ", mean squared difference of images",
        (false, false) => ", mm^2 of spots and the mean squared difference of images",
    }
}

/// The head of the results of spots alone.
const SPOTS: &str = "rms spot, mm";

/// The head of the column of results.
fn result_head(views: &[ViewSummary]) -> &'static str {
    let images = views.iter().filter(|view| view.quality_db.is_some()).count();
    match images {
        0 => SPOTS,
        _ if images == views.len() => "image quality (PSNR)",
        _ => "rms spot or PSNR",
    }
}

/// Writes the error of the field relative to the exact one.
fn write_error(error: &FieldDifference, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let FieldDifference { relative, without_offset, offset, relative_to_contrast } = error;
    write!(f, "relative error from the exact field {relative:.2e}; {without_offset:.2e} ")?;
    writeln!(f, "without the offset of {offset:.1e} in the square of the index")?;
    if !relative_to_contrast.is_finite() {
        return writeln!(f, "the exact field is the one at the start: nothing to find");
    }
    let part = format!("{relative_to_contrast:.4} of the difference");
    writeln!(f, "which is {part} between the exact field and the start")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_has_the_unit_of_its_views() {
        let unit = |name: &str| {
            let task = grin_design::find_builtin(name).unwrap().task().unwrap();
            loss_unit(&task.views)
        };
        assert_eq!(unit("luneburg"), " mm^2");
        assert_eq!(unit("display"), ", mean squared difference of images");
    }

    #[test]
    fn a_search_that_ended_by_itself_was_not_stopped() {
        let words =
            [GrinEnd::Finished, GrinEnd::IterationLimit, GrinEnd::TimeLimit].map(GrinEnd::words);
        assert_eq!(words, ["", ", iteration limit reached", ", time limit reached"]);
        assert_eq!(GrinEnd::Stopped.words(), ", stopped");
    }
}
