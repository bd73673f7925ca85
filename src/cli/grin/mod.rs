//! `grin`: design of a gradient-index field for a task.

mod report;
mod straight_rays;

use super::error::CliError;
use super::experiment::create_folder;
use super::input::{check_output_file, read_json};
use super::output::Output;
use super::output_paths::check_distinct;
use super::progress::{progress_bar, stop_flag};

use crate::files;
use crate::grin_design::{self, GrinField, GrinOptimizer, GrinTask};
use crate::measure::{Stopwatch, peak_megabytes, processor_ms};
use crate::report::{plot_grin_field, plot_grin_image};
use report::{GrinCostSummary, GrinReport};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
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

impl GrinArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let Some(name) = &self.task else { return output.print(&TaskList) };
        let task = load_task(name)?;
        if self.show {
            return output.print(&TaskFile(task));
        }
        self.out.iter().try_for_each(|path| check_output_file(path, &["npz", "json"]))?;
        self.png.iter().try_for_each(|folder| create_folder(folder))?;
        let out = self.out.as_deref().map(|path| ("--out", path));
        check_distinct(&[out], std::iter::once(("the task itself", Path::new(name))))?;
        self.check()?;
        let refuse = |error| CliError::Input(format!("{}: {error}", source_name(name)));
        let lines =
            self.lines.then(|| StraightRaySolver::new(source_name(name), &task)).transpose()?;
        let mut runner = GrinOptimizer::new(&task).map_err(refuse)?;
        let (clock, before) = (Stopwatch::start(), processor_ms());
        let mut worked = Ok(true);
        let memory = peak_megabytes(|| worked = self.search(&mut runner, clock));
        let stopped =
            !worked.map_err(|error| CliError::Failed(format!("{}: {error}", source_name(name))))?;
        let ms = 1e3 * clock.seconds();
        let processor_ms = processor_ms().zip(before).map(|(now, before)| now - before);
        let mut report =
            GrinReport::new(&runner, &GrinCostSummary { ms, processor_ms, memory, stopped })
                .map_err(|error| CliError::Failed(format!("{}: {error}", source_name(name))))?;
        let nodes = runner.best().nodes();
        report.lines =
            lines.map(|lines| lines.solve(source_name(name), &task, nodes)).transpose()?;
        report.files = self.write(&task, runner.best())?;
        output.print(&report)
    }

    /// Writes volume and images; returns the paths.
    fn write(&self, task: &GrinTask, best: &GrinField) -> Result<Vec<String>, CliError> {
        let failed = |error: &dyn std::error::Error| CliError::Failed(error.to_string());
        let mut written = Vec::new();
        if let Some(path) = &self.out {
            let volume = task.volume(best, self.nodes).map_err(|error| failed(&error))?;
            let files = files::write_volume(path, &volume)?;
            written.extend(files.iter().map(|file| file.display().to_string()));
        }
        if let Some(folder) = &self.png {
            for picture in plot_grin_field(task, best) {
                let path = folder.join(format!("{}.png", picture.name));
                files::write_atomic(&path, &picture.canvas.png().map_err(|error| failed(&error))?)?;
                written.push(path.display().to_string());
            }
            let seen = task.report_views(best).map_err(|error| failed(&error))?;
            for (i, (view, seen)) in task.views.iter().zip(&seen).enumerate() {
                let Some(image) = &seen.image else { continue };
                let canvas = plot_grin_image(&view.name, image, seen.result.psnr.unwrap_or(0.0));
                let path = folder.join(format!("view-{}.png", i + 1));
                files::write_atomic(&path, &canvas.png().map_err(|error| failed(&error))?)?;
                written.push(path.display().to_string());
            }
        }
        Ok(written)
    }

    fn check(&self) -> Result<(), CliError> {
        if self.minutes.is_some_and(|minutes| !(minutes > 0.0)) {
            return Err(CliError::Input("--minutes: expected more than 0".into()));
        }
        if !(2..=513).contains(&self.nodes) {
            let text = format!("--nodes: found {}; expected 2 to 513", self.nodes);
            return Err(CliError::Input(text));
        }
        Ok(())
    }

    /// Steps until convergence, Ctrl-C or a maximum; true for convergence.
    fn search(
        &self,
        runner: &mut GrinOptimizer,
        clock: Stopwatch,
    ) -> Result<bool, grin_design::GrinTaskError> {
        let stop = stop_flag();
        let bar = progress_bar(0);
        let most = self.iterations.unwrap_or(usize::MAX);
        let late = |minutes: f64| clock.seconds() >= 60.0 * minutes;
        loop {
            let over = stop.load(Ordering::Relaxed) || self.minutes.is_some_and(late);
            if over || runner.steps() >= most {
                runner.finish()?;
                bar.finish_and_clear();
                return Ok(false);
            }
            let progress = runner.step()?;
            bar.set_length(progress.max_steps as u64);
            bar.set_position(progress.step as u64);
            bar.set_message(format!("{} nodes, loss {:.2e} mm^2", progress.nodes, progress.loss));
            if progress.finished {
                bar.finish_and_clear();
                return Ok(true);
            }
        }
    }
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
