//! The numbers of all panels, computed in the background for the newest lens only.
//!
//! A request that was not begun is replaced by a newer one; one that was begun is left between two
//! numbers. Results carry the version of the design that they belong to, and how long each took.

use super::clock::{Timed, now, timed};
use super::layout::{Layout, layout};
use super::scatter::{Scatter, scatter};
use super::slot::{Mailbox, Slot};
use super::view::Settings;
use crate::analysis::{Dark, Spot, spot};
use crate::lens::Lens;
use crate::paraxial::{FirstOrder, Seidel, seidel};
use crate::pupil::{Accuracy, Bench};
use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

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
    /// The rays of the layout.
    pub layout: Timed<Layout>,
    /// Where the rays of each field land.
    pub scatter: Timed<Vec<Scatter>>,
    /// The spot of each field, or why it has none.
    pub spots: Vec<Timed<Result<Spot, Dark>>>,
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

/// The handle of the thread that computes numbers.
#[derive(Debug)]
pub(super) struct Analyst {
    requests: Arc<Mailbox<Request>>,
    results: Slot<Results>,
    thread: Option<JoinHandle<()>>,
}

impl Analyst {
    /// Starts the thread. `wake` is called from it when new results are there.
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let requests = Arc::new(Mailbox::new());
        let results = Slot::default();
        let (inbox, shown) = (Arc::clone(&requests), results.clone());
        let serve = move || {
            while let Some(request) = inbox.take() {
                if let Some(found) = answer(request, || inbox.interrupts()) {
                    shown.set(found);
                    wake();
                }
            }
        };
        let thread = thread::Builder::new().name("analyst".into()).spawn(serve)?;
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

/// The results of a request; `None` where `interrupted` says that they are no longer wanted.
fn answer(request: Request, interrupted: impl Fn() -> bool) -> Option<Results> {
    let start = now();
    let Request { version, lens, settings } = request;
    let numbers = numbers(&lens, &settings, interrupted)?;
    let ms = start.elapsed().as_secs_f64() * 1e3;
    Some(Results { version, lens, settings, numbers, ms })
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
    let bench = timed(|| Bench::of(lens, settings.zoom));
    let bench = match bench.value {
        Ok(value) => Timed { value: Arc::new(value), ms: bench.ms },
        Err(error) => return Some(Err(error.to_string())),
    };
    let seidel = timed(|| third_order(&bench.value));
    let go_on = || (!interrupted()).then_some(());
    go_on()?;
    let layout = timed(|| layout(&bench.value, settings.rays));
    go_on()?;
    let scatter = timed(|| scatter(&bench.value));
    let accuracy = Accuracy { tolerance: settings.tolerance, ..Accuracy::default() };
    let mut spots = Vec::new();
    for field in &bench.value.fields {
        go_on()?;
        spots.push(timed(|| spot(&bench.value, *field, accuracy)));
    }
    Some(Ok(Numbers { bench, seidel, layout, scatter, spots }))
}

fn third_order(bench: &Bench) -> Option<Seidel<f64>> {
    let by_length = |a: &&crate::pupil::Color, b: &&crate::pupil::Color| a.um.total_cmp(&b.um);
    let short = bench.colors.iter().min_by(by_length)?;
    let long = bench.colors.iter().max_by(by_length)?;
    let outer = (short.um < long.um).then_some((&short.system, &long.system));
    seidel(&bench.colors[bench.primary].system, &bench.first, outer)
}
