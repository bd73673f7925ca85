//! A design task in a gradient-index field.

use super::experiment::check_folder;
use super::failure::Failure;
use super::grin_lines::{Found, Lines};
use super::input::{check_target, read_json};
use super::optimize::{progress_bar, stop_flag};
use super::output::{Number, Output, Table};
use crate::experiments::{medium_pictures, view_picture};
use crate::files;
use crate::grin_task::{self, Judgement, Kept, Medium, Runner, Task, ViewResult};
use crate::measure::{Memory, Stopwatch, peak_megabytes, processor_ms};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::{self, Display};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Finds the field of refractive index that sends light where a task wants it; Ctrl-C ends the
/// search and writes the best field
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/grin.txt"))]
pub(super) struct Grin {
    /// The task: a name that comes with the program, or a file .json; a list of names where it is
    /// absent
    #[arg(value_name = "TASK")]
    task: Option<String>,

    /// Writes the best field: .npz for Python, or .json with the numbers beside it in .raw
    #[arg(long, value_name = "FILE", requires = "task")]
    out: Option<PathBuf>,

    /// Draws the best field into this folder
    #[arg(long, value_name = "FOLDER", requires = "task")]
    png: Option<PathBuf>,

    /// Nodes along a side of the written volume, where the field is a spline in one coordinate
    #[arg(long, value_name = "N", default_value_t = 65)]
    nodes: usize,

    /// No more steps than this, all levels together
    #[arg(long, value_name = "N")]
    iterations: Option<usize>,

    /// No longer than this
    #[arg(long, value_name = "M")]
    minutes: Option<f64>,

    /// Also solves for the field by straight lines, for comparison, where the light was measured
    #[arg(long, requires = "task")]
    lines: bool,

    /// Prints the task itself, as a file to begin with, and does nothing
    #[arg(long, requires = "task")]
    show: bool,
}

/// Refuses to write the volume over the task.
fn keep_task(task: &Path, out: &Path) -> Result<(), Failure> {
    let places = [task, out].map(fs::canonicalize);
    let same = matches!(places, [Ok(task), Ok(out)] if task == out);
    if !same {
        return Ok(());
    }
    let path = out.display();
    Err(Failure::Input(format!("--out {path} is the task itself; expected another file")))
}

impl Grin {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        let Some(name) = &self.task else { return output.print(&List) };
        let task = task_of(name)?;
        if self.show {
            return output.print(&Shown(task));
        }
        self.out.iter().try_for_each(|path| check_target(path, &["npz", "json"]))?;
        self.png.iter().try_for_each(|folder| check_folder(folder))?;
        self.out.iter().try_for_each(|path| keep_task(Path::new(name), path))?;
        self.check()?;
        let refuse = |error| Failure::Input(format!("{}: {error}", file(name)));
        let lines = self.lines.then(|| Lines::new(name, &task)).transpose()?;
        let mut runner = Runner::new(&task).map_err(refuse)?;
        let (clock, before) = (Stopwatch::start(), processor_ms());
        let mut worked = Ok(true);
        let memory = peak_megabytes(|| worked = self.search(&mut runner, clock));
        let stopped = !worked.map_err(|error| Failure::Failed(format!("{name}: {error}")))?;
        let ms = 1e3 * clock.seconds();
        let processor_ms = processor_ms().zip(before).map(|(now, before)| now - before);
        let mut report = Report::new(&runner, &Cost { ms, processor_ms, memory, stopped })
            .map_err(|error| Failure::Failed(format!("{name}: {error}")))?;
        let nodes = runner.best().nodes();
        report.lines = lines.map(|lines| lines.found(name, &task, nodes)).transpose()?;
        report.files = self.write(&task, runner.best())?;
        output.print(&report)
    }

    /// Writes what is asked for.
    fn write(&self, task: &Task, best: &Medium) -> Result<Vec<String>, Failure> {
        let failed = |error: &dyn std::error::Error| Failure::Failed(error.to_string());
        let mut written = Vec::new();
        if let Some(path) = &self.out {
            let volume = task.volume(best, self.nodes).map_err(|error| failed(&error))?;
            let files = files::write_volume(path, &volume)?;
            written.extend(files.iter().map(|file| file.display().to_string()));
        }
        if let Some(folder) = &self.png {
            for picture in medium_pictures(task, best) {
                let path = folder.join(format!("{}.png", picture.name));
                files::replace(&path, &picture.canvas.png().map_err(|error| failed(&error))?)?;
                written.push(path.display().to_string());
            }
            let seen = task.seen(best).map_err(|error| failed(&error))?;
            for (i, (view, seen)) in task.views.iter().zip(&seen).enumerate() {
                let Some(image) = &seen.image else { continue };
                let canvas = view_picture(&view.name, image, seen.result.quality.unwrap_or(0.0));
                let path = folder.join(format!("view-{}.png", i + 1));
                files::replace(&path, &canvas.png().map_err(|error| failed(&error))?)?;
                written.push(path.display().to_string());
            }
        }
        Ok(written)
    }

    fn check(&self) -> Result<(), Failure> {
        if self.minutes.is_some_and(|minutes| !(minutes > 0.0)) {
            return Err(Failure::Input("--minutes: expected more than 0".into()));
        }
        if !(2..=513).contains(&self.nodes) {
            let text = format!("--nodes: found {}; expected 2 to 513", self.nodes);
            return Err(Failure::Input(text));
        }
        Ok(())
    }

    /// Steps until the end, or until it is stopped; whether it came to its end.
    fn search(&self, runner: &mut Runner, clock: Stopwatch) -> Result<bool, grin_task::TaskError> {
        let stop = stop_flag();
        let bar = progress_bar(0);
        let most = self.iterations.unwrap_or(usize::MAX);
        let late = |minutes: f64| clock.seconds() >= 60.0 * minutes;
        loop {
            let over = stop.load(Ordering::Relaxed) || self.minutes.is_some_and(late);
            if over || runner.steps() >= most {
                runner.settle()?;
                bar.finish_and_clear();
                return Ok(false);
            }
            let progress = runner.step()?;
            bar.set_length(progress.most as u64);
            bar.set_position(progress.step as u64);
            bar.set_message(format!("{} nodes, loss {:.2e} mm^2", progress.nodes, progress.loss));
            if progress.finished {
                bar.finish_and_clear();
                return Ok(true);
            }
        }
    }
}

/// A task by its name or from a file.
pub(super) fn task_of(name: &str) -> Result<Task, Failure> {
    let task = match grin_task::find(name) {
        Some(builtin) => builtin.task()?,
        None if Path::new(name).extension().is_some_and(|e| e == "json") || name == "-" => {
            read_json(Path::new(name))?
        }
        None => {
            let names: Vec<&str> = grin_task::BUILTIN.iter().map(|task| task.name).collect();
            let names = names.join(", ");
            return Err(Failure::Input(format!(
                "no task `{name}`; expected a file .json, or one of {names}"
            )));
        }
    };
    task.check().map_err(|error| Failure::Input(format!("{}: {error}", file(name))))?;
    Ok(task)
}

/// Where a task comes from, for a message.
fn file(name: &str) -> &str {
    if name == "-" { "standard input" } else { name }
}

/// The tasks that come with the program.
struct List;

#[derive(Serialize)]
struct Entry {
    name: &'static str,
    title: String,
    notes: String,
}

fn entries() -> impl Iterator<Item = Entry> {
    grin_task::BUILTIN.iter().filter_map(|builtin| {
        let Task { name: title, notes, .. } = builtin.task().ok()?;
        Some(Entry { name: builtin.name, title, notes })
    })
}

impl Serialize for List {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(entries())
    }
}

impl Display for List {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for Entry { name, title, notes } in entries() {
            writeln!(f, "{name:<16} {title}\n{:16} {notes}", "")?;
        }
        Ok(())
    }
}

/// A task as its file.
#[derive(Serialize)]
#[serde(transparent)]
struct Shown(Task);

impl Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&files::native::pretty(&self.0))
    }
}

/// What a search took.
struct Cost {
    ms: f64,
    processor_ms: Option<f64>,
    memory: Option<Memory>,
    stopped: bool,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    name: String,
    stopped: bool,
    loss: f64,
    views: Vec<View>,
    error: Option<Error>,
    lines: Option<Found>,
    index: [f64; 2],
    slope: f64,
    limits: Vec<Limit>,
    nodes: usize,
    parameters: usize,
    steps: usize,
    rays: u64,
    integrator: &'static str,
    step: f64,
    ms: f64,
    processor_ms: Option<f64>,
    memory: Option<Memory>,
    files: Vec<String>,
}

/// What became of the light of a view.
#[derive(Serialize)]
struct View {
    name: String,
    weight: f64,
    spot: f64,
    quality_db: Option<f64>,
    rays: usize,
    excluded: BTreeMap<&'static str, usize>,
    retrace_error: f64,
}

#[derive(Serialize)]
struct Error {
    relative: f64,
    without_offset: f64,
    offset: f64,
    of_contrast: Option<f64>,
}

/// A limit of a maker and what the field makes of it.
#[derive(Serialize)]
struct Limit {
    name: &'static str,
    value: f64,
    limit: f64,
    margin: f64,
    kept: bool,
    at: [f64; 3],
}

impl From<Kept> for Limit {
    fn from(kept: Kept) -> Self {
        let Kept { name, value, limit, margin, at } = kept;
        Self { name, value, limit, margin, kept: kept.is_kept(), at: [at.x, at.y, at.z] }
    }
}

impl Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, value, limit, margin, at: [x, y, z], .. } = self;
        let unit = if *name == "slope" { " / mm" } else { "" };
        write!(f, "{name} {value:.6}{unit}, limit {limit}: ")?;
        let what = if self.kept { "kept, margin" } else { "broken by" };
        // What rounding takes is nothing.
        let margin = if self.kept { margin.max(0.0) } else { -margin };
        write!(f, "{what} {margin:.2e} at ({x:.3}, {y:.3}, {z:.3}) mm")
    }
}

impl Report {
    fn new(runner: &Runner, cost: &Cost) -> Result<Self, Box<dyn std::error::Error>> {
        let (task, best) = (runner.task(), runner.best());
        let Judgement { loss, views } = runner.judge(best)?;
        let view = |(view, result): (&grin_task::View, &ViewResult)| View {
            name: view.name.clone(),
            weight: view.weight,
            spot: result.spot,
            quality_db: result.quality,
            rays: result.counts.sent(),
            excluded: result.counts.excluded().collect(),
            retrace_error: result.retrace_error,
        };
        let error = task.difference(best)?.map(|difference| Error {
            relative: difference.relative,
            without_offset: difference.without_offset,
            offset: difference.offset,
            of_contrast: Some(difference.of_contrast).filter(|part| part.is_finite()),
        });
        let extremes = task.extremes(best);
        let (integrator, step) = runner.tracing();
        Ok(Self {
            name: task.name.clone(),
            stopped: cost.stopped,
            loss,
            views: task.views.iter().zip(&views).map(view).collect(),
            error,
            lines: None,
            index: [extremes.low, extremes.high],
            slope: extremes.slope,
            limits: task.kept(best).into_iter().map(Limit::from).collect(),
            nodes: best.nodes(),
            parameters: best.field().parameters().len(),
            steps: runner.steps(),
            rays: runner.rays(),
            integrator: integrator.name(),
            step,
            ms: cost.ms,
            processor_ms: cost.processor_ms,
            memory: cost.memory,
            files: Vec::new(),
        })
    }
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, steps, rays, ms, .. } = self;
        let stopped = if self.stopped { ", stopped" } else { "" };
        writeln!(f, "{name}: {steps} steps, {rays} rays and back, {:.2} s{stopped}", 1e-3 * ms)?;
        let Self { nodes, parameters, integrator, step, .. } = self;
        writeln!(f, "{nodes} nodes, {parameters} numbers; {integrator}, step {step:.4} mm")?;
        let [low, high] = self.index.map(|index| format!("{index:.6}"));
        writeln!(f, "index {low} to {high}, at most {:.4} / mm steep", self.slope)?;
        self.limits.iter().try_for_each(|limit| writeln!(f, "{limit}"))?;
        if let Some(Error { relative, without_offset, offset, of_contrast }) = &self.error {
            write!(f, "off the exact field by {relative:.2e}, relative; by {without_offset:.2e} ")?;
            writeln!(f, "without the offset of {offset:.1e} in the square of the index")?;
            match of_contrast {
                Some(part) => {
                    writeln!(
                        f,
                        "which is {part:.4} of what the exact field differs from the start"
                    )?;
                }
                None => writeln!(f, "the exact field is the one at the start: nothing to find")?,
            }
        }
        self.lines.iter().try_for_each(|lines| write!(f, "{lines}"))?;
        if let Some(Memory { before_mb, peak_mb }) = &self.memory {
            write!(f, "memory {:.1} MB more than the {before_mb:.1} before", peak_mb - before_mb)?;
        }
        match self.processor_ms {
            Some(ms) => writeln!(f, "; processor time {:.2} s, all threads", 1e-3 * ms)?,
            None => writeln!(f)?,
        }
        writeln!(f, "loss {:.4e} mm^2\n", self.loss)?;
        let mut table = Table::new(&["view", "weight", "rms spot, mm", "rays", "left out"]);
        for view in &self.views {
            let lost = view.excluded.iter().map(|(reason, count)| format!("{count} {reason}"));
            let lost: Vec<String> = lost.collect();
            table.row([
                view.name.clone(),
                Number(view.weight).to_string(),
                match view.quality_db {
                    Some(quality) => format!("{quality:.1} dB"),
                    None => format!("{:.3e}", view.spot),
                },
                view.rays.to_string(),
                if lost.is_empty() { "none".to_owned() } else { lost.join(", ") },
            ]);
        }
        write!(f, "{table}")?;
        self.files.iter().try_for_each(|file| writeln!(f, "written: {file}"))
    }
}
