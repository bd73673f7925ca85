//! The common interface of all estimators: the order of quadrature, or the number of samples, is
//! raised until the estimated error is within the tolerance; and the choice of an estimator for a
//! pupil.

use super::{PupilDerivative, QuadraticIntegrand, WarpSampling};
use crate::lens::{APERTURE_NUMBERS, RADIAL_TERMS, SurfaceNumber, SystemError};
use crate::pupil::launch::LaunchError;
use crate::pupil::ray_model::Aiming;
use crate::pupil::region::{Accuracy, PupilMoments, Region, RegionKind, order_error};
use crate::trace::{Fate, SurfaceParameter, SystemGradient, WarpTracer};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::fmt::{self, Display};
use std::str::FromStr;

/// The treatment of the motion of the pupil's edge in a derivative.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DerivativeEstimator {
    /// Ignored: the same rays get through. Exact if nothing clips, biased otherwise.
    Biased,
    /// An integral along the edge: converges spectrally; for a pupil that is star-shaped or an
    /// annulus.
    Boundary,
    /// A warp field spread over the pupil: with a standard error that falls with the square root of
    /// the number of samples or a little faster, for any form of the pupil.
    Warp,
    /// Central differences with the edge searched for again: no derivative is computed.
    Difference,
}

impl DerivativeEstimator {
    /// All estimators.
    pub const ALL: [Self; 4] = [Self::Biased, Self::Boundary, Self::Warp, Self::Difference];

    /// The name in files and on the command line.
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

/// The reason why an integral over a pupil has no derivative, or not by the chosen estimator.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DerivativeError {
    /// No light: the reason, and a remedy.
    #[error("no light gets through ({0}), so there is no derivative; {1}")]
    Dark(String, &'static str),
    /// Nothing limits the beam.
    #[error("nothing limits the beam; give the stop or another surface a semi-diameter")]
    Unbounded,
    /// A pupil that is neither star-shaped nor an annulus; its form.
    #[error("{0}, and `boundary` needs a star-shaped pupil or an annulus; expected `warp`")]
    NotStarShaped(String),
    /// No square was found that holds all samples of the warp field.
    #[error("the square around the pupil for the warp field was not found")]
    NoSquare,
    /// The lens cannot be limited by its stop.
    #[error(transparent)]
    Invalid(#[from] SystemError),
    /// No rays can be launched with the stop as limit.
    #[error(transparent)]
    Launch(#[from] LaunchError),
}

/// The number of samples of the warp field is rounded up by at most this.
const REPLICATES: usize = 8;
/// The first number of samples of the warp field.
const FIRST: usize = 1024;
/// The smallest factor between numbers of samples.
const LEAST: f64 = 2.0;
/// The largest factor between numbers of samples: the first standard errors are rough.
const MOST: f64 = 16.0;

/// The derivative of an integral over a pupil by every number of the lens, each with its estimated
/// error: its change by the last raising of the order, the standard error of the warp field, or the
/// correction of a difference. The bias of `Biased` is in no error.
///
/// The order or the number of samples is raised until [`PupilDerivative::reaches`] the tolerance,
/// or until more rays than allowed would be needed: then the result is the best so far. For the
/// warp field, the noise of a kind of numbers with little or no effect is compared with the effect
/// that such numbers can have. If rays are aimed at the stop, its rim limits the beam and moves
/// with its semi-diameter.
///
/// # Errors
/// A pupil without light or edge; `Boundary` for a pupil that is neither star-shaped nor an
/// annulus, `Warp` for a lens without a warp field.
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

/// Chooses the estimator for a pupil, with the reason.
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
        RegionKind::Irregular { annulus: Some(_), .. } => Ok((
            DerivativeEstimator::Boundary,
            "the pupil is an annulus around an obstruction".to_owned(),
        )),
        RegionKind::Irregular { pieces, .. } if !region.launch.model.has_warp_field() => {
            let reason = format!(
                "{}, and a gradient-index gap, a tilted or freeform surface has no warp field",
                describe_pieces(*pieces)
            );
            Ok((DerivativeEstimator::Difference, reason))
        }
        RegionKind::Irregular { pieces, .. } => {
            let shape = describe_pieces(*pieces);
            let best = WARP_ERROR / (asked.max_rays.max(1) as f64).sqrt();
            let reason = if best > asked.tolerance {
                format!(
                    "{shape}; the standard error will be about {best:.0e} after {} rays and not \
                     the tolerance of {:.0e}",
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

/// The standard error of the warp field times the square root of the number of rays, relative to
/// the largest number of a kind: about the worst kind of a double Gauss at 14 degrees.
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

    /// The fate of the ray through the centre of a dark pupil, and a remedy.
    fn explain_darkness(&self) -> (String, &'static str) {
        const NEARER: &str = "take a field nearer to the axis or a larger semi-diameter";
        const FLATTEN: &str = "flatten it or take a field nearer to the axis";
        let launch = &self.launch;
        if launch.model.stop_radius() == 0.0 {
            return ("the stop has the radius 0".to_owned(), "open the stop");
        }
        let Some(ray) = launch.ray([0.0; 2]) else {
            return ("no ray through the centre of the stop is found".to_owned(), NEARER);
        };
        let fate = launch.channel().tracer.trace(ray).fate;
        let (found, remedy) = match fate {
            Fate::Imaged => {
                return ("only single rays do".to_owned(), "enlarge the semi-diameters");
            }
            Fate::Clipped(_) => {
                ("is clipped by", "enlarge its semi-diameter or take a field nearer to the axis")
            }
            Fate::Missed(_) => ("misses", FLATTEN),
            Fate::TotalReflection(_) => ("is totally reflected at", FLATTEN),
            Fate::Turned(_) | Fate::Trapped(_) => (
                "does not leave the gradient before",
                "weaken it or take a field nearer to the axis",
            ),
        };
        let surface = SurfaceNumber::new(fate.surface().unwrap_or_default());
        (format!("the ray through the centre {found} surface {surface}"), remedy)
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
            let (mut now, natural) = self.at_order(cost, estimator, order)?;
            last = now.rays;
            rays += last;
            now.rays = rays;
            // A first change alone does not tell an agreement by chance.
            let is_confirmed = order > 1;
            now.add_order_error(before.as_ref());
            now.reached = is_confirmed && now.reaches_but_for_rounding(asked.tolerance, natural);
            if now.reached {
                return Ok(now);
            }
            before = Some(now);
        }
        before.ok_or(DerivativeError::Unbounded)
    }

    /// The derivative at one order, and the natural size of that by a number of each kind; the rays are those
    /// of this order alone.
    fn at_order(
        &self,
        cost: &QuadraticIntegrand,
        estimator: DerivativeEstimator,
        order: usize,
    ) -> Result<(PupilDerivative, impl Fn(SurfaceParameter) -> f64 + use<>), DerivativeError> {
        let lit = self.trace_pupil(order);
        let natural = natural_size(cost, &lit.moments);
        if estimator == DerivativeEstimator::Difference {
            let found = self.difference_derivative(cost, order);
            let mut found = found.ok_or(DerivativeError::Unbounded)?;
            found.drop_rounding(DIFFERENCE_ROUNDING, &natural);
            return Ok((found, natural));
        }
        let by = match estimator {
            DerivativeEstimator::Biased => lit.biased_derivative(cost),
            _ => lit.boundary_derivative(cost).ok_or(DerivativeError::Unbounded)?,
        };
        let error = SystemGradient::zero(by.surfaces.len());
        let mut found =
            PupilDerivative { error, gradient: by, rays: lit.rays_traced, reached: false };
        found.drop_rounding(ROUNDING, &natural);
        Ok((found, natural))
    }

    /// Raises the number of samples of the warp field.
    fn sampled_derivative(
        &self,
        cost: &QuadraticIntegrand,
        asked: Accuracy,
    ) -> Result<PupilDerivative, DerivativeError> {
        // Numbers without an effect are only noise: it must be small against the effect that
        // numbers of their kind can have.
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
            found.reached = excess <= 1.0;
            if found.reached || (next as f64) < LEAST * count as f64 {
                return Ok(found);
            }
            count = next;
        }
    }
}

/// The error of an order of a derivative in multiples of its last change: where an edge is a total
/// reflection, changes fall unevenly.
const CHANGES: f64 = 3.0;
/// The part of the natural size that the noise of numbers without an effect is compared with.
const NOTABLE: f64 = 0.1;
/// A derivative this much smaller than its natural size is rounding.
const ROUNDING: f64 = 1e-13;
/// The same for a derivative that was divided by a small step.
const DIFFERENCE_ROUNDING: f64 = 1e-9;

impl PupilDerivative {
    /// Adds three times the change by the last raising of the order to the errors; all of the derivative if this
    /// is the first order. The relative error of a number is at least that of the worst of its kind, since
    /// some change little by chance, and that of a kind falls as those of other integrals over the pupil.
    fn add_order_error(&mut self, before: Option<&Self>) {
        let Some(before) = before else {
            self.error = self.gradient.zip_with(&self.gradient, |_, _| f64::INFINITY);
            return;
        };
        let change = self.gradient.zip_with(&before.gradient, |a, b| CHANGES * (a - b).abs());
        self.error = self.error.zip_with(&change, |a, b| a + b);
        for slot in self.error.kinds() {
            let worst = order_error(self.error.largest(slot), before.error.largest(slot));
            let largest = self.gradient.largest(slot);
            let share = if largest > 0.0 { (worst / largest).min(1.0) } else { 0.0 };
            for (error, by) in self.error.surfaces.iter_mut().zip(&self.gradient.surfaces) {
                let larger = error.by(slot).max(share * by.by(slot).abs());
                error.set(slot, larger);
            }
        }
    }

    /// True if the error of every number is within a tolerance of the largest of its kind, or is no more than
    /// the rounding of the numbers on which the integral depends most: the indices of a large telescope
    /// change its spot by what is left of terms that cancel.
    fn reaches_but_for_rounding(
        &self,
        tolerance: f64,
        natural: impl Fn(SurfaceParameter) -> f64,
    ) -> bool {
        let ratio = |slot| self.gradient.largest(slot) / natural(slot);
        let [curvature, thickness] =
            [SurfaceParameter::Curvature, SurfaceParameter::Thickness].map(ratio);
        let largest = curvature.max(thickness).max(1.0);
        let rounding = |slot| ROUNDING * largest * natural(slot);
        self.excess(tolerance, |slot| rounding(slot) / tolerance) <= 1.0
    }

    /// Sets the kinds of numbers to zero on which the integral depends by no more than rounding.
    fn drop_rounding(&mut self, rounding: f64, natural: impl Fn(SurfaceParameter) -> f64) {
        let Self { gradient: by, error, .. } = self;
        for slot in by.kinds() {
            if by.largest(slot) > rounding * natural(slot) {
                continue;
            }
            for numbers in [&mut *by, &mut *error] {
                numbers.surfaces.iter_mut().for_each(|surface| surface.set(slot, 0.0));
                if slot == SurfaceParameter::Index {
                    numbers.index_before = 0.0;
                }
            }
        }
    }
}

/// The natural size of the derivative by a number of a kind: the integral divided by the pupil's
/// radius in the unit of the number.
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
            SurfaceParameter::Aperture(k) if k % APERTURE_NUMBERS == APERTURE_NUMBERS - 1 => 0,
            // The power of the length depends on the kind of a form; rounding is far below.
            SurfaceParameter::Thickness
            | SurfaceParameter::SemiDiameter
            | SurfaceParameter::Freeform(_)
            | SurfaceParameter::Aperture(_) => -1,
            SurfaceParameter::GrinTerm(k) => match k.checked_sub(RADIAL_TERMS) {
                None => 2 * (k as i32 + 1),
                Some(j) => j as i32 + 1,
            },
        };
        integral * size.powi(power)
    }
}
