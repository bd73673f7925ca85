//! Changing a lens by its handles: the value of a handle moves, and what is locked is held by the
//! least change of the other numbers.
//!
//! A [`HandleDrag`] starts from a lens and gives the lens for every value of its handle. It depends
//! on the value alone, not on the way to it: a handle that comes back gives the lens that it started
//! from. The least change is that of the projection of a search
//! ([`crate::solve::nearest_point_from`]): curvatures count in steps of `0.3/f`, distances in steps
//! of `0.01 f`. Where no nearby lens has the locked quantities, or the handle has reached the end of
//! its range, it stops and says why.

mod after_edit;
mod handle;
mod hold;
mod limit;
mod lock;
mod place;

pub use after_edit::{HeldEdit, HoldError, hold_after_edit};
pub use handle::{Handle, HandleUnit, elements};
pub use limit::DragLimit;
pub use lock::{FirstOrderLock, LockError};
pub use place::HandlePlaces;

use crate::lens::{Edit, EditError, Lens, Parameter, Quantity, SurfaceNumber, apply_edit};
use crate::solve::ConstraintError;
use hold::{HeldLens, TangentSpace};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// The numbers that may change to hold what is locked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FreeNumbers {
    /// All curvatures and gaps, but for those of plane-parallel plates' faces.
    #[default]
    All,
    /// The curvatures and gaps that are variables.
    Variables,
}

/// The quantities that drags hold, and the numbers that hold them.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct DragSettings {
    /// The quantities that stay.
    pub locks: Vec<FirstOrderLock>,
    /// The numbers that may change for that.
    pub free: FreeNumbers,
}

/// The reason why a handle cannot be dragged at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DragError {
    /// The lens has no such handle.
    #[error("the lens has no handle for the {0}")]
    NoHandle(Handle),
    /// A number that the handle moves follows another one.
    #[error("the {0} follows the {1} by a pickup")]
    PickedUp(Parameter, Parameter),
    /// A locked quantity does not exist.
    #[error("the {0} cannot be held: {1}")]
    Lock(FirstOrderLock, LockError),
}

/// The reason why a handle stops before the value that was asked for.
#[derive(Debug, Clone, PartialEq)]
pub enum DragStop {
    /// The end of the range of a number.
    Limit(DragLimit),
    /// The locked quantities cannot be held.
    Locks {
        /// The locked quantities.
        locks: Vec<FirstOrderLock>,
        /// The reason.
        cause: ConstraintError,
        /// The numbers that have reached their limits.
        held: Vec<Parameter>,
    },
    /// The lens could not be used.
    Lens(EditError),
    /// The value is not a number.
    NotANumber,
}

impl fmt::Display for DragStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Limit(limit) => write!(f, "{limit}"),
            Self::Lens(error) => write!(f, "{error}"),
            Self::NotANumber => write!(f, "the value is not a number"),
            Self::Locks { locks, cause, held } => {
                let names: Vec<String> = locks.iter().map(ToString::to_string).collect();
                write!(f, "the {} cannot be held: ", names.join(" and the "))?;
                match (cause, &held[..]) {
                    (ConstraintError::Bounds { .. }, [first, rest @ ..]) => {
                        write!(f, "the {first} has reached its limit")?;
                        if rest.is_empty() {
                            Ok(())
                        } else {
                            write!(f, ", and {} more", rest.len())
                        }
                    }
                    (ConstraintError::Steps(_), _) => write!(f, "no lens nearby has it"),
                    _ => write!(f, "the free numbers cannot do it"),
                }
            }
        }
    }
}

/// A number that has changed to hold what is locked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovedNumber {
    /// The number.
    pub parameter: Parameter,
    /// Its value before.
    pub before: f64,
    /// Its value now.
    pub after: f64,
}

/// A lens for one value of a handle.
#[derive(Debug, Clone, PartialEq)]
pub struct DragOutcome {
    /// The lens.
    pub lens: Lens,
    /// The value that the handle has reached.
    pub value: f64,
    /// The numbers that have changed to hold what is locked, those that changed most first.
    pub moved: Vec<MovedNumber>,
    /// The reason why the handle has not reached the value that was asked for.
    pub stop: Option<DragStop>,
}

/// The least part of its step by which a number counts as changed.
const LEAST_CHANGE: f64 = 1e-9;
/// The shortest part of the way to a value that is tried where the whole way fails.
const SHORTEST_STEP: f64 = 1e-3;

/// A drag of one handle of a lens.
#[derive(Debug, Clone)]
pub struct HandleDrag {
    before: Arc<Lens>,
    handle: Handle,
    zoom: usize,
    start: f64,
    range: [(f64, DragLimit); 2],
    held: HeldLens,
}

/// A lens with the coordinates of its free numbers.
type Reached = (Lens, Vec<f64>);

impl HandleDrag {
    /// Begins to drag a handle at a zoom position. `rim` is the semi-diameter with which a surface
    /// without one is drawn, in mm.
    ///
    /// # Errors
    /// A handle that the lens does not have or that a pickup decides, or a locked quantity that does
    /// not exist.
    pub fn new(
        lens: &Arc<Lens>,
        handle: Handle,
        zoom: usize,
        settings: &DragSettings,
        rim: Option<f64>,
    ) -> Result<Self, DragError> {
        let is_rim = matches!(handle, Handle::Rim(surface) if surface < lens.surfaces.len());
        let written = handle.value(lens, zoom);
        let start = written.or(rim.filter(|_| is_rim)).ok_or(DragError::NoHandle(handle))?;
        let motion = handle.motion(lens, zoom);
        let follower = |(parameter, _): &(Parameter, f64)| {
            lens.pickups.iter().find(|pickup| pickup.parameter == *parameter)
        };
        if let Some(pickup) = motion.iter().find_map(follower) {
            return Err(DragError::PickedUp(pickup.parameter, pickup.source));
        }
        Ok(Self {
            range: handle.range(lens, zoom),
            held: HeldLens::new(lens, &motion, settings)?,
            before: Arc::clone(lens),
            handle,
            zoom,
            start,
        })
    }

    /// The lens before.
    pub const fn before(&self) -> &Arc<Lens> {
        &self.before
    }

    /// The handle.
    pub const fn handle(&self) -> Handle {
        self.handle
    }

    /// The zoom position at which it is dragged.
    pub const fn zoom(&self) -> usize {
        self.zoom
    }

    /// The value of the handle in the lens before.
    pub const fn start(&self) -> f64 {
        self.start
    }

    /// The lens for a value of the handle, or for the value nearest to it on the way from the start
    /// at which everything locked can be held.
    pub fn to(&self, value: f64) -> DragOutcome {
        if value.is_nan() {
            return self.outcome(self.start, None, Some(DragStop::NotANumber));
        }
        let [low, high] = &self.range;
        let (value, limit) = match value {
            v if v < low.0 => (low.0, Some(low.1)),
            v if v > high.0 => (high.0, Some(high.1)),
            v => (v, None),
        };
        let origin = self.held.origin();
        match self.lens_at(value, &origin) {
            Ok(reached) => self.outcome(value, Some(reached), limit.map(DragStop::Limit)),
            Err(why) => self.approach(value, why),
        }
    }

    /// The lens at the last value on the way from the start to `value` that can be reached.
    fn approach(&self, value: f64, mut why: DragStop) -> DragOutcome {
        let (mut share, mut step) = (0.0, 0.5);
        let (mut at, mut reached, mut guess) = (self.start, None, self.held.origin());
        while step > SHORTEST_STEP && share < 1.0 {
            let next: f64 = share + step;
            let to = if next >= 1.0 { value } else { self.start + next * (value - self.start) };
            match self.lens_at(to, &guess) {
                Ok(found) => {
                    guess.clone_from(&found.1);
                    (share, at, reached) = (next, to, Some(found));
                }
                Err(stopped) => {
                    why = stopped;
                    step *= 0.5;
                }
            }
        }
        self.outcome(at, reached, (share < 1.0).then_some(why))
    }

    /// The lens at a value, from coordinates of the free numbers near the solution.
    fn lens_at(&self, value: f64, guess: &[f64]) -> Result<Reached, DragStop> {
        let at = self.held.solve(value - self.start, guess)?;
        let mut lens = self
            .handle
            .with_value(&self.before, self.zoom, value)
            .map_err(|_error| DragStop::NotANumber)?;
        self.held.write(&mut lens, &at);
        let lens = apply_edit(&self.before, &Edit::Replace(Box::new(lens)));
        lens.map(|lens| (lens, at)).map_err(DragStop::Lens)
    }

    fn outcome(&self, value: f64, reached: Option<Reached>, stop: Option<DragStop>) -> DragOutcome {
        let Some((lens, at)) = reached.filter(|_| value != self.start) else {
            let lens = Lens::clone(&self.before);
            return DragOutcome { lens, value: self.start, moved: Vec::new(), stop };
        };
        DragOutcome { moved: self.held.moved(&lens, &at), lens, value, stop }
    }

    /// The derivatives of all numbers of the lens by the value of the handle, of those too that hold
    /// what is locked. `None` if that cannot be held, or for a handle that moves no parameter.
    pub fn tangent(&self) -> Option<Vec<(Parameter, f64)>> {
        let motion = self.handle.motion(&self.before, self.zoom);
        if motion.is_empty() {
            return None;
        }
        Some(motion.into_iter().chain(self.held.tangent()?).collect())
    }
}

/// The derivatives of the numbers of a lens by the value of each of its handles that moves a
/// parameter, of those too that hold what is locked; handles for which that cannot be held are left
/// out.
pub fn tangents(
    lens: &Lens,
    zoom: usize,
    settings: &DragSettings,
) -> Vec<(Handle, Vec<(Parameter, f64)>)> {
    let space = TangentSpace::new(lens, settings);
    let of_handle = |handle: Handle| {
        let motion = handle.motion(lens, zoom);
        if motion.is_empty() {
            return None;
        }
        let held = space.as_ref().map_or_else(|| Some(Vec::new()), |space| space.held(&motion))?;
        Some((handle, motion.into_iter().chain(held).collect()))
    };
    Handle::all(lens, zoom).into_iter().filter_map(of_handle).collect()
}

/// A short name of a number, as in `R3` for a radius or `t4`, counted from 1.
pub fn short_name(parameter: Parameter) -> String {
    let surface = SurfaceNumber::new(parameter.surface);
    let name = match parameter.quantity {
        // The prescription shows radii.
        Quantity::Curvature => format!("R{surface}"),
        Quantity::Thickness => format!("t{surface}"),
        _ => return parameter.to_string(),
    };
    parameter.zoom.map_or_else(|| name.clone(), |zoom| format!("{name} (zoom {})", zoom + 1))
}
