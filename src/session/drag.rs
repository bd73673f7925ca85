//! Dragging a handle of the design: every move changes the design, all moves of one drag are one
//! undo step, and the merit tells at each handle which way would help.

use super::clock::now;
use super::live_merit::{MeritReport, MeritValues, merit_error_text};
use super::run::{LatestRequestWorker, catch_panic};
use crate::lens::{Lens, Parameter, ParameterKind, Quantity, add_variables};
use crate::math::format_short;
use crate::merit::{DerivativeLevel, Goal, Merit, MeritError, SumOfSquares, TermValue};
use crate::paraxial::{DragOutcome, DragSettings, Handle, HandleDrag, MovedNumber, tangents};
use std::borrow::Cow;
use std::collections::HashMap;
use std::io;
use std::sync::Arc;

/// The number of moved numbers that a message names.
const NAMED_NUMBERS: usize = 4;

/// The relative error allowed of spots in the merit of a lens with handles: its derivatives are arrows,
/// and while a handle is dragged its terms are told with their errors. The lens at rest has them to the
/// tolerance of the settings.
const COARSE: f64 = 1e-2;

/// A drag that has not ended.
#[derive(Debug, Clone, PartialEq)]
pub struct DragProgress {
    /// The handle.
    pub handle: Handle,
    /// The lens before the drag.
    pub before: Arc<Lens>,
    /// The value of the handle before the drag.
    pub start: f64,
    /// The value that the handle has reached.
    pub value: f64,
    /// The numbers that have changed to hold what is locked, those that changed most first.
    pub moved: Vec<MovedNumber>,
    /// The reason why the handle has not reached the value that was asked for.
    pub stop: Option<String>,
}

/// The state that a panel with handles shows.
#[derive(Debug, Clone, Default)]
pub struct DragView {
    /// The locked quantities, and the numbers that hold them.
    pub settings: DragSettings,
    /// The drag that has not ended.
    pub progress: Option<Arc<DragProgress>>,
    /// The reason why the last handle could not be dragged at all.
    pub error: Option<String>,
    /// The derivatives of the merit by the handles, maybe of an earlier version of the design.
    pub slopes: Option<Arc<HandleSlopes>>,
}

/// The merit of a lens, and its derivatives by the values of the handles.
#[derive(Debug, Clone)]
pub struct HandleSlopes {
    /// The version of the design.
    pub version: u64,
    /// The merit and the derivatives, or the reason why there are none.
    pub result: Result<MeritSlopes, String>,
    /// The time of the computation, in milliseconds.
    pub ms: f64,
}

/// A merit with its derivatives.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeritSlopes {
    /// The merit of the lens.
    pub merit: f64,
    /// The merit of the lens before the drag.
    pub before: f64,
    /// The derivatives of the merit by the values of the handles that move a parameter.
    pub slopes: Vec<(Handle, f64)>,
    /// The values of the merit function, compared with the light of the lens before the drag.
    pub values: MeritValues,
}

impl MeritSlopes {
    /// The derivative of the merit by the value of a handle.
    pub fn slope(&self, handle: Handle) -> Option<f64> {
        self.slopes.iter().find(|(other, _)| *other == handle).map(|(_, slope)| *slope)
    }
}

/// The state of drags in a session.
#[derive(Debug)]
pub(super) struct DragState {
    pub(super) settings: DragSettings,
    active: Option<(HandleDrag, Arc<DragProgress>)>,
    error: Option<String>,
    worker: LatestRequestWorker<SlopesRequest, HandleSlopes>,
    /// The version whose slopes were requested last.
    requested: u64,
}

impl DragState {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let mut reference = None;
        let worker = LatestRequestWorker::spawn("handles", wake, move |request, output| {
            output.publish(evaluate(&request, &mut reference));
        })?;
        Ok(Self {
            settings: DragSettings::default(),
            active: None,
            error: None,
            worker,
            requested: 0,
        })
    }

    /// The handle that is being dragged.
    pub(super) fn handle(&self) -> Option<Handle> {
        self.active.as_ref().map(|(drag, _)| drag.handle())
    }

    /// Moves a handle, beginning a drag of it if there is none. Returns the lens, or the reason why
    /// the handle cannot be dragged if that is new.
    pub(super) fn drag(
        &mut self,
        design: &Arc<Lens>,
        zoom: usize,
        handle: Handle,
        (value, rim): (f64, Option<f64>),
    ) -> Result<Lens, Option<String>> {
        if self.handle() != Some(handle) {
            let drag = HandleDrag::new(design, handle, zoom, &self.settings, rim);
            let drag = drag.map_err(|why| self.refuse(why.to_string()))?;
            let before = Arc::clone(design);
            let start = drag.start();
            let (moved, stop) = (Vec::new(), None);
            let progress = DragProgress { handle, before, start, value: start, moved, stop };
            self.active = Some((drag, Arc::new(progress)));
        }
        self.error = None;
        let Some((drag, progress)) = &mut self.active else { return Err(None) };
        let DragOutcome { lens, value, moved, stop } = drag.to(value);
        let stop = stop.map(|stop| stop.to_string());
        *progress = Arc::new(DragProgress { value, moved, stop, ..DragProgress::clone(progress) });
        Ok(lens)
    }

    /// The reason, unless it was given before.
    fn refuse(&mut self, why: String) -> Option<String> {
        let is_new = self.error.as_ref() != Some(&why);
        self.error = Some(why.clone());
        is_new.then_some(why)
    }

    /// Ends the drag.
    pub(super) fn take(&mut self) -> Option<Arc<DragProgress>> {
        self.error = None;
        self.active.take().map(|(_, progress)| progress)
    }

    /// The merit of a version of the design that is being dragged, once it is known.
    pub(super) fn merit_report(
        &self,
        version: u64,
        lens: &Arc<Lens>,
        goal: Option<Arc<Goal>>,
    ) -> Option<Arc<MeritReport>> {
        self.handle()?;
        let slopes = self.worker.latest().filter(|slopes| slopes.version == version)?;
        let values = match &slopes.result {
            Ok(found) => Ok(found.values.clone()),
            Err(why) => Err(why.clone()),
        };
        Some(Arc::new(MeritReport { lens: Arc::clone(lens), goal: goal?, values, ms: slopes.ms }))
    }

    pub(super) fn view(&self) -> DragView {
        DragView {
            settings: self.settings.clone(),
            progress: self.active.as_ref().map(|(_, progress)| Arc::clone(progress)),
            error: self.error.clone(),
            slopes: self.worker.latest(),
        }
    }

    /// Holds other quantities, for which the slopes are requested anew.
    pub(super) fn hold(&mut self, settings: DragSettings) {
        self.settings = settings;
        self.requested = 0;
    }

    /// True if the slopes of a version of the design have not been requested yet.
    pub(super) const fn lacks_slopes(&self, version: u64) -> bool {
        self.requested != version
    }

    /// Requests the slopes of a version of the design.
    pub(super) fn request_slopes(
        &mut self,
        version: u64,
        lens: &Arc<Lens>,
        goal: Option<Arc<Goal>>,
        (zoom, tolerance): (usize, f64),
    ) {
        self.requested = version;
        let before = self.active.as_ref().map_or(lens, |(drag, _)| drag.before());
        self.worker.request(SlopesRequest {
            version,
            lens: Arc::clone(lens),
            before: Arc::clone(before),
            goal,
            zoom,
            settings: self.settings.clone(),
            tolerance: tolerance.max(COARSE),
        });
    }
}

impl DragProgress {
    /// The title of the drag in a menu.
    pub(super) fn title(&self) -> String {
        format!("drag the {}", self.handle)
    }

    /// The numbers that have moved to hold the locked quantities; `None` if none has.
    pub fn moved_text(&self) -> Option<String> {
        moved_text(&self.moved)
    }
}

/// Numbers that have moved to hold the locked quantities; `None` for none.
pub(super) fn moved_text(moved: &[MovedNumber]) -> Option<String> {
    if moved.is_empty() {
        return None;
    }
    let change = |moved: &MovedNumber| {
        let is_curvature = moved.parameter.quantity == Quantity::Curvature;
        let shown = |value: f64| if is_curvature { value.recip() } else { value };
        let text = |value| match shown(value) {
            value if value.is_infinite() => "Infinity".to_owned(),
            value => format_short(rounded(value)),
        };
        let [before, after] = [moved.before, moved.after].map(text);
        format!("{} from {before} to {after}", moved.parameter.shown_name())
    };
    let named: Vec<String> = moved.iter().take(NAMED_NUMBERS).map(change).collect();
    let more = moved.len().saturating_sub(NAMED_NUMBERS);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    Some(format!("{}{rest}", named.join(", ")))
}

/// The text on what has held the locked quantities, as in "the focal length was held by the …".
pub(super) fn held_text(settings: &DragSettings, moved: &str) -> String {
    let names: Vec<String> = settings.locks.iter().map(ToString::to_string).collect();
    let was = if names.len() > 1 { "were" } else { "was" };
    format!("the {} {was} held by {moved}", names.join(" and the "))
}

/// A number with five significant digits.
pub(super) fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    // The digits after the first one; parsing them gives the nearest number.
    format!("{value:.4e}").parse().unwrap_or(value)
}

/// A request for the slopes of a lens.
#[derive(Debug)]
struct SlopesRequest {
    version: u64,
    lens: Arc<Lens>,
    /// The lens before the drag, with which the merit is compared.
    before: Arc<Lens>,
    /// The merit function of the design; `None` if it has none.
    goal: Option<Arc<Goal>>,
    zoom: usize,
    settings: DragSettings,
    tolerance: f64,
}

/// The merit function of the lens before a drag, by all numbers that handles move.
#[derive(Debug)]
struct MeritReference {
    lens: Arc<Lens>,
    goal: Arc<Goal>,
    tolerance: f64,
    merit: Merit,
    value: f64,
}

fn evaluate(request: &SlopesRequest, reference: &mut Option<MeritReference>) -> HandleSlopes {
    let start = now();
    let result = catch_panic(|| slopes(request, reference));
    HandleSlopes { version: request.version, result, ms: start.elapsed().as_secs_f64() * 1e3 }
}

fn slopes(
    request: &SlopesRequest,
    reference: &mut Option<MeritReference>,
) -> Result<MeritSlopes, String> {
    let goal = request.goal.as_ref().ok_or("the lens has no merit function")?;
    let known = reference.take().filter(|known| known.serves(request, goal));
    let known = match known {
        Some(known) => known,
        None => MeritReference::new(&request.before, goal, request.tolerance)?,
    };
    let known = reference.insert(known);
    let before = known.value;
    let lens = with_all_variables(&request.lens);
    let text = |why: MeritError| merit_error_text(&why, &lens);
    let (merit, sum, terms) = known.evaluate(&lens).map_err(text)?;
    let values = MeritValues::new(&lens, &merit, terms).map_err(text)?;
    let by_number = merit.variables().iter().map(|variable| variable.parameter);
    let by_number: HashMap<Parameter, f64> = by_number.zip(sum.gradient.iter().copied()).collect();
    let along = |tangent: Vec<(Parameter, f64)>| -> f64 {
        tangent.iter().map(|(p, by)| by * by_number.get(p).copied().unwrap_or(0.0)).sum()
    };
    let tangents = tangents(&request.lens, request.zoom, &request.settings);
    let slopes = tangents.into_iter().map(|(handle, tangent)| (handle, along(tangent)));
    let slopes = slopes.filter(|(_, slope)| slope.is_finite()).collect();
    Ok(MeritSlopes { merit: sum.value, before, slopes, values })
}

impl MeritReference {
    fn new(lens: &Arc<Lens>, goal: &Arc<Goal>, tolerance: f64) -> Result<Self, String> {
        let free = with_all_variables(lens);
        let text = |why: MeritError| merit_error_text(&why, &free);
        let merit = Merit::new(&free, goal, tolerance).map_err(text)?;
        let value = merit.value(&merit.values(&free)).map_err(text)?;
        Ok(Self { lens: Arc::clone(lens), goal: Arc::clone(goal), tolerance, merit, value })
    }

    /// The merit of a lens with its derivatives and its terms, by the pupils of the lens before,
    /// which follow the lens; where they cannot, by new ones. Its edges are those at its own rims, as
    /// they are once the handle is released.
    fn evaluate(
        &mut self,
        lens: &Lens,
    ) -> Result<(Cow<'_, Merit>, SumOfSquares, Vec<TermValue>), MeritError> {
        let values = self.merit.values(lens);
        if self.merit.lens(&values) == *lens {
            self.merit.follow_rims(lens);
            let found = self.merit.evaluate_with_terms(&values, DerivativeLevel::Gradient);
            if let Ok((sum, terms)) = found {
                return Ok((Cow::Borrowed(&self.merit), sum, terms));
            }
        }
        let merit = Merit::new(lens, &self.goal, self.tolerance)?;
        let merit = merit.with_initial_light(self.merit.initial_light());
        let (sum, terms) =
            merit.evaluate_with_terms(&merit.values(lens), DerivativeLevel::Gradient)?;
        Ok((Cow::Owned(merit), sum, terms))
    }

    /// True if a request asks for the same merit function of the same lens.
    fn serves(&self, request: &SlopesRequest, goal: &Goal) -> bool {
        Arc::ptr_eq(&self.lens, &request.before)
            && *self.goal == *goal
            && self.tolerance == request.tolerance
    }
}

/// The lens with all numbers that handles move as variables.
fn with_all_variables(lens: &Lens) -> Lens {
    let mut freed = lens.clone();
    freed.variables.clear();
    let kinds =
        [ParameterKind::Curvatures, ParameterKind::Thicknesses, ParameterKind::SemiDiameters];
    add_variables(&mut freed, &kinds);
    freed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_moved_are_told_with_five_digits() {
        for (value, told) in [
            (123_456.7, 123_460.0),
            (-0.012_345_678, -0.012_346),
            (99.999_96, 100.0),
            (0.0, 0.0),
            (2.5, 2.5),
        ] {
            assert_eq!(rounded(value), told, "{value}");
        }
        assert!(rounded(f64::INFINITY).is_infinite() && rounded(f64::NAN).is_nan());
    }
}
