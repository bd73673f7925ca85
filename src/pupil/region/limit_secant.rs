//! The radii at which one limit alone would end the pupil: the zeros of its margin, by the secant
//! method, for many azimuths in step, so that their rays are traced together.

use super::boundary::{EdgePoint, PupilLimit};
use super::edge_search::{EdgeSearch, GUESS_SPREAD, INSIDE};
use crate::trace::{RayLimit, Rays};

/// The largest number of secant steps.
pub(super) const SECANT_STEPS: usize = 20;
/// The first difference of radii, relative to the guess.
const FIRST_STEP: f64 = 1e-4;
/// A step this short, relative to the guess, is the last.
const LAST_STEP: f64 = 1e-13;
/// The error behind the last step, relative to the guess: about that of rounding.
const LAST_ERROR: f64 = 1e-15;

/// A search for the zero of a margin along one radius.
pub(super) struct LimitSecant {
    guess: f64,
    /// The radius at which the margin is asked for next.
    pub(super) r: f64,
    /// The difference from the radius before.
    step: f64,
    /// The margin at the radius before.
    pub(super) before: f64,
}

/// The outcome of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum SecantStep {
    /// The margin is asked for at another radius.
    Further,
    /// The zero.
    Found(f64),
    /// There is no zero near the guess.
    Lost,
}

impl LimitSecant {
    pub(super) fn new(guess: f64) -> Self {
        Self { guess, r: guess, step: FIRST_STEP * guess, before: f64::NAN }
    }

    /// The radius of the first of the two margins that the method begins with.
    pub(super) fn first(&self) -> f64 {
        self.r - self.step
    }

    /// Takes a step with the margin at the present radius. The error behind a step is less than the
    /// product of the last two steps over the radius.
    pub(super) fn advance(&mut self, margin: f64) -> SecantStep {
        if margin == 0.0 {
            return SecantStep::Found(self.r);
        }
        let next = -margin * self.step / (margin - self.before);
        if !(next.abs() < self.guess) {
            return SecantStep::Lost;
        }
        let error = (next * self.step).abs() / self.guess;
        if next.abs() <= LAST_STEP * self.guess || error <= LAST_ERROR * self.guess {
            return SecantStep::Found(self.r + next);
        }
        (self.before, self.step, self.r) = (margin, next, self.r + next);
        SecantStep::Further
    }
}

impl EdgeSearch<'_> {
    /// The edges at some azimuths, each given with a guess of its radius, along an arc that a limit is
    /// expected to make; `None` where nothing limits the pupil.
    pub(super) fn edges_along_arc(
        &mut self,
        limit: PupilLimit,
        guesses: &[(f64, f64)],
    ) -> Vec<Option<EdgePoint>> {
        let mut edges = self.edges_at_limit(limit, guesses);
        for (edge, (azimuth, guess)) in edges.iter_mut().zip(guesses) {
            if edge.is_none() {
                *edge = self.edge(*azimuth, *guess, GUESS_SPREAD);
            }
        }
        edges
    }

    /// The edges where a given limit makes them: the zeros of its margin alone, provided that a ray
    /// just inside passes all limits.
    fn edges_at_limit(
        &mut self,
        limit: PupilLimit,
        guesses: &[(f64, f64)],
    ) -> Vec<Option<EdgePoint>> {
        let zeros = self.limit_zeros(limit, guesses);
        let radii = zeros.iter().map(|zero| zero.filter(|radius| *radius > 0.0));
        let mut edges: Vec<_> =
            radii.map(|radius| radius.map(|radius| EdgePoint { radius, limit })).collect();
        let inside = |(edge, (azimuth, _)): (&Option<EdgePoint>, &(f64, f64))| {
            let radius = edge.map_or(0.0, |edge| edge.radius);
            self.frame.point(*azimuth, radius * (1.0 - INSIDE))
        };
        let points: Vec<_> = edges.iter().zip(guesses).map(inside).collect();
        self.rays += points.len();
        let passes = self.launch.transmission_mask(&points);
        for (edge, _) in edges.iter_mut().zip(passes).filter(|(_, passes)| !passes) {
            *edge = None;
        }
        edges
    }

    /// The radii at which one limit alone would end the pupil.
    fn limit_zeros(&mut self, limit: PupilLimit, guesses: &[(f64, f64)]) -> Vec<Option<f64>> {
        let PupilLimit::Surface(..) = limit else {
            let zero = |(azimuth, guess): &(f64, f64)| self.limit_zero(limit, *azimuth, *guess);
            return guesses.iter().map(zero).collect();
        };
        let mut searches: Vec<_> =
            guesses.iter().map(|(_, guess)| LimitSecant::new(*guess)).collect();
        let mut zeros = vec![None; guesses.len()];
        let mut open: Vec<usize> = (0..guesses.len()).collect();
        let first = open.iter().map(|i| (guesses[*i].0, searches[*i].first()));
        let margins = self.margins(limit, first.collect());
        searches.iter_mut().zip(margins).for_each(|(search, margin)| search.before = margin);
        for _ in 0..SECANT_STEPS {
            if open.is_empty() {
                break;
            }
            let places = open.iter().map(|i| (guesses[*i].0, searches[*i].r));
            let mut margins = self.margins(limit, places.collect()).into_iter();
            open.retain(|i| match searches[*i].advance(margins.next().unwrap_or(f64::NAN)) {
                SecantStep::Further => true,
                SecantStep::Found(radius) => {
                    zeros[*i] = Some(radius);
                    false
                }
                SecantStep::Lost => false,
            });
        }
        zeros
    }

    /// Functions of the margins of rays at one limit of a surface that have the same zeros, each ray
    /// given by azimuth and radius; NaN for a ray that does not get there. At a rim it is the distance
    /// in mm, which varies almost linearly with the radius.
    fn margins(&mut self, limit: PupilLimit, places: Vec<(f64, f64)>) -> Vec<f64> {
        self.rays += places.len();
        let mut margins = vec![f64::NAN; places.len()];
        let PupilLimit::Surface(surface, ray_limit) = limit else { return margins };
        let mut rays = Rays::with_capacity(places.len());
        let mut launched = Vec::with_capacity(places.len());
        for (i, (azimuth, radius)) in places.into_iter().enumerate() {
            if let Some(ray) = self.launch.ray(self.frame.point(azimuth, radius)) {
                rays.push(ray);
                launched.push(i);
            }
        }
        let channel = self.launch.channel();
        let rim = channel.system.surfaces[surface].semi_diameter;
        let distance = |margin: f64| match ray_limit {
            RayLimit::Rim if margin != 0.0 => margin / (rim + (rim * rim - margin).sqrt()),
            _ => margin,
        };
        let found = channel.tracer.margins_at(&rays, surface, ray_limit);
        launched.into_iter().zip(found).for_each(|(i, margin)| margins[i] = distance(margin));
        margins
    }
}
