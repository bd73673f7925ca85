//! The numbers of all panels, computed in the background for the newest lens only.
//!
//! A request that was not begun is replaced by a newer one; one that was begun is left between two
//! numbers. Results carry the version of the design that they belong to, and how long each took.

use super::clock::{Timed, now, timed};
use super::layout::{Layout, layout};
use super::pupils::{Pupils, pupils};
use super::saving::timed_plan;
use super::scatter::{Scatter, scatter};
use super::slot::{Mailbox, Slot};
use super::view::Settings;
use crate::analysis;
use crate::analysis::{Curvature, Dark, Distortion, Fan, Illumination, Spot};
use crate::effects;
use crate::effects::{Plan, Task};
use crate::lens::{Field, Lens};
use crate::paraxial::{FirstOrder, Seidel};
use crate::pupil::{Accuracy, Bench, BenchError};
use rayon::prelude::*;
use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// The numbers of one version of the design.
#[derive(Debug, Clone)]
pub struct Results {
    /// The version that they belong to.
    pub version: u64,
    /// The lens that they belong to.
    pub lens: Arc<Lens>,
    /// The settings that they were computed with.
    pub settings: Settings,
    /// The numbers, or why there are none.
    pub numbers: Result<Numbers, String>,
    /// How long all of it took, in milliseconds.
    pub ms: f64,
}

/// The numbers of one lens at one zoom position, each with its time.
#[derive(Debug, Clone)]
pub struct Numbers {
    /// The lens with its beam, ready for rays.
    pub bench: Timed<Arc<Bench>>,
    /// Third-order sums; `None` where there is no chief ray.
    pub seidel: Timed<Option<Seidel<f64>>>,
    /// Which effects are computed and why.
    pub plan: Timed<Plan>,
    /// The rays of the layout.
    pub layout: Timed<Layout>,
    /// Where the rays of each field land, in the order of fields and then wavelengths.
    pub scatter: Timed<Vec<Scatter>>,
    /// The spot of each field.
    pub spots: Timed<Vec<Result<Spot, Dark>>>,
    /// The radius of the first dark ring of a perfect lens, in mm.
    pub airy: Option<f64>,
    /// The pupil of each field; `None` where none is shown.
    pub pupils: Option<Timed<Pupils>>,
    /// The ray fans of each field.
    pub fans: Timed<Vec<Result<Vec<Fan>, Dark>>>,
    /// Distortion at each field.
    pub distortion: Timed<Vec<Result<Distortion, Dark>>>,
    /// Field curvature at each field.
    pub curvature: Timed<Vec<Result<Curvature, Dark>>>,
    /// The light of each field.
    pub illumination: Timed<Vec<Illumination>>,
}

impl Numbers {
    /// First-order data at the primary wavelength.
    pub fn first(&self) -> &FirstOrder<f64> {
        &self.bench.value.first
    }
}

/// What is wanted.
#[derive(Debug, Clone)]
pub(super) struct Request {
    pub(super) version: u64,
    pub(super) lens: Arc<Lens>,
    pub(super) settings: Settings,
}

/// Whether the time that each effect takes is measured when there is time for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Savings {
    Measured,
    Left,
}

/// The handle of the thread that computes numbers.
#[derive(Debug)]
pub(super) struct Analyst {
    requests: Arc<Mailbox<Request>>,
    results: Slot<Results>,
    thread: Option<JoinHandle<()>>,
}

impl Analyst {
    /// Starts the thread. `wake` is called from it when new results are there.
    pub(super) fn spawn(savings: Savings, wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let requests = Arc::new(Mailbox::new());
        let results = Slot::default();
        let inbox = Arc::clone(&requests);
        let desk = Desk { inbox, shown: results.clone(), wake, savings, published: None };
        let thread = thread::Builder::new().name("analyst".into()).spawn(move || desk.serve())?;
        Ok(Self { requests, results, thread: Some(thread) })
    }

    /// Asks for the numbers of a lens, and for those of no older one any more.
    pub(super) fn ask(&self, request: Request) {
        self.requests.put(request);
    }

    /// The newest results.
    pub(super) fn results(&self) -> Option<Arc<Results>> {
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
    inbox: Arc<Mailbox<Request>>,
    shown: Slot<Results>,
    wake: W,
    savings: Savings,
    /// When results were shown last.
    published: Option<Instant>,
}

impl<W: Fn()> Desk<W> {
    /// Works until the handle is dropped.
    fn serve(mut self) {
        while let Some(request) = self.inbox.take() {
            let found = self.answer(request);
            if let (Some(results), Savings::Measured) = (found, self.savings) {
                self.measure(results);
            }
        }
    }

    /// Shows the results of a request, and gives them back if they are shown.
    fn answer(&mut self, request: Request) -> Option<Results> {
        let start = now();
        let fresh = self.published.is_some_and(|shown| start.duration_since(shown) < SHOWN);
        let overtaken = || fresh && start.elapsed() > BEGUN && self.inbox.interrupts();
        let interrupted = || self.inbox.is_closed() || overtaken();
        let Request { version, lens, settings } = request;
        let numbers = numbers(&lens, &settings, interrupted)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let results = Results { version, lens, settings, numbers, ms };
        self.published = Some(now());
        self.publish(results.clone());
        Some(results)
    }

    /// Shows the same results once more with the time that each effect takes, if there is time.
    fn measure(&self, mut results: Results) {
        let Ok(numbers) = &mut results.numbers else { return };
        if !self.inbox.is_quiet_for(QUIET) {
            return;
        }
        let interrupted = || self.inbox.interrupts();
        if let Some(Ok(plan)) = timed_plan(&results.lens, &results.settings, interrupted) {
            numbers.plan.value = plan;
            self.publish(results);
        }
    }

    fn publish(&self, results: Results) {
        self.shown.set(results);
        (self.wake)();
    }
}

/// The numbers of a lens.
///
/// # Errors
/// A lens or aperture through which nothing can be traced.
pub fn compute(lens: &Lens, settings: &Settings) -> Result<Numbers, String> {
    let never = || false;
    numbers(lens, settings, never).unwrap_or_else(|| Err("interrupted".to_owned()))
}

fn numbers(
    lens: &Lens,
    settings: &Settings,
    interrupted: impl Fn() -> bool,
) -> Option<Result<Numbers, String>> {
    let plan = timed(|| planned(lens, settings));
    let plan = match plan.value {
        Ok(value) => Timed { value, ms: plan.ms },
        Err(error) => return Some(Err(error.to_string())),
    };
    let bench = timed(|| effects::bench(lens, settings.zoom, &plan.value));
    match bench.value {
        Ok(value) => {
            let bench = Timed { value: Arc::new(value), ms: bench.ms };
            Numbers::of(bench, plan, settings, interrupted).map(Ok)
        }
        Err(error) => Some(Err(error.to_string())),
    }
}

fn planned(lens: &Lens, settings: &Settings) -> Result<Plan, BenchError> {
    let facts = effects::survey(lens, settings.zoom)?;
    Ok(effects::plan(&facts, Task::Spot(settings.tolerance), &settings.choices))
}

/// How many points a ray fan has.
const FAN_POINTS: usize = 65;

impl Numbers {
    /// All numbers, what is looked at first in front; `None` where they are no longer wanted.
    fn of(
        bench: Timed<Arc<Bench>>,
        plan: Timed<Plan>,
        settings: &Settings,
        interrupted: impl Fn() -> bool,
    ) -> Option<Self> {
        let go_on = || (!interrupted()).then_some(());
        let b = Arc::clone(&bench.value);
        let accuracy = Accuracy { tolerance: settings.tolerance, ..Accuracy::default() };
        let layout = timed(|| layout(&b, settings.rays));
        go_on()?;
        let scatter = timed(|| scatter(&b));
        go_on()?;
        let spots = timed(|| each(&b, |field| timed_spot(&b, field, accuracy)));
        go_on()?;
        let pupils = settings.pupils.then(|| timed(|| pupils(&b, settings, accuracy)));
        go_on()?;
        let fans = timed(|| each(&b, |field| analysis::fan(&b, field, FAN_POINTS)));
        go_on()?;
        let illumination = timed(|| analysis::illumination(&b, b.primary, accuracy));
        go_on()?;
        Some(Self {
            seidel: timed(|| b.seidel()),
            airy: analysis::airy_radius(&b),
            distortion: timed(|| each(&b, |field| analysis::distortion(&b, field, b.primary))),
            curvature: timed(|| each(&b, |field| analysis::field_curvature(&b, field, b.primary))),
            bench,
            plan,
            layout,
            scatter,
            spots,
            pupils,
            fans,
            illumination,
        })
    }
}

/// The spot of a field, with the time that its numbers took.
fn timed_spot(bench: &Bench, field: Field, accuracy: Accuracy) -> Result<Spot, Dark> {
    let Timed { value, ms } = timed(|| analysis::spot(bench, field, accuracy));
    let mut spot = value?;
    for number in [&mut spot.rms, &mut spot.radius] {
        number.milliseconds = Some(ms);
    }
    Ok(spot)
}

/// A result for each field, in order.
pub(super) fn each<T: Send>(bench: &Bench, of: impl Fn(Field) -> T + Sync) -> Vec<T> {
    bench.fields.par_iter().map(|field| of(*field)).collect()
}
