//! One door to all estimators: the order, or the number of samples, is raised until the estimated
//! error is what was asked for, and a plan says which estimator a pupil calls for.

use super::{PupilDerivative, QuadraticIntegrand, WarpSampling};
use crate::lens::{RADIAL_TERMS, SystemError};
use crate::pupil::launch::LaunchError;
use crate::pupil::ray_model::Aiming;
use crate::pupil::region::{Accuracy, PupilMoments, Region, RegionKind};
use crate::trace::{Fate, SurfaceParameter, SystemGradient, WarpTracer};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::fmt::{self, Display};
use std::str::FromStr;

/// How the motion of the pupil's edge enters a derivative.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DerivativeEstimator {
    /// Not at all: the rays that get through are kept. Exact while nothing clips, biased elsewhere.
    Biased,
    /// As an integral along the edge: spectral, where the pupil is one piece that a point inside
    /// sees all of.
    Boundary,
    /// Spread over the pupil by a warp field: with a standard error that falls with the root of the
    /// samples or a little faster, whatever the form of the pupil.
    Warp,
    /// By central differences with the edge found anew: no derivative is worked out at all.
    Difference,
}

impl DerivativeEstimator {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Biased, Self::Boundary, Self::Warp, Self::Difference];

    /// What files and command lines call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Biased => "biased",
            Self::Boundary => "boundary",
            Self::Warp => "warp",
            Self::Difference => "difference",
        }
    }
}

impl Display for DerivativeEstimator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for DerivativeEstimator {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|estimator| estimator.name() == text);
        found.ok_or_else(|| format!("expected one of {}", Self::ALL.map(Self::name).join(", ")))
    }
}

/// Why an integral over a pupil has no derivative, or not by the estimator that was asked for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DerivativeError {
    /// No light, so that nothing says where it would come back.
    #[error("no light gets through ({0}), and the derivative of nothing is no way back: {1}")]
    Dark(String, &'static str),
    /// No edge.
    #[error("nothing limits the beam; give the stop or another surface a semi-diameter")]
    Unbounded,
    /// An edge that no point sees all of.
    #[error("{0}, and `boundary` needs one that a point inside sees all of; expected `warp`")]
    NotStarShaped(String),
    /// Samples that are never all inside the square in which they are drawn.
    #[error("the square around the pupil for the warp field was not found")]
    NoSquare,
    /// A lens whose stop cannot limit the beam.
    #[error(transparent)]
    Invalid(#[from] SystemError),
    /// Rays that cannot be started when the stop is to limit the beam.
    #[error(transparent)]
    Launch(#[from] LaunchError),
}

/// What the warp field rounds its number of samples up to, at most.
const REPLICATES: usize = 8;
/// Samples of the warp field at first.
const FIRST: usize = 1024;
/// How many times more at the next try, at least.
const LEAST: f64 = 2.0;
/// And at most: the first standard errors are rough.
const MOST: f64 = 16.0;

/// The derivative of the integral of a cost over a pupil by every number of the lens, each with its
/// estimated error: how much raising the order changed it, the standard error of the warp field, or
/// what the step of a difference leaves open. The bias of `Biased` is in no error.
///
/// The order or the number of samples is raised until [`PupilDerivative::reaches`] the tolerance, or
/// until more rays than allowed would be needed: then the result is what they gave. The noise of the
/// warp field in a kind of numbers with little or no effect counts against what such numbers can do.
/// Where rays are aimed at the stop, its rim limits the beam and moves with its semi-diameter.
///
/// # Errors
/// A pupil without light or edge; `Boundary` for a pupil that is neither star-shaped nor a ring,
/// `WarpSampling` for a lens with an obstruction or a gradient.
pub fn differentiate(
    region: &Region<'_>,
    cost: &QuadraticIntegrand,
    estimator: DerivativeEstimator,
    asked: Accuracy,
) -> Result<PupilDerivative, DerivativeError> {
    let launch = &region.launch;
    if launch.model.aiming == Aiming::Stop {
        let model = launch.model.limited_by_stop()?;
        let limited = Region::new(model.launch(launch.field, launch.wavelength)?);
        return differentiate(&limited, cost, estimator, asked);
    }
    region.check_edge()?;
    match (estimator, &region.kind) {
        (DerivativeEstimator::Boundary, RegionKind::Irregular { pieces, annulus: None, .. }) => {
            Err(DerivativeError::NotStarShaped(describe_pieces(*pieces)))
        }
        (DerivativeEstimator::Warp, _) => {
            WarpTracer::<f64>::new(&launch.channel().system)?;
            region.sampled_derivative(cost, asked)
        }
        (
            DerivativeEstimator::Biased
            | DerivativeEstimator::Boundary
            | DerivativeEstimator::Difference,
            _,
        ) => region.ordered_derivative(cost, estimator, asked),
    }
}

/// Which estimator a pupil calls for, and why.
///
/// # Errors
/// A pupil without light or edge has no derivative.
pub fn choose_estimator(
    region: &Region<'_>,
    asked: Accuracy,
) -> Result<(DerivativeEstimator, String), DerivativeError> {
    region.check_edge()?;
    match &region.kind {
        RegionKind::StarShaped(boundary) => {
            let arcs = boundary.arcs.len();
            let edge = if arcs == 1 { "one arc".to_owned() } else { format!("{arcs} arcs") };
            let reason = format!("the pupil is one piece with an edge of {edge}");
            Ok((DerivativeEstimator::Boundary, reason))
        }
        RegionKind::Irregular { annulus: Some(_), .. } => {
            Ok((DerivativeEstimator::Boundary, "the pupil is a ring around a shadow".to_owned()))
        }
        RegionKind::Irregular { pieces, .. } if region.launch.channel().system.has_grin() => {
            let reason = format!("{}, and a gradient has no warp field", describe_pieces(*pieces));
            Ok((DerivativeEstimator::Difference, reason))
        }
        RegionKind::Irregular { pieces, .. } => {
            let shape = describe_pieces(*pieces);
            let best = WARP_ERROR / (asked.max_rays.max(1) as f64).sqrt();
            let reason = if best > asked.tolerance {
                format!(
                    "{shape}; the standard error will be about {best:.0e} after {} rays and not \
                     the {:.0e} that are asked for",
                    asked.max_rays, asked.tolerance
                )
            } else {
                shape
            };
            Ok((DerivativeEstimator::Warp, reason))
        }
        RegionKind::Clear | RegionKind::Dark | RegionKind::Unbounded => Ok((
            DerivativeEstimator::Boundary,
            "nothing clips the pupil: its edge does not move".to_owned(),
        )),
    }
}

/// The standard error of the warp field times the root of the rays, relative to the largest of a
/// group: about the worst of the groups of a double Gauss at 14 degrees.
const WARP_ERROR: f64 = 2.0;

fn describe_pieces(pieces: usize) -> String {
    if pieces == 1 {
        "the pupil is not star-shaped".to_owned()
    } else {
        format!("the pupil is in {pieces} pieces")
    }
}

impl Region<'_> {
    fn check_edge(&self) -> Result<(), DerivativeError> {
        match self.kind {
            RegionKind::Dark => {
                let (found, way_back) = self.explain_darkness();
                Err(DerivativeError::Dark(found, way_back))
            }
            RegionKind::Unbounded => Err(DerivativeError::Unbounded),
            RegionKind::Clear | RegionKind::StarShaped(_) | RegionKind::Irregular { .. } => Ok(()),
        }
    }

    /// What happens to the ray through the centre of a dark pupil, and what would help.
    fn explain_darkness(&self) -> (String, &'static str) {
        const NEARER: &str = "take a field nearer to the axis or a larger semi-diameter";
        let launch = &self.launch;
        if launch.model.stop_radius() == 0.0 {
            return ("the stop has the radius 0".to_owned(), "open the stop");
        }
        let Some(ray) = launch.ray([0.0; 2]) else {
            return ("no ray through the centre of the stop is found".to_owned(), NEARER);
        };
        match launch.channel().tracer.trace(ray).fate {
            Fate::Imaged => ("only single rays do".to_owned(), "enlarge the semi-diameters"),
            Fate::Clipped(i) => {
                let found = format!("the ray through the centre is clipped by surface {i}");
                (found, "enlarge its semi-diameter or take a field nearer to the axis")
            }
            Fate::Missed(i) => {
                let found = format!("the ray through the centre misses surface {i}");
                (found, "flatten it or take a field nearer to the axis")
            }
            Fate::TotalReflection(i) => {
                let found =
                    format!("the ray through the centre is totally reflected at surface {i}");
                (found, "flatten it or take a field nearer to the axis")
            }
            Fate::Turned(i) | Fate::Trapped(i) => {
                let found = format!(
                    "the gradient in front of surface {i} keeps the ray through the centre"
                );
                (found, "weaken it or take a field nearer to the axis")
            }
        }
    }

    /// Raises the order of quadrature.
    fn ordered_derivative(
        &self,
        cost: &QuadraticIntegrand,
        estimator: DerivativeEstimator,
        asked: Accuracy,
    ) -> Result<PupilDerivative, DerivativeError> {
        let mut rays = self.rays;
        let mut before: Option<PupilDerivative> = None;
        let mut last = 0;
        for order in 0..self.orders() {
            // An order takes about twice the rays of the one before.
            if rays + 2 * last > asked.max_rays && before.is_some() {
                break;
            }
            let mut now = self.at_order(cost, estimator, order)?;
            last = now.rays;
            rays += last;
            now.rays = rays;
            now.add_order_error(before.as_ref());
            if now.reaches(asked.tolerance) {
                return Ok(now);
            }
            before = Some(now);
        }
        before.ok_or(DerivativeError::Unbounded)
    }

    /// The derivative at one order; the rays are those of this order alone.
    fn at_order(
        &self,
        cost: &QuadraticIntegrand,
        estimator: DerivativeEstimator,
        order: usize,
    ) -> Result<PupilDerivative, DerivativeError> {
        let lit = self.trace_pupil(order);
        let natural = natural_size(cost, &lit.moments);
        if estimator == DerivativeEstimator::Difference {
            let found = self.difference_derivative(cost, order);
            let mut found = found.ok_or(DerivativeError::Unbounded)?;
            found.drop_rounding(DIFFERENCE_ROUNDING, natural);
            return Ok(found);
        }
        let by = match estimator {
            DerivativeEstimator::Biased => lit.biased_derivative(cost),
            _ => lit.boundary_derivative(cost).ok_or(DerivativeError::Unbounded)?,
        };
        let error = SystemGradient::zero(by.surfaces.len());
        let mut found = PupilDerivative { error, gradient: by, rays: lit.rays_traced };
        found.drop_rounding(ROUNDING, natural);
        Ok(found)
    }

    /// Raises the number of samples of the warp field.
    fn sampled_derivative(
        &self,
        cost: &QuadraticIntegrand,
        asked: Accuracy,
    ) -> Result<PupilDerivative, DerivativeError> {
        // Numbers without an effect are never more than noise: it must be small against what
        // numbers of their kind can do.
        let natural = natural_size(cost, &self.trace_pupil(0).moments);
        let mut count = FIRST;
        let mut rays = 0;
        loop {
            let sampling = WarpSampling { count, ..WarpSampling::default() };
            let mut found =
                self.warp_derivative(cost, sampling).ok_or(DerivativeError::NoSquare)?;
            let overhead = found.rays.saturating_sub(count);
            rays += found.rays;
            found.rays = rays;
            let excess = found.excess(asked.tolerance, |slot| NOTABLE * natural(slot));
            let wanted = (count as f64 * (excess * excess).clamp(LEAST, MOST)) as usize;
            let next = wanted.min(asked.max_rays.saturating_sub(rays + overhead + REPLICATES));
            if excess <= 1.0 || (next as f64) < LEAST * count as f64 {
                return Ok(found);
            }
            count = next;
        }
    }
}

/// Of the natural size: what the noise of numbers without an effect is measured against.
const NOTABLE: f64 = 0.1;
/// A derivative this much smaller than its natural size is rounding.
const ROUNDING: f64 = 1e-13;
/// The same where it was divided by a small step.
const DIFFERENCE_ROUNDING: f64 = 1e-9;

impl PupilDerivative {
    /// Adds what raising the order has changed to the errors; all of it where this is the first
    /// one. A number cannot be known better, relatively, than the worst of its kind: some of them
    /// always change little by chance.
    fn add_order_error(&mut self, before: Option<&Self>) {
        let Some(before) = before else {
            self.error = self.gradient.zip_with(&self.gradient, |_, _| f64::INFINITY);
            return;
        };
        let change = self.gradient.zip_with(&before.gradient, |a, b| (a - b).abs());
        self.error = self.error.zip_with(&change, |a, b| a + b);
        for slot in SurfaceParameter::all() {
            let [worst, largest] = [&self.error, &self.gradient].map(|g| g.largest(slot));
            let share = if largest > 0.0 { (worst / largest).min(1.0) } else { 0.0 };
            for (error, by) in self.error.surfaces.iter_mut().zip(&self.gradient.surfaces) {
                let error = error.by_mut(slot);
                *error = error.max(share * by.by(slot).abs());
            }
        }
    }

    /// Sets to zero the kinds of numbers on which the integral depends by no more than rounding.
    fn drop_rounding(&mut self, rounding: f64, natural: impl Fn(SurfaceParameter) -> f64) {
        let Self { gradient: by, error, .. } = self;
        for slot in SurfaceParameter::all() {
            if by.largest(slot) > rounding * natural(slot) {
                continue;
            }
            for numbers in [&mut *by, &mut *error] {
                numbers.surfaces.iter_mut().for_each(|surface| *surface.by_mut(slot) = 0.0);
                if slot == SurfaceParameter::Index {
                    numbers.index_before = 0.0;
                }
            }
        }
    }
}

/// How large the derivative by a number of some kind is that does what it can: the integral over
/// the pupil's radius in the unit of the number.
fn natural_size(
    cost: &QuadraticIntegrand,
    light: &PupilMoments,
) -> impl Fn(SurfaceParameter) -> f64 + use<> {
    let size = (light.area / PI).sqrt();
    let positive =
        QuadraticIntegrand { square: cost.square.abs(), constant: cost.constant.abs(), ..*cost };
    let integral = positive.integrate(light);
    move |slot| {
        let power = match slot {
            SurfaceParameter::Curvature => 1,
            SurfaceParameter::Conic | SurfaceParameter::Index => 0,
            SurfaceParameter::AsphereTerm(term) => 2 * term as i32 + 3,
            SurfaceParameter::Thickness | SurfaceParameter::SemiDiameter => -1,
            SurfaceParameter::GrinTerm(k) => match k.checked_sub(RADIAL_TERMS) {
                None => 2 * (k as i32 + 1),
                Some(j) => j as i32 + 1,
            },
        };
        integral * size.powi(power)
    }
}
