//! Figure 5.7: light gathered into a ring near the field, far behind it, and in both places at once.
//!
//! Near or far alone the ring is a target image, which defines the brightness everywhere. Both at
//! once are the rings of the thesis: a ray has to pass anywhere through the one and then anywhere
//! through the other (5.36 and 5.37). That loss does not ask for even brightness, so some parts are
//! brighter than others.

use super::{
    COLUMNS, EvaluatedField, SOLVING, independent_task, part_of, sampling_claims, settings,
    solve_and_evaluate, task,
};
use crate::experiments::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentProgress,
    ExperimentResult, NamedPlot, ProgressFn, solve,
};
use crate::grin::{Face, GrinSetup, GrinTracer, RayExit, plan_tracing};
use crate::grin_design::{GrinField, GrinTask, LightGoal, SquareBeam};
use crate::math::Vec3;
use crate::picture::{LightProjection, LightScreen, ProjectedImage, ProjectionError, screen_frame};
use crate::plot::{Canvas, draw_image_row, gray_levels};
use crate::report::plot_grin_field;

pub(in crate::experiments) const EXPERIMENT: Experiment = Experiment {
    id: "5.7",
    title: "Caustics near and far",
    claim: "One beam makes a ring near the field, one far behind it, and one that keeps its shape in \
            between",
    omits: "nothing of the figure",
    seconds: 30.0,
    run,
};

/// The minimum quality in dB and the minimum correlation of a ring as an image.
const LEAST: [[f64; 2]; 2] = [[24.0, 0.97], [6.0, 0.4]];
/// The largest RMS distances of rays from their rings: in mm, and in degrees.
const MISSED: [[f64; 2]; 2] = [[0.06, 1.5], [0.2, 5.0]];
/// The largest width of the ring on any screen behind the near one, relative to its radius.
const WIDTH: [f64; 2] = [0.15, 0.4];
/// The distances of the screens behind the field in mm; that of the near ring is one of them.
const PLANES: [f64; 5] = [0.5, 1.0, 2.0, 4.0, 8.0];
/// The tolerance of the rays, in mm.
const TOLERANCE: f64 = 1e-3;
/// The number of pixels along a side of an image, and its side relative to the diameter of the ring.
const CELLS: usize = 64;
const ROOM: f64 = 1.6;

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let mut outcome = ExperimentOutcome::default();
    let mut table = DataTable::new("views", &COLUMNS);
    let [least, less] = LEAST;
    let [quality, correlation] = effort.select(least, less);
    for (i, (name, pictures)) in
        [("caustic-near", NEAR), ("caustic-far", FAR)].into_iter().enumerate()
    {
        let part = [0, 1].map(|k| (i + k) as f64 / 3.0);
        let evaluated = solve_and_evaluate(&task(name, effort, 2)?, effort, part, progress)?;
        evaluated.rows(&mut table);
        outcome.claims.extend(evaluated.claims([quality, correlation], effort));
        outcome.claims.extend(evaluated.manufacturability());
        outcome.pictures.extend(pictures_of(&evaluated, pictures));
        outcome.rays = outcome.rays.saturating_add(evaluated.rays());
    }
    outcome.tables.push(table);
    rings(&mut outcome, effort, progress)?;
    Ok(outcome)
}

const NEAR: [&str; 2] = ["near", "near-section"];
const FAR: [&str; 2] = ["far", "far-section"];

fn pictures_of(evaluated: &EvaluatedField, [image, section]: [&'static str; 2]) -> Vec<NamedPlot> {
    let mut pictures = evaluated.pictures(&[image]);
    let of_medium = plot_grin_field(evaluated.optimizer.task(), evaluated.optimizer.best());
    pictures
        .extend(of_medium.into_iter().last().map(|picture| NamedPlot { name: section, ..picture }));
    pictures
}

/// Adds the experiment with both rings at once.
fn rings(
    outcome: &mut ExperimentOutcome,
    effort: Effort,
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<()> {
    let task = task("caustic", effort, 2)?;
    let part = [2.0 / 3.0, 1.0];
    let optimizer = solve(&task, part_of(part, [0.0, SOLVING]), progress)?;
    let beam = ExitBeam::behind(&task, optimizer.best())?;
    let [full, test] = MISSED;
    let [near, far] = effort.select(full, test);
    let LightGoal::Ring { radius, distance, angle, .. } = task.views[0].goal else {
        return Err(ExperimentError::Failed("the task `caustic` has no rings".to_owned()));
    };
    let missed = rms(beam.radii(distance).iter().map(|r| r - radius));
    let says = "rings: distance from the near one";
    outcome.claims.push(Claim::at_most(says, missed, near).in_unit("mm"));
    let missed = rms(beam.angles().iter().map(|a| a - angle));
    let says = "rings: angle from the far one";
    outcome.claims.push(Claim::at_most(says, missed, far).in_unit("degrees"));
    let lost = beam.all - beam.rays.len();
    let says = "rings: excluded rays";
    outcome.claims.push(Claim::at_most(says, lost as f64, 0.0));
    let mut table = DataTable::new("planes", &["distance_mm", "radius_mm", "width_mm"]);
    for plane in PLANES {
        let (mean, width) = mean_and_deviation(&beam.radii(plane));
        table.push_row([plane.into(), mean.into(), width.into()]);
        if plane >= distance {
            let says =
                format!("rings: width on a screen {plane} mm behind, relative to the radius");
            let [wide, wider] = WIDTH;
            outcome.claims.push(Claim::at_most(says, width / mean, effort.select(wide, wider)));
        }
    }
    outcome.tables.push(table);
    let part = part_of(part, [SOLVING, 1.0]);
    let screens = beam.screens(optimizer.best(), effort, part, progress)?;
    outcome.claims.extend(screens.iter().flat_map(|screen| screen.claims(effort)));
    outcome.pictures.push(NamedPlot { name: "planes", canvas: draw(&screens) });
    let rays = usize::try_from(optimizer.rays_traced()).unwrap_or(usize::MAX);
    // The same rays light all screens.
    let rendering = screens.first().map_or(0, |screen| screen.light.rays + screen.again.rays);
    outcome.rays = outcome.rays.saturating_add(rays).saturating_add(beam.all + rendering);
    Ok(())
}

/// The light behind a field, as rays in the coordinates across the axis of the beam: exit position
/// and slope.
struct ExitBeam {
    rays: Vec<([f64; 2], [f64; 2])>,
    all: usize,
    /// The light before the field, the way it is traced onto screens, and the z at which the field ends.
    beam: SquareBeam,
    setup: GrinSetup<f64>,
    back: f64,
}

impl ExitBeam {
    /// The light of the first view, which travels along z.
    fn behind(task: &GrinTask, medium: &GrinField) -> ExperimentResult<Self> {
        let task = independent_task(task);
        let (space, rays) = task.scoring_rays(&task.views[0]);
        let plan =
            plan_tracing(medium.index_field(), &space.region(), task.launch, &rays, TOLERANCE);
        let tracer = GrinTracer::new(medium.index_field(), plan?.setup)?;
        let exits = tracer.trace_batch(&rays);
        let arrived = exits.iter().filter(|exit| exit.fate.has_arrived() && exit.v.z > 0.0);
        let back = space.corners()[1].z;
        let ray = |exit: &RayExit<f64>| {
            let v = exit.v * (1.0 / exit.v.z);
            let start = exit.x + v * (back - exit.x.z);
            ([start.x, start.y], [v.x, v.y])
        };
        let beam = task.views[0].source.beam(space);
        let beam =
            beam.ok_or_else(|| ExperimentError::Failed("rings without a beam".to_owned()))?;
        // A pixel needs no rays that are as accurate: those of a tight plan take hundreds of times as long.
        let setup = task.tracing_setups(medium)?.swap_remove(0);
        Ok(Self { rays: arrived.map(ray).collect(), all: rays.len(), beam, setup, back })
    }

    /// The positions of the rays at a distance behind the field.
    fn positions(&self, distance: f64) -> Vec<[f64; 2]> {
        let place = |(x, v): &([f64; 2], [f64; 2])| [0, 1].map(|i| x[i] + distance * v[i]);
        self.rays.iter().map(place).collect()
    }

    fn radii(&self, distance: f64) -> Vec<f64> {
        self.positions(distance).iter().map(|[x, y]| x.hypot(*y)).collect()
    }

    /// The angles of the rays with the axis, in degrees.
    fn angles(&self) -> Vec<f64> {
        self.rays.iter().map(|(_, [u, v])| u.hypot(*v).atan().to_degrees()).collect()
    }

    /// The images on every screen, each scaled to its ring, and at infinity.
    fn screens(
        &self,
        medium: &GrinField,
        effort: Effort,
        part: [f64; 2],
        progress: &mut ProgressFn<'_>,
    ) -> ExperimentResult<Vec<RingScreen>> {
        let places = || PLANES.into_iter().map(Some).chain([None]);
        let screens = places().map(|place| self.screen(place)).collect::<Result<_, _>>()?;
        let (field, setup) = (medium.index_field(), self.setup.clone());
        let projection = LightProjection::new(field, setup, self.beam, screens)?;
        let mut render = |seed: u32, [from, to]: [f64; 2]| {
            let mut tell = |share: f64| {
                let done = from + (to - from) * share;
                progress(ExperimentProgress { done, doing: "rings by light onto screens" })
            };
            projection.render(&settings(effort, seed), &mut tell)
        };
        let images = render(0, part_of(part, [0.0, 0.5]))?;
        let again = render(1, part_of(part, [0.5, 1.0]))?;
        // An image that was ended early is none.
        if images.iter().chain(&again).any(|image| !image.complete) {
            return Err(ExperimentError::Stopped);
        }
        let name = |place: Option<f64>| {
            place.map_or_else(|| "at infinity".to_owned(), |at| format!("{at} mm behind"))
        };
        let pairs = images.into_iter().zip(again).zip(places());
        let screen = |((light, again), place)| RingScreen { name: name(place), light, again };
        Ok(pairs.map(screen).collect())
    }

    /// The screen at a distance behind the field; at infinity if there is none.
    fn screen(&self, distance: Option<f64>) -> Result<LightScreen, ProjectionError> {
        let slopes = || self.rays.iter().map(|(_, [u, v])| u.hypot(*v)).collect();
        let radii: Vec<f64> = distance.map_or_else(slopes, |distance| self.radii(distance));
        let frame = screen_frame(ROOM * mean_and_deviation(&radii).0, CELLS)?;
        let plane = |distance| Face::plane(Vec3::new(0.0, 0.0, 1.0), self.back + distance);
        Ok(LightScreen { face: distance.map(plane), frame })
    }
}

/// The image of a ring on a screen, and the same by other samples.
struct RingScreen {
    name: String,
    light: ProjectedImage,
    again: ProjectedImage,
}

impl RingScreen {
    fn claims(&self, effort: Effort) -> [Claim; 2] {
        sampling_claims(&format!("ring {}", self.name), [&self.light, &self.again], effort)
    }
}

/// Draws the light on every screen.
fn draw(screens: &[RingScreen]) -> Canvas {
    let panel = |screen: &RingScreen| {
        // A caustic has peaks that would make the rest black.
        let rows = screen.light.values.chunks(CELLS).rev();
        let light: Vec<f64> = rows.flatten().map(|light| light.sqrt()).collect();
        let peak = light.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        (screen.name.clone(), gray_levels(&light, CELLS, peak))
    };
    let panels: Vec<_> = screens.iter().map(panel).collect();
    let errors = screens.iter().filter_map(|screen| screen.light.rms_error());
    let error = 100.0 * errors.fold(0.0, f64::max);
    let title = format!(
        "the ring on screens behind the field, each scaled to its ring; sampling error {error:.1} % or less"
    );
    draw_image_row(&title, CELLS, &panels)
}

/// Mean and standard deviation.
fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (mean, rms(values.iter().map(|value| value - mean)))
}

fn rms(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len();
    (values.map(|value| value * value).sum::<f64>() / count as f64).sqrt()
}
