//! `grin`: design of a gradient-index field for a task.

mod report;
mod straight_rays;

use super::error::CliError;
use super::failures::Failures;
use super::input::read_json;
use super::output::{Output, print_note};
use super::output_paths::{OutputPaths, stale_note};
use super::progress::{progress_bar, stop_flag};

use crate::files::{self, Volume};
use crate::grin_design::{self, GrinField, GrinOptimizer, GrinTask};
use crate::measure::{Stopwatch, peak_megabytes, processor_ms};
use crate::picture::{ProjectedView, ProjectionSettings};
use crate::plot::Canvas;
use crate::report::{plot_grin_field, plot_grin_image};
use report::{GrinCostSummary, GrinEnd, GrinReport, ImageReport, UnsavedField, loss_unit};
use serde::Serialize;
use std::fmt::{self, Display};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use straight_rays::StraightRaySolver;

/// Designs a field of refractive index for the light of a task; Ctrl-C ends the search and writes the
/// best field
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/grin.txt"))]
pub(super) struct GrinArgs {
    /// The task: the name of a built-in one, or a file .json; absent: lists the names
    #[arg(value_name = "TASK")]
    task: Option<String>,

    /// Writes the best field: .npz for Python, or .json with the numbers beside it in .raw
    #[arg(long, value_name = "FILE", requires = "task")]
    out: Option<PathBuf>,

    /// Writes images of the best field into this folder
    #[arg(long, value_name = "FOLDER", requires = "task")]
    png: Option<PathBuf>,

    /// Nodes along a side of the written volume, if the field is a spline in one coordinate
    #[arg(long, value_name = "N", default_value_t = 65)]
    nodes: usize,

    /// Maximum number of steps over all levels
    #[arg(long, value_name = "N")]
    iterations: Option<usize>,

    /// Maximum duration in minutes
    #[arg(long, value_name = "M")]
    minutes: Option<f64>,

    /// Also reconstructs the field with straight rays, for tasks with measured light
    #[arg(long, requires = "task")]
    lines: bool,

    /// Prints the task as a file to begin with, and does nothing else
    #[arg(long, requires = "task")]
    show: bool,
}

/// The largest number of rays of an image once the search was stopped: who presses Ctrl-C waits for no accuracy.
const FEW_RAYS: usize = 1 << 18;

impl GrinArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let Some(name) = &self.task else { return output.print(&TaskList) };
        let task = load_task(name)?;
        if self.show {
            return output.print(&TaskFile(task));
        }
        self.check()?;
        self.check_paths(name, &task)?;
        let refuse = |error| CliError::Input(format!("{}: {error}", source_name(name)));
        let lines =
            self.lines.then(|| StraightRaySolver::new(source_name(name), &task)).transpose()?;
        let mut runner = GrinOptimizer::new(&task).map_err(refuse)?;
        let (clock, before) = (Stopwatch::start(), processor_ms());
        let mut worked = Ok(GrinEnd::Finished);
        let stop = stop_flag();
        let memory = peak_megabytes(|| worked = self.search(&mut runner, clock, &stop));
        let end =
            worked.map_err(|error| CliError::Failed(format!("{}: {error}", source_name(name))))?;
        let ms = 1e3 * clock.seconds();
        let processor_ms = processor_ms().zip(before).map(|(now, before)| now - before);
        // The field is saved before anything else is computed from it.
        let mut failures = Failures::default();
        let (volume, unsaved) = self.write_or_keep(&task, runner.best(), &mut failures);
        let (mut images, mut shown) = (Vec::new(), Vec::new());
        let files = (&mut images, &mut shown);
        let is_stopped = stop.load(Ordering::Relaxed);
        failures.note(self.write_images(&task, runner.best(), is_stopped, files));
        let mut report =
            GrinReport::new(&runner, &GrinCostSummary { ms, processor_ms, memory, end })
                .map_err(|error| CliError::Failed(format!("{}: {error}", source_name(name))))?;
        let nodes = runner.best().nodes();
        report.field = unsaved.map(UnsavedField::from);
        report.images = shown;
        let lines = lines.map(|lines| lines.solve(source_name(name), &task, nodes, &stop));
        report.lines = lines.and_then(|lines| failures.note(lines)).flatten();
        if let Some(folder) = &self.png {
            report.stale = files::stale_files(folder, &images, is_image_name);
            stale_note(&report.stale).iter().for_each(|note| print_note(format!("note: {note}")));
        }
        report.files = volume.into_iter().chain(images).collect();
        failures.note(output.print(&report));
        failures.into_result()
    }

    /// Refuses to write over the files of the task.
    fn check_paths(&self, name: &str, task: &GrinTask) -> Result<(), CliError> {
        let inputs = task_inputs(name, task);
        let mut paths = OutputPaths::reading(inputs.iter().map(|(name, path)| (*name, &**path)));
        let out = self.out.as_deref();
        paths.file("--out", out, &["npz", "json"])?;
        if let Some(header) = out.filter(|path| !files::is_npz(path)) {
            paths.take("the numbers of --out", &files::raw_path(header))?;
        }
        paths.folder("--png", self.png.as_deref(), is_image_name)
    }

    /// Writes the volume; returns the paths, and the volume if it could not be saved.
    fn write_or_keep(
        &self,
        task: &GrinTask,
        best: &GrinField,
        failures: &mut Failures,
    ) -> (Vec<PathBuf>, Option<Volume>) {
        let Some(path) = &self.out else { return (Vec::new(), None) };
        let volume = task.volume(best, self.nodes).map_err(|error| failed(&error));
        let Some(volume) = failures.note(volume) else { return (Vec::new(), None) };
        match failures.note(files::write_volume(path, &volume)) {
            Some(paths) => (paths, None),
            None => (Vec::new(), Some(volume)),
        }
    }

    /// Writes the images until one fails, those of light by fewer rays after a search that was stopped; adds the
    /// paths to `written`, and the numbers of the images of light to `shown`.
    fn write_images(
        &self,
        task: &GrinTask,
        best: &GrinField,
        is_stopped: bool,
        (written, shown): (&mut Vec<PathBuf>, &mut Vec<ImageReport>),
    ) -> Result<(), CliError> {
        let Some(folder) = &self.png else { return Ok(()) };
        let mut write = |name: String, canvas: &Canvas| -> Result<(), CliError> {
            let path = folder.join(name);
            files::write_atomic(&path, &canvas.png().map_err(|error| failed(&error))?)?;
            written.push(path);
            Ok(())
        };
        for picture in plot_grin_field(task, best) {
            write(format!("{}.png", picture.name), &picture.canvas)?;
        }
        let lights = task.image_light(best).map_err(|error| failed(&error))?;
        for (i, (view, light)) in task.views.iter().zip(lights).enumerate() {
            let Some(light) = light else { continue };
            let clock = Stopwatch::start();
            let default = ProjectionSettings::default();
            let max_rays = if is_stopped { FEW_RAYS } else { default.max_rays };
            let settings = ProjectionSettings { max_rays, ..default };
            let mut go_on = |_| ControlFlow::Continue(());
            let seen = ProjectedView::new(best, light, &settings, &mut go_on);
            let seen = seen.map_err(|error| failed(&error))?;
            let report = ImageReport::new(&view.name, &seen, 1e3 * clock.seconds());
            let canvas = plot_grin_image(&view.name, &seen.image, &seen.summary());
            write(format!("view-{}.png", i + 1), &canvas)?;
            shown.push(report);
        }
        Ok(())
    }

    fn check(&self) -> Result<(), CliError> {
        if self.minutes.is_some_and(|minutes| !(minutes > 0.0)) {
            return Err(CliError::Input("--minutes: expected more than 0".into()));
        }
        if self.iterations == Some(0) {
            return Err(CliError::Input("--iterations: found 0; expected 1 or more".into()));
        }
        if !(2..=513).contains(&self.nodes) {
            let text = format!("--nodes: found {}; expected 2 to 513", self.nodes);
            return Err(CliError::Input(text));
        }
        Ok(())
    }

    /// Steps until convergence, Ctrl-C or a maximum.
    fn search(
        &self,
        runner: &mut GrinOptimizer,
        clock: Stopwatch,
        stop: &AtomicBool,
    ) -> Result<GrinEnd, grin_design::GrinTaskError> {
        let unit = loss_unit(&runner.task().views);
        let bar = progress_bar(0);
        let most = self.iterations.unwrap_or(usize::MAX);
        let late = |minutes: f64| clock.seconds() >= 60.0 * minutes;
        loop {
            let limits = [
                (stop.load(Ordering::Relaxed), GrinEnd::Stopped),
                (self.minutes.is_some_and(late), GrinEnd::TimeLimit),
                (runner.steps() >= most, GrinEnd::IterationLimit),
            ];
            if let Some((_, end)) = limits.into_iter().find(|(is_over, _)| *is_over) {
                runner.finish()?;
                bar.finish_and_clear();
                return Ok(end);
            }
            let progress = runner.step()?;
            bar.set_length(progress.max_steps as u64);
            bar.set_position(progress.step as u64);
            bar.set_message(format!("{} nodes, loss {:.2e}{unit}", progress.nodes, progress.loss));
            if progress.finished {
                bar.finish_and_clear();
                return Ok(GrinEnd::Finished);
            }
        }
    }
}

/// True for the name of an image that the command writes.
fn is_image_name(name: &str) -> bool {
    let Some(stem) = name.strip_suffix(".png") else { return false };
    stem.starts_with("view-") || ["profile", "section"].contains(&stem)
}

fn failed(error: &dyn std::error::Error) -> CliError {
    CliError::Failed(error.to_string())
}

/// The files that a task is read from, each with the name that messages use.
pub(super) fn task_inputs(name: &str, task: &GrinTask) -> Vec<(&'static str, PathBuf)> {
    let named = task.files().into_iter().map(|path| ("a file of the task", path));
    std::iter::once(("the task itself", PathBuf::from(name))).chain(named).collect()
}

/// Loads a task by its name or from a file.
pub(super) fn load_task(name: &str) -> Result<GrinTask, CliError> {
    let task = match grin_design::find_builtin(name) {
        Some(builtin) => builtin.task()?,
        None if Path::new(name).extension().is_some_and(|e| e == "json") || name == "-" => {
            read_json(Path::new(name))?
        }
        None => {
            let names: Vec<&str> =
                grin_design::BUILTIN_TASKS.iter().map(|task| task.name).collect();
            let names = names.join(", ");
            return Err(CliError::Input(format!(
                "no task `{name}`; expected a file .json, or one of {names}"
            )));
        }
    };
    let checked = task.check().and_then(|()| task.read_files());
    checked.map_err(|error| CliError::Input(format!("{}: {error}", source_name(name))))?;
    Ok(task)
}

/// The name of the source of a task in messages.
fn source_name(name: &str) -> &str {
    if name == "-" { "standard input" } else { name }
}

/// The list of built-in tasks.
struct TaskList;

#[derive(Serialize)]
struct TaskEntry {
    name: &'static str,
    title: String,
    notes: String,
}

fn task_entries() -> impl Iterator<Item = TaskEntry> {
    grin_design::BUILTIN_TASKS.iter().filter_map(|builtin| {
        let GrinTask { name: title, notes, .. } = builtin.task().ok()?;
        Some(TaskEntry { name: builtin.name, title, notes })
    })
}

impl Serialize for TaskList {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(task_entries())
    }
}

impl Display for TaskList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for TaskEntry { name, title, notes } in task_entries() {
            writeln!(f, "{name:<16} {title}\n{:16} {notes}", "")?;
        }
        Ok(())
    }
}

/// A task, printed as its file.
#[derive(Serialize)]
#[serde(transparent)]
struct TaskFile(GrinTask);

impl Display for TaskFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&files::json::pretty(&self.0))
    }
}
