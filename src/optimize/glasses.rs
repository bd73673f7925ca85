//! Exchange of glasses: others of the catalogue are tried in place of each one, and what gains is kept.
//!
//! Another glass moves the focus by more than one step of the variables takes back, so the powers of its
//! surfaces are held first: their curvatures follow the change of the index. The merit with each glass at
//! each place is predicted from one evaluation. The exchanges that promise a merit of the size of the present
//! one are tried first, in a random order, since predictions tell what is hopeless better than what is best;
//! eight at a time, each with some steps of optimization; the best of them goes on.

use super::glass_prediction::GlassModel;
use super::{DescentMethod, Optimizer, start_from};
use crate::lens::glass::{self, Glass};
use crate::lens::{Lens, Medium, Parameter, Quantity, SurfaceNumber, System};
use crate::merit::{Goal, Merit, MeritError};
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::Serialize;

/// The number of exchanges that are optimized in a round.
const TRIALS: usize = 8;
/// The steps of such a trial, and those of the best one of a round.
const TRIAL_STEPS: usize = 20;
const FINAL_STEPS: usize = 200;
/// The merit of the best trial, relative to the present one, up to which it is optimized further.
const PROMISING: f64 = 1.5;
/// The predicted merit, relative to the present one, up to which an exchange is tried before others.
const PROMISED: f64 = 3.0;
/// The least gain of an exchange that is taken, relative to the merit.
const LEAST_GAIN: f64 = 1e-3;
/// The rounds without a gain after which the search ends.
const PATIENCE: usize = 5;
/// A lens that needs this many times the rays of the present one is not optimized: its pupils are in pieces.
const MOST_RAYS: usize = 8;
/// The change of a curvature up to which it follows the index.
const LARGEST_BENDING: f64 = 2.0;

/// Another glass in place of one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlassExchange {
    /// The surface in front of the glass.
    pub surface: SurfaceNumber,
    /// The glass before, as in lens files.
    pub from: String,
    /// The glass in its place.
    pub to: String,
    /// The merit after optimization as it was predicted; `None` if it was not.
    pub predicted: Option<f64>,
    /// The merit after optimization; `None` if the lens with it cannot be optimized.
    pub merit: Option<f64>,
}

/// The result of a round.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlassRound {
    /// The exchanges that were optimized.
    pub tried: Vec<GlassExchange>,
    /// The exchange that was taken, with its merit at the end.
    pub accepted: Option<GlassExchange>,
    /// The best merit so far.
    pub merit: f64,
    /// The evaluations of the merit so far, with derivatives or without them.
    pub evaluations: usize,
    /// True if further rounds would gain nothing.
    pub finished: bool,
}

/// The fault of a search among glasses.
#[derive(Debug, thiserror::Error)]
pub enum GlassSearchError {
    /// The lens has no glass of the catalogue and no model glass.
    #[error("the lens has no glass that another one could replace")]
    NoGlass,
    /// No permitted glass has an index at every wavelength.
    #[error("no glass that matches has an index at every wavelength of the lens")]
    NoCandidate,
    /// The lens has no merit.
    #[error(transparent)]
    Merit(#[from] MeritError),
}

/// A search among glasses, one round at a time: the caller owns the loop.
///
/// Model glasses are replaced first, one a round, by the glass with which the merit is lowest, even if
/// that is higher than before: nobody melts a model glass.
#[derive(Debug)]
pub struct GlassSearch {
    goal: Goal,
    tolerance: f64,
    glasses: Vec<&'static Glass>,
    seed: u64,
    /// True if exchanges that promise nothing wait.
    is_guided: bool,
    /// The light of the first lens, which limits of light compare with.
    initial_light: Vec<Vec<f64>>,
    best: Lens,
    merit: f64,
    /// The merit function of the best lens with its pupils, until they are predicted with.
    judged: Option<Merit>,
    /// The rays of one evaluation of the first lens.
    rays: usize,
    /// The exchanges of the best lens that were not tried yet.
    waiting: Option<Vec<Exchanged>>,
    evaluations: usize,
    rounds: u64,
    /// The rounds since the last gain.
    idle: usize,
}

/// A lens with another glass.
#[derive(Debug, Clone)]
struct Exchanged {
    exchange: GlassExchange,
    lens: Lens,
    /// The distance of the two glasses: 0.01 in index count as much as 1.5 in Abbe number.
    distance: f64,
    /// The merit function of the lens with its pupils, once it is optimized.
    judged: Option<Merit>,
}

/// A lens after some steps of optimization.
struct Descended {
    lens: Lens,
    /// Its merit with its limits as penalties.
    merit: f64,
    /// The merit function with its pupils.
    judged: Merit,
    /// The evaluations of the merit.
    evaluations: usize,
}

/// A trial and the evaluations that it took.
type Trial = (Exchanged, usize);

impl GlassSearch {
    /// A search from a lens that was optimized, among some glasses, whose order depends on a seed.
    ///
    /// # Errors
    /// A lens without a glass to exchange, glasses without an index, or a lens without a merit.
    pub fn new(
        lens: &Lens,
        goal: &Goal,
        tolerance: f64,
        glasses: impl IntoIterator<Item = &'static Glass>,
        seed: u64,
    ) -> Result<Self, GlassSearchError> {
        if sites(lens).is_empty() {
            return Err(GlassSearchError::NoGlass);
        }
        let has_index =
            |glass: &&Glass| lens.wavelengths.iter().all(|wave| glass.index(wave.um).is_some());
        let glasses = glass::distinct(glasses.into_iter().filter(has_index));
        if glasses.is_empty() {
            return Err(GlassSearchError::NoCandidate);
        }
        let merit = Merit::new(lens, goal, tolerance)?;
        Ok(Self {
            merit: merit.value(&merit.values(lens))?,
            initial_light: merit.initial_light().to_vec(),
            rays: rays(&merit),
            goal: goal.clone(),
            tolerance,
            glasses,
            seed,
            is_guided: true,
            best: lens.clone(),
            judged: Some(merit),
            waiting: None,
            evaluations: 1,
            rounds: 0,
            idle: 0,
        })
    }

    /// The same search with exchanges in a random order, whatever they promise.
    #[must_use]
    pub fn without_predictions(mut self) -> Self {
        self.is_guided = false;
        self
    }

    /// The best lens so far.
    pub fn best(&self) -> &Lens {
        &self.best
    }

    /// The merit of the best lens.
    pub fn merit(&self) -> f64 {
        self.merit
    }

    /// An optimizer of the best lens, whose light is compared with that of the first one.
    ///
    /// # Errors
    /// A lens without a merit.
    pub fn resume(&self) -> Result<Box<dyn Optimizer>, MeritError> {
        let merit = match self.judged.clone() {
            Some(merit) => merit,
            None => self.judge(&self.best)?,
        };
        start_from(DescentMethod::TrustRegion, merit, &self.best, self.tolerance)
    }

    /// Goes on from another lens with glasses to exchange, whose light is compared with that of the first
    /// one.
    ///
    /// # Errors
    /// A lens without a merit.
    pub fn restart(&mut self, lens: &Lens) -> Result<(), MeritError> {
        let merit = self.judge(lens)?;
        self.merit = merit.value(&merit.values(lens))?;
        (self.best, self.judged) = (lens.clone(), Some(merit));
        (self.waiting, self.idle) = (None, 0);
        Ok(())
    }

    /// Optimizes the next exchanges, and takes the best one if it gains.
    ///
    /// # Errors
    /// A lens without a merit.
    pub fn round(&mut self) -> Result<GlassRound, GlassSearchError> {
        self.rounds += 1;
        let mut waiting = match self.waiting.take() {
            Some(waiting) => waiting,
            None => self.exchanges(),
        };
        let rest = waiting.split_off(TRIALS.min(waiting.len()));
        let chosen = std::mem::replace(&mut waiting, rest);
        let trials: Vec<Trial> = chosen
            .into_par_iter()
            .map(|exchanged| self.optimized(exchanged, TRIAL_STEPS))
            .collect();
        self.evaluations += trials.iter().map(|(_, used)| used).sum::<usize>();
        let tried = trials.iter().map(|(tried, _)| tried.exchange.clone()).collect();
        let accepted = self.take_best(trials);
        self.idle = if accepted.is_some() { 0 } else { self.idle + 1 };
        let is_over = waiting.is_empty() || self.idle >= PATIENCE;
        self.waiting = accepted.is_none().then_some(waiting);
        Ok(GlassRound {
            tried,
            finished: accepted.is_none() && is_over,
            accepted,
            merit: self.merit,
            evaluations: self.evaluations,
        })
    }

    /// Optimizes the best trial further, and makes it the best lens if it gains, or if it replaces a
    /// model glass.
    fn take_best(&mut self, trials: Vec<Trial>) -> Option<GlassExchange> {
        let is_forced = has_model_glass(&self.best);
        let value = |trial: &Trial| trial.0.exchange.merit.unwrap_or(f64::INFINITY);
        let best = trials.into_iter().min_by(|a, b| value(a).total_cmp(&value(b)))?;
        if value(&best) == f64::INFINITY || !(is_forced || value(&best) < PROMISING * self.merit) {
            return None;
        }
        let (found, used) = self.optimized(best.0, FINAL_STEPS);
        self.evaluations += used;
        let merit = found.exchange.merit?;
        if !is_forced && merit > (1.0 - LEAST_GAIN) * self.merit {
            return None;
        }
        (self.best, self.merit, self.judged) = (found.lens, merit, found.judged);
        Some(found.exchange)
    }

    /// A lens with another glass after some steps; its merit is `None` if it cannot be optimized.
    fn optimized(&self, mut exchanged: Exchanged, steps: usize) -> Trial {
        let Some(found) = self.descend(&exchanged.lens, steps) else {
            exchanged.exchange.merit = None;
            return (exchanged, 1);
        };
        exchanged.exchange.merit = Some(found.merit);
        (exchanged.lens, exchanged.judged) = (found.lens, Some(found.judged));
        (exchanged, found.evaluations)
    }

    /// The merit function of a lens, whose light is compared with that of the first one.
    fn judge(&self, lens: &Lens) -> Result<Merit, MeritError> {
        let merit = Merit::new(lens, &self.goal, self.tolerance)?;
        Ok(merit.with_initial_light(&self.initial_light))
    }

    /// A lens after some steps; `None` if it cannot be optimized.
    fn descend(&self, lens: &Lens, steps: usize) -> Option<Descended> {
        let merit = Merit::new(lens, &self.goal, self.tolerance).ok()?;
        if rays(&merit) > MOST_RAYS * self.rays {
            return None;
        }
        let merit = merit.with_initial_light(&self.initial_light);
        let method = DescentMethod::TrustRegion;
        let mut optimizer = start_from(method, merit, lens, self.tolerance).ok()?;
        let mut evaluations = 0;
        for _ in 0..steps {
            let progress = optimizer.step();
            evaluations = progress.evaluations;
            if progress.finished {
                break;
            }
        }
        optimizer.verify_best();
        let terms = optimizer.terms().ok()?;
        let merit = terms.iter().map(|term| term.weight * term.value).sum::<f64>();
        let judged = self.judge(optimizer.best()).ok()?;
        let lens = optimizer.best().clone();
        let is_lit = judged.has_light();
        (merit.is_finite() && is_lit).then_some(Descended { lens, merit, judged, evaluations })
    }

    /// All exchanges of the best lens in a random order, those first that promise something; without
    /// predictions those of a model glass for the nearest ones first.
    fn exchanges(&mut self) -> Vec<Exchanged> {
        let pairs: Vec<(usize, &Glass)> = sites(&self.best)
            .into_iter()
            .flat_map(|row| self.glasses.iter().map(move |glass| (row, *glass)))
            .collect();
        let with = |(row, glass): &(usize, &Glass)| exchanged(&self.best, *row, glass);
        let mut all: Vec<Exchanged> = pairs.par_iter().filter_map(with).collect();
        let seed = self.seed.wrapping_add(self.rounds);
        all.shuffle(&mut Xoshiro256PlusPlus::seed_from_u64(seed));
        if self.is_guided && self.predict(&mut all) {
            let most = PROMISED * self.merit;
            all.sort_by_key(|one| !one.exchange.predicted.is_some_and(|merit| merit <= most));
        } else if has_model_glass(&self.best) {
            all.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        }
        all
    }

    /// Predicts the merits of exchanges; false if the best lens allows no prediction.
    fn predict(&mut self, all: &mut [Exchanged]) -> bool {
        let judged = self.judged.take().map_or_else(|| self.judge(&self.best), Ok);
        let Ok(merit) = judged else { return false };
        self.evaluations += 1;
        let Ok(Some(model)) = GlassModel::new(merit, &self.best, &sites(&self.best)) else {
            return false;
        };
        let waves = &self.best.wavelengths;
        all.par_iter_mut().for_each(|one| {
            let glass = glass::find(&one.exchange.to);
            let indices: Option<Vec<f64>> =
                glass.and_then(|glass| waves.iter().map(|wave| glass.index(wave.um)).collect());
            let row = one.exchange.surface.index();
            one.exchange.predicted =
                indices.and_then(|indices| model.predict(&one.lens, row, &indices));
        });
        true
    }
}

/// The rays of one evaluation.
fn rays(merit: &Merit) -> usize {
    merit.spot_samplings().iter().map(|spot| spot.rays).sum()
}

/// True if a glass is a model.
fn is_model(medium: &Medium) -> bool {
    matches!(medium, Medium::Model { .. })
}

fn has_model_glass(lens: &Lens) -> bool {
    lens.surfaces.iter().any(|row| is_model(&row.medium))
}

/// The rows whose glass is exchanged: the first model glass, or else all glasses of the catalogue.
fn sites(lens: &Lens) -> Vec<usize> {
    let of = |is_it: fn(&Medium) -> bool| {
        let rows = lens.surfaces.iter().enumerate();
        rows.filter(move |(_, row)| is_it(&row.medium)).map(|(i, _)| i)
    };
    match of(is_model).next() {
        Some(first) => vec![first],
        None => of(|medium| matches!(medium, Medium::Glass(_))).collect(),
    }
}

/// The lens with another glass behind a row, and with the powers of its two surfaces as they were;
/// `None` if it is the same glass, or the lens cannot have it.
fn exchanged(lens: &Lens, row: usize, glass: &Glass) -> Option<Exchanged> {
    let to = glass.full_name();
    let from = match &lens.surfaces[row].medium {
        Medium::Glass(name) => glass::find(name).map_or_else(|| name.clone(), Glass::full_name),
        Medium::Model { nd, vd } => format!("nd {nd}, vd {vd}"),
        _ => return None,
    };
    if from == to {
        return None;
    }
    let other = with_medium(lens, row, Medium::Glass(to.clone()))?;
    let surface = SurfaceNumber::new(row);
    let exchange = GlassExchange { surface, from, to, predicted: None, merit: None };
    let distance = distance(lens, row, glass)?;
    Some(Exchanged { exchange, lens: other, distance, judged: None })
}

/// The distance of a glass from that behind a row.
fn distance(lens: &Lens, row: usize, glass: &Glass) -> Option<f64> {
    let [nd, vd] = match &lens.surfaces[row].medium {
        Medium::Glass(name) => glass::find(name).map(|glass| [glass.nd, glass.vd])?,
        Medium::Model { nd, vd } => [*nd, *vd],
        _ => return None,
    };
    Some(((glass.nd - nd) / 0.01).hypot((glass.vd - vd) / 1.5))
}

/// The lens with another medium behind a row, and with the powers of its two surfaces as they were;
/// `None` if the lens cannot have it.
fn with_medium(lens: &Lens, row: usize, medium: Medium) -> Option<Lens> {
    let mut other = lens.clone();
    other.surfaces[row].medium = medium;
    // A glass of the catalogue has no index that varies.
    let index = Parameter::new(row, Quantity::Index);
    other.variables.retain(|variable| variable.parameter != index);
    hold_powers(&mut other, lens, row, |surface| curvature_bounds(lens, surface))?;
    let other = other.with_pickups().ok()?;
    other.check().ok()?;
    Some(other)
}

/// Bends the surfaces around the gap behind a row of a lens with another medium there, so that they
/// keep the powers that they have in the lens `before`. `range` gives the curvatures that a surface may
/// have, in 1/mm; `None` for one that may not be bent. `None` if one of the lenses cannot be resolved.
pub(crate) fn hold_powers(
    lens: &mut Lens,
    before: &Lens,
    gap: usize,
    range: impl Fn(usize) -> Option<[f64; 2]>,
) -> Option<()> {
    let um = before.wavelengths[before.primary()].um;
    let [old, new] = [before.resolve(0, um).ok()?, lens.resolve(0, um).ok()?];
    let step = |system: &System<f64>, surface: usize| {
        let front = surface.checked_sub(1).map(|i| system.surfaces[i].index);
        system.surfaces[surface].index - front.unwrap_or(system.index_before)
    };
    for surface in [gap, gap + 1].into_iter().filter(|i| *i < before.surfaces.len()) {
        let ratio = step(&old, surface) / step(&new, surface);
        let is_bent = (1.0 / LARGEST_BENDING..LARGEST_BENDING).contains(&ratio);
        if let Some([low, high]) = range(surface).filter(|_| is_bent) {
            lens.surfaces[surface].curvature =
                (ratio * before.surfaces[surface].curvature).max(low).min(high);
        }
    }
    Some(())
}

/// The bounds of the variable curvature of a surface; `None` if it is no variable.
fn curvature_bounds(lens: &Lens, surface: usize) -> Option<[f64; 2]> {
    let variable = lens.variable(Parameter::new(surface, Quantity::Curvature))?;
    let (low, high) = (variable.min, variable.max);
    Some([low.unwrap_or(f64::NEG_INFINITY), high.unwrap_or(f64::INFINITY)])
}
