//! The numbers of all panels, computed in the background for the newest lens only.
//!
//! A request that was not begun is replaced by a newer one; one that was begun is left between two
//! numbers. Results carry the version of the design that they belong to, and how long each took.

use super::clock::{Timed, now, time};
use super::pupils::{FieldPupils, field_pupils};
use super::saving::measure_effect_costs;
use super::slot::{LatestRequest, Slot};
use super::view::AnalysisSettings;
use crate::analysis;
use crate::analysis::{
    AnalysisError, Distortion, Fan, FieldCurvature, Illumination, RayLayout, Spot, SpotPoints,
};
use crate::effects;
use crate::effects::{EffectPlan, TracePurpose};
use crate::lens::{FieldPoint, Lens};
use crate::paraxial::{FirstOrder, Seidel};
use crate::pupil::{Accuracy, RayModel, RayModelError};
use rayon::prelude::*;
use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// The numbers of one version of the design.
#[derive(Debug, Clone)]
pub struct AnalysisResults {
    /// The version that they belong to.
    pub version: u64,
    /// The lens that they belong to.
    pub lens: Arc<Lens>,
    /// The settings that they were computed with.
    pub settings: AnalysisSettings,
    /// The numbers, or why there are none.
    pub analyses: Result<Analyses, String>,
    /// How long all of it took, in milliseconds.
    pub ms: f64,
}

/// The numbers of one lens at one zoom position, each with its time.
#[derive(Debug, Clone)]
pub struct Analyses {
    /// The lens with its beam, ready for rays.
    pub bench: Timed<Arc<RayModel>>,
    /// Third-order sums; `None` where there is no chief ray.
    pub seidel: Timed<Option<Seidel<f64>>>,
    /// Which effects are computed and why.
    pub plan: Timed<EffectPlan>,
    /// The rays of the layout.
    pub layout: Timed<RayLayout>,
    /// Where the rays of each field land, in the order of fields and then wavelengths.
    pub spot_points: Timed<Vec<SpotPoints>>,
    /// The spot of each field.
    pub spots: Timed<Vec<Result<Spot, AnalysisError>>>,
    /// The radius of the first dark ring of a perfect lens, in mm.
    pub airy: Option<f64>,
    /// The pupil of each field; `None` where none is shown.
    pub pupils: Option<Timed<FieldPupils>>,
    /// The ray fans of each field.
    pub fans: Timed<Vec<Result<Vec<Fan>, AnalysisError>>>,
    /// Distortion at each field.
    pub distortion: Timed<Vec<Result<Distortion, AnalysisError>>>,
    /// Field curvature at each field.
    pub curvature: Timed<Vec<Result<FieldCurvature, AnalysisError>>>,
    /// The light of each field.
    pub illumination: Timed<Vec<Illumination>>,
}

impl Analyses {
    /// First-order data at the primary wavelength.
    pub fn first_order(&self) -> &FirstOrder<f64> {
        &self.bench.value.first_order
    }
}

/// What is wanted.
#[derive(Debug, Clone)]
pub(super) struct Request {
    pub(super) version: u64,
    pub(super) lens: Arc<Lens>,
    pub(super) settings: AnalysisSettings,
}

/// Whether the time that each effect takes is measured when there is time for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum EffectTiming {
    Measured,
    Skipped,
}

/// The handle of the thread that computes numbers.
#[derive(Debug)]
pub(super) struct Analyst {
    requests: Arc<LatestRequest<Request>>,
    results: Slot<AnalysisResults>,
    thread: Option<JoinHandle<()>>,
}

impl Analyst {
    /// Starts the thread. `wake` is called from it when new results are there.
    pub(super) fn spawn(
        savings: EffectTiming,
        wake: impl Fn() + Send + 'static,
    ) -> io::Result<Self> {
        let requests = Arc::new(LatestRequest::new());
        let results = Slot::default();
        let inbox = Arc::clone(&requests);
        let desk = Desk { inbox, shown: results.clone(), wake, savings, published: None };
        let thread = thread::Builder::new().name("analyst".into()).spawn(move || desk.serve())?;
        Ok(Self { requests, results, thread: Some(thread) })
    }

    /// Asks for the numbers of a lens, and for those of no older one any more.
    pub(super) fn ask(&self, request: Request) {
        self.requests.submit(request);
    }

    /// The newest results.
    pub(super) fn results(&self) -> Option<Arc<AnalysisResults>> {
        self.results.latest()
    }
}

impl Drop for Analyst {
    fn drop(&mut self) {
        self.requests.close();
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap_or_default();
        }
    }
}

/// A newer request stops one that was begun so long ago, unless nothing was shown for longer than
/// the second time: numbers follow a value that is being dragged.
const BEGUN: Duration = Duration::from_millis(50);
const SHOWN: Duration = Duration::from_millis(200);
/// Times are measured when nothing was asked for so long.
const QUIET: Duration = Duration::from_millis(300);

/// What the thread works with.
struct Desk<W> {
    inbox: Arc<LatestRequest<Request>>,
    shown: Slot<AnalysisResults>,
    wake: W,
    savings: EffectTiming,
    /// When results were shown last.
    published: Option<Instant>,
}

impl<W: Fn()> Desk<W> {
    /// Works until the handle is dropped.
    fn serve(mut self) {
        while let Some(request) = self.inbox.take() {
            let found = self.answer(request);
            if let (Some(results), EffectTiming::Measured) = (found, self.savings) {
                self.measure(results);
            }
        }
    }

    /// Shows the results of a request, and gives them back if they are shown.
    fn answer(&mut self, request: Request) -> Option<AnalysisResults> {
        let start = now();
        let fresh = self.published.is_some_and(|shown| start.duration_since(shown) < SHOWN);
        let overtaken = || fresh && start.elapsed() > BEGUN && self.inbox.is_interrupted();
        let interrupted = || self.inbox.is_closed() || overtaken();
        let Request { version, lens, settings } = request;
        let numbers = numbers(&lens, &settings, interrupted)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let results = AnalysisResults { version, lens, settings, analyses: numbers, ms };
        self.published = Some(now());
        self.publish(results.clone());
        Some(results)
    }

    /// Shows the same results once more with the time that each effect takes, if there is time.
    fn measure(&self, mut results: AnalysisResults) {
        let Ok(numbers) = &mut results.analyses else { return };
        if !self.inbox.idle_for(QUIET) {
            return;
        }
        let interrupted = || self.inbox.is_interrupted();
        if let Some(Ok(plan)) = measure_effect_costs(&results.lens, &results.settings, interrupted)
        {
            numbers.plan.value = plan;
            self.publish(results);
        }
    }

    fn publish(&self, results: AnalysisResults) {
        self.shown.set(results);
        (self.wake)();
    }
}

/// The numbers of a lens.
///
/// # Errors
/// A lens or aperture through which nothing can be traced.
pub fn analyze(lens: &Lens, settings: &AnalysisSettings) -> Result<Analyses, String> {
    let never = || false;
    numbers(lens, settings, never).unwrap_or_else(|| Err("interrupted".to_owned()))
}

fn numbers(
    lens: &Lens,
    settings: &AnalysisSettings,
    interrupted: impl Fn() -> bool,
) -> Option<Result<Analyses, String>> {
    let plan = time(|| plan_effects(lens, settings));
    let plan = match plan.value {
        Ok(value) => Timed { value, ms: plan.ms },
        Err(error) => return Some(Err(error.to_string())),
    };
    let bench = time(|| effects::build_ray_model(lens, settings.zoom, &plan.value));
    match bench.value {
        Ok(value) => {
            let bench = Timed { value: Arc::new(value), ms: bench.ms };
            Analyses::of(bench, plan, settings, interrupted).map(Ok)
        }
        Err(error) => Some(Err(error.to_string())),
    }
}

fn plan_effects(lens: &Lens, settings: &AnalysisSettings) -> Result<EffectPlan, RayModelError> {
    let facts = effects::measure_effects(lens, settings.zoom)?;
    Ok(effects::plan(&facts, TracePurpose::Spot(settings.tolerance), &settings.overrides))
}

/// How many points a ray fan has.
const FAN_POINTS: usize = 65;

impl Analyses {
    /// All numbers, what is looked at first in front; `None` where they are no longer wanted.
    fn of(
        bench: Timed<Arc<RayModel>>,
        plan: Timed<EffectPlan>,
        settings: &AnalysisSettings,
        interrupted: impl Fn() -> bool,
    ) -> Option<Self> {
        let go_on = || (!interrupted()).then_some(());
        let b = Arc::clone(&bench.value);
        let accuracy = Accuracy { tolerance: settings.tolerance, ..Accuracy::default() };
        let layout = time(|| analysis::ray_layout(&b, settings.rays));
        go_on()?;
        let scatter = time(|| analysis::spot_points(&b));
        go_on()?;
        let spots = time(|| for_each_field(&b, |field| spot_with_time(&b, field, accuracy)));
        go_on()?;
        let pupils = settings.pupils.then(|| time(|| field_pupils(&b, settings, accuracy)));
        go_on()?;
        let fans = time(|| for_each_field(&b, |field| analysis::fan(&b, field, FAN_POINTS)));
        go_on()?;
        let illumination = time(|| analysis::illumination(&b, b.primary, accuracy));
        go_on()?;
        Some(Self {
            seidel: time(|| b.seidel()),
            airy: analysis::airy_radius(&b),
            distortion: time(|| {
                for_each_field(&b, |field| analysis::distortion(&b, field, b.primary))
            }),
            curvature: time(|| {
                for_each_field(&b, |field| analysis::field_curvature(&b, field, b.primary))
            }),
            bench,
            plan,
            layout,
            spot_points: scatter,
            spots,
            pupils,
            fans,
            illumination,
        })
    }
}

/// The spot of a field, with the time that its numbers took.
fn spot_with_time(
    bench: &RayModel,
    field: FieldPoint,
    accuracy: Accuracy,
) -> Result<Spot, AnalysisError> {
    let Timed { value, ms } = time(|| analysis::spot(bench, field, accuracy));
    let mut spot = value?;
    for number in [&mut spot.rms, &mut spot.radius] {
        number.milliseconds = Some(ms);
    }
    Ok(spot)
}

/// A result for each field, in order.
pub(super) fn for_each_field<T: Send>(
    bench: &RayModel,
    of: impl Fn(FieldPoint) -> T + Sync,
) -> Vec<T> {
    bench.fields.par_iter().map(|field| of(*field)).collect()
}
