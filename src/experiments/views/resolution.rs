//! Figure 5.5: what the resolution of a field brings, on trilinear grids and with tricubic splines.
//!
//! The gradient of a trilinear field jumps at the faces of its voxels. A Hessian without these jumps
//! is the exact derivative of what is computed and not of what light does: where the field is fine
//! and rough it leads the search astray, and the smoothed one is better. A spline has no jumps.

use super::pictures::{row, shades};
use super::{builtin, look, small, work};
use crate::experiments::{
    Claim, Effort, Ended, Experiment, Outcome, Picture, Table, Watch, report,
};
use crate::grin_task::{FieldKind, Image, Runner, Seen, Task};
use crate::picture::{Align, Axis, BLACK, Canvas, Chart, PALETTE, Stroke};

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "5.5",
    title: "Effect of the resolution of a field",
    claim: "The finer the field, the nearer its image is to the picture",
    seconds: 40.0,
    run,
};

/// How a field is made up.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// With the Hessian between the nodes alone.
    Exact,
    /// With its jumps, smoothed.
    Smoothed,
    Tricubic,
}

const KINDS: [Kind; 3] = [Kind::Exact, Kind::Smoothed, Kind::Tricubic];

/// By how much the next resolution is better at least, in dB.
const GAIN: f64 = 0.5;
/// By how much the tricubic field is better at the finest one, in dB, in full and as a test.
const SMOOTHER: [f64; 2] = [5.0, 2.0];

/// By how much the smoothed Hessian is better at the finest resolution, in dB; on a coarse grid both
/// differ by less.
const SMOOTHED: f64 = 0.1;

impl Kind {
    const fn name(self) -> &'static str {
        match self {
            Self::Exact => "trilinear, exact",
            Self::Smoothed => "trilinear, smoothed",
            Self::Tricubic => "tricubic",
        }
    }

    fn field(self, half: f64) -> FieldKind {
        match self {
            Self::Tricubic => FieldKind::Tricubic { half },
            Self::Exact | Self::Smoothed => FieldKind::Trilinear { half },
        }
    }
}

/// A field of one kind and resolution.
struct Row {
    kind: Kind,
    runner: Runner,
    seen: Seen,
}

impl Row {
    fn nodes(&self) -> usize {
        self.runner.current().nodes()
    }

    fn quality(&self) -> f64 {
        self.seen.result.quality.unwrap_or(f64::NAN)
    }

    fn image(&self) -> Option<&Image> {
        self.seen.image.as_ref()
    }
}

fn run(effort: Effort, watch: &mut Watch<'_>) -> Result<Outcome, Ended> {
    let full = builtin("display")?;
    let task = if effort == Effort::Full { full } else { small(full, 2) };
    let count = KINDS.len() * task.levels.len();
    let mut rows = Vec::new();
    for kind in KINDS {
        for levels in 1..=task.levels.len() {
            let part = [0, 1].map(|i| (rows.len() + i) as f64 / count as f64);
            rows.push(find(&task, kind, levels, part, watch)?);
        }
    }
    let mut outcome = Outcome { claims: claims(&rows, effort), ..Outcome::default() };
    outcome.rays = rows.iter().map(|row| row.runner.rays() as usize).sum();
    outcome.tables.push(table(&rows));
    outcome.pictures.push(Picture { name: "quality", canvas: chart(&rows) });
    outcome.pictures.push(Picture { name: "images", canvas: images(&rows) });
    Ok(outcome)
}

/// The field of the first levels of a task, with one of its views.
fn find(
    task: &Task,
    kind: Kind,
    levels: usize,
    part: [f64; 2],
    watch: &mut Watch<'_>,
) -> Result<Row, Ended> {
    let mut task = task.clone();
    task.views.truncate(1);
    task.levels.truncate(levels);
    task.field = kind.field(task.space.corners()[1].x);
    let nodes = task.levels[levels - 1].nodes;
    task.name = format!("{}, {nodes} nodes", kind.name());
    report(watch, part[0], &task.name)?;
    let runner = Runner::new(&task).map_err(Ended::from_error)?;
    let runner = if kind == Kind::Exact { runner.with_exact_hessian() } else { runner };
    let runner = work(runner, part, watch)?;
    let seen = look(&task, runner.current())?;
    let first = seen.into_iter().next();
    let seen = first.ok_or_else(|| Ended::Failed("a task without views".to_owned()))?;
    Ok(Row { kind, runner, seen })
}

fn of(rows: &[Row], kind: Kind) -> Vec<&Row> {
    rows.iter().filter(|row| row.kind == kind).collect()
}

fn claims(rows: &[Row], effort: Effort) -> Vec<Claim> {
    let mut claims = Vec::new();
    for kind in KINDS {
        for pair in of(rows, kind).windows(2) {
            let name = kind.name();
            let says =
                format!("{name}: gain from {} to {} nodes", pair[0].nodes(), pair[1].nodes());
            let gain = pair[1].quality() - pair[0].quality();
            claims.push(Claim::at_least(says, gain, GAIN).in_unit("dB"));
        }
    }
    let last = |kind: Kind| of(rows, kind).last().map_or(f64::NAN, |row| row.quality());
    let [exact, smoothed, tricubic] = KINDS.map(last);
    let nodes = rows.last().map_or(0, Row::nodes);
    let [far, near] = SMOOTHER;
    let says = format!("gain of tricubic splines over trilinear grids, {nodes} nodes");
    let gain = Claim::at_least(says, tricubic - smoothed, effort.pick(far, near));
    claims.push(gain.in_unit("dB"));
    let says = format!("gain of the smoothed Hessian over the exact one, {nodes} nodes");
    let gain = Claim::at_least(says, smoothed - exact, effort.pick(SMOOTHED, -SMOOTHED));
    claims.push(gain.in_unit("dB"));
    claims
}

fn table(rows: &[Row]) -> Table {
    let columns = ["field", "nodes", "numbers", "quality_db", "correlation", "steps", "rays"];
    let mut table = Table::new("resolutions", &columns);
    for row in rows {
        table.row([
            row.kind.name().into(),
            row.nodes().into(),
            row.runner.current().field().parameters().len().into(),
            row.quality().into(),
            row.image().map_or(f64::NAN, Image::correlation).into(),
            row.runner.steps().into(),
            (row.runner.rays() as usize).into(),
        ]);
    }
    table
}

fn chart(rows: &[Row]) -> Canvas {
    let place = |row: &Row| [row.nodes() as f64, row.quality()];
    let mut canvas = Canvas::new([1400, 760]);
    let x = Axis::linear("nodes along a side", rows.iter().map(|row| place(row)[0]));
    let y = Axis::linear("peak signal to noise, dB", rows.iter().map(|row| place(row)[1]));
    let chart = Chart::new([120.0, 110.0], [940.0, 660.0], x, y);
    chart.draw(&mut canvas, "quality by resolution");
    for (i, kind) in KINDS.into_iter().enumerate() {
        let points: Vec<[f64; 2]> = of(rows, kind).into_iter().map(place).collect();
        canvas.curve(&chart.places(&points), PALETTE[i], Stroke::Solid);
        canvas.marks(&chart.places(&points), PALETTE[i]);
        let y = 140.0 + 34.0 * i as f64;
        canvas.curve(&[[980.0, y], [1030.0, y]], PALETTE[i], Stroke::Solid);
        canvas.text([1044.0, y - 7.0], kind.name(), BLACK, Align::Left);
    }
    canvas
}

/// The images of the tricubic fields, and the picture that is wanted.
fn images(rows: &[Row]) -> Canvas {
    let rows = of(rows, Kind::Tricubic);
    let all: Vec<(&Row, &Image)> =
        rows.into_iter().filter_map(|row| Some((row, row.image()?))).collect();
    let Some((_, first)) = all.first() else { return Canvas::new([640, 480]) };
    let peak = first.wanted.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let panel = |(row, image): &(&Row, &Image)| {
        let title = format!("{} nodes, {:.1} dB", row.nodes(), row.quality());
        (title, shades(&image.made, image.pixels, peak))
    };
    let mut panels: Vec<_> = all.iter().map(panel).collect();
    panels.push(("wanted".to_owned(), shades(&first.wanted, first.pixels, peak)));
    row("tricubic fields", first.pixels, &panels)
}
