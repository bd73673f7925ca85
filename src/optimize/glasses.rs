//! Exchange of glasses, guided by predictions of the merit behind it.
//!
//! Another glass moves the focus by more than one step of the variables takes back, so the powers of its
//! surfaces are held first: their curvatures follow the change of the index. How the merit and its gradient
//! follow index and Abbe number of each glass, and the normal matrix of the variables, tell to second order
//! what is left after optimization; one factorization serves all glasses. The most promising ones are then
//! really optimized.

use super::{DescentMethod, Optimizer, start_with};
use crate::lens::glass::{self, Glass};
use crate::lens::{Lens, Medium, Parameter, Quantity, SurfaceNumber, System};
use crate::merit::{DerivativeLevel, Goal, LimitTreatment, Merit, MeritError, SumOfSquares};
use nalgebra::{Cholesky, DMatrix, Dyn, Matrix2, Vector2};
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use serde::Serialize;

/// The number of exchanges that are optimized in a round.
const TRIALS: usize = 8;
/// The largest number of them at one surface.
const TRIALS_OF_SURFACE: usize = 2;
/// The steps of such a trial, and those of the best one of a round.
const TRIAL_STEPS: usize = 20;
const FINAL_STEPS: usize = 200;
/// The merit of the best trial, relative to the present one, up to which it is optimized further.
const PROMISING: f64 = 1.5;
/// The least gain of an exchange that is taken, relative to the merit.
const LEAST_GAIN: f64 = 1e-3;
/// The rounds without a gain after which the search ends: by then the reach is all of the glass map.
const PATIENCE: usize = 5;
/// The changes of index and Abbe number that count as one unit of distance.
const NEAR: [f64; 2] = [0.02, 3.0];
/// The distance up to which glasses are tried first: predictions hold nearby. It doubles with every round
/// without a gain.
const FIRST_REACH: f64 = 2.0;
/// Half of the trials may be this much farther, where predictions are rough and gains large.
const FARTHER: f64 = 6.0;
/// A lens that needs this many times the rays of the present one is not optimized: its pupils are in pieces.
const MOST_RAYS: usize = 8;
/// The relative tolerance of the spots of predictions.
const PREDICTION_TOLERANCE: f64 = 1e-2;
/// The changes of index and Abbe number by which predictions are made.
const STEPS: [f64; 2] = [1e-3, 0.2];
/// The damping of the matrix that predicts, relative to the diagonal of the normal matrix.
const DAMPING: f64 = 1e-4;
/// The change of a curvature up to which it follows the index.
const LARGEST_BENDING: f64 = 2.0;

/// The order in which exchanges are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExchangeOrder {
    /// The lowest predicted merit first.
    Predicted,
    /// A random one with this seed, for comparison; nothing is predicted.
    Random(u64),
}

/// Another glass in place of one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlassExchange {
    /// The surface in front of the glass.
    pub surface: SurfaceNumber,
    /// The glass before, as in lens files.
    pub from: String,
    /// The glass in its place.
    pub to: String,
    /// The merit that is predicted behind it; `None` without a prediction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted: Option<f64>,
    /// The merit after optimization; `None` if the lens with it cannot be optimized.
    pub merit: Option<f64>,
}

/// The result of a round.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlassRound {
    /// The exchanges that were optimized, the most promising one first.
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
    order: ExchangeOrder,
    /// The light of the first lens, which limits of light compare with.
    initial_light: Vec<Vec<f64>>,
    best: Lens,
    merit: f64,
    /// The rays of one evaluation of the first lens.
    rays: usize,
    /// The exchanges of the best lens that were not tried yet, the next one last.
    waiting: Option<Vec<Exchanged>>,
    evaluations: usize,
    rounds: u64,
    /// The rounds since the last gain.
    idle: usize,
    /// The distance up to which glasses are tried now.
    reach: f64,
}

/// A lens with another glass.
#[derive(Debug, Clone)]
struct Exchanged {
    exchange: GlassExchange,
    lens: Lens,
    /// The distance of the two glasses, in units of [`NEAR`].
    distance: f64,
}

/// A trial and the evaluations that it took.
type Trial = (Exchanged, usize);

impl GlassSearch {
    /// A search from a lens that was optimized, among some glasses.
    ///
    /// # Errors
    /// A lens without a glass to exchange, glasses without an index, or a lens without a merit.
    pub fn new(
        lens: &Lens,
        goal: &Goal,
        tolerance: f64,
        glasses: impl IntoIterator<Item = &'static Glass>,
        order: ExchangeOrder,
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
            order,
            best: lens.clone(),
            waiting: None,
            evaluations: 1,
            rounds: 0,
            idle: 0,
            reach: first_reach(order),
        })
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
        let merit = Merit::new(&self.best, &self.goal, self.tolerance)?;
        let merit = merit.with_initial_light(&self.initial_light);
        start_with(DescentMethod::TrustRegion, merit, &self.best, self.tolerance)
    }

    /// Goes on from another lens with glasses to exchange, whose light is compared with that of the first
    /// one.
    ///
    /// # Errors
    /// A lens without a merit.
    pub fn restart(&mut self, lens: &Lens) -> Result<(), MeritError> {
        let merit = Merit::new(lens, &self.goal, self.tolerance)?;
        let merit = merit.with_initial_light(&self.initial_light);
        self.merit = merit.value(&merit.values(lens))?;
        self.best = lens.clone();
        (self.waiting, self.idle, self.reach) = (None, 0, first_reach(self.order));
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
            None => self.exchanges()?,
        };
        let mut chosen = choose(&mut waiting, self.reach, TRIALS / 2);
        chosen.extend(choose(&mut waiting, FARTHER * self.reach, TRIALS - chosen.len()));
        if chosen.is_empty() {
            self.reach = f64::INFINITY;
            chosen = choose(&mut waiting, self.reach, TRIALS);
        }
        let trials: Vec<Trial> = chosen
            .into_par_iter()
            .map(|exchanged| self.optimized(exchanged, TRIAL_STEPS))
            .collect();
        self.evaluations += trials.iter().map(|(_, used)| used).sum::<usize>();
        let tried = trials.iter().map(|(tried, _)| tried.exchange.clone()).collect();
        let accepted = self.take_best(trials);
        if accepted.is_some() {
            (self.idle, self.reach) = (0, (0.5 * self.reach).max(FIRST_REACH));
        } else {
            (self.idle, self.reach) = (self.idle + 1, 2.0 * self.reach);
        }
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
        (self.best, self.merit) = (found.lens, merit);
        Some(found.exchange)
    }

    /// A lens with another glass after some steps; its merit is `None` if it cannot be optimized.
    fn optimized(&self, mut exchanged: Exchanged, steps: usize) -> Trial {
        let found = self.descend(&exchanged.lens, steps);
        exchanged.exchange.merit = found.as_ref().map(|(_, merit, _)| *merit);
        let used = found.as_ref().map_or(1, |(_, _, used)| *used);
        exchanged.lens = found.map_or(exchanged.lens, |(lens, _, _)| lens);
        (exchanged, used)
    }

    /// A lens after some steps, its merit with its limits as penalties, and the evaluations.
    fn descend(&self, lens: &Lens, steps: usize) -> Option<(Lens, f64, usize)> {
        let merit = Merit::new(lens, &self.goal, self.tolerance).ok()?;
        if rays(&merit) > MOST_RAYS * self.rays {
            return None;
        }
        let merit = merit.with_initial_light(&self.initial_light);
        let method = DescentMethod::TrustRegion;
        let mut optimizer = start_with(method, merit, lens, self.tolerance).ok()?;
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
        let lit = Merit::new(optimizer.best(), &self.goal, self.tolerance).ok()?.has_light();
        (merit.is_finite() && lit).then(|| (optimizer.best().clone(), merit, evaluations))
    }

    /// All exchanges of the best lens, the next one last.
    fn exchanges(&mut self) -> Result<Vec<Exchanged>, MeritError> {
        let pairs: Vec<(usize, &Glass)> = sites(&self.best)
            .into_iter()
            .flat_map(|row| self.glasses.iter().map(move |glass| (row, *glass)))
            .collect();
        let with = |(row, glass): &(usize, &Glass)| exchanged(&self.best, *row, glass);
        let all: Vec<Exchanged> = pairs.par_iter().filter_map(with).collect();
        match self.order {
            ExchangeOrder::Random(seed) => {
                let mut all = all;
                all.shuffle(&mut Xoshiro256PlusPlus::seed_from_u64(seed.wrapping_add(self.rounds)));
                Ok(all)
            }
            ExchangeOrder::Predicted => self.predicted(all),
        }
    }

    /// Exchanges with their predictions, the lowest merit last.
    fn predicted(&mut self, all: Vec<Exchanged>) -> Result<Vec<Exchanged>, MeritError> {
        let (predictor, used) = Predictor::new(&self.best, &self.goal, &self.initial_light)?;
        self.evaluations += used;
        let predict = |mut found: Exchanged| {
            let glass = glass::find(&found.exchange.to)?;
            found.exchange.predicted = predictor.predict(found.exchange.surface.index(), glass);
            Some(found)
        };
        let mut found: Vec<Exchanged> = all.into_iter().filter_map(predict).collect();
        let merit = |found: &Exchanged| found.exchange.predicted.unwrap_or(f64::INFINITY);
        found.sort_by(|a, b| merit(b).total_cmp(&merit(a)));
        Ok(found)
    }
}

/// What a lens becomes with other glasses, after optimization, to second order.
///
/// With the gradient `g` and the matrix `H` of the variables, changes `Δ` of index and Abbe number of one
/// glass add `F' Δ + ½ Δᵀ F'' Δ` to the merit and `G Δ` to the gradient; the variables take back
/// `½ (g + G Δ)ᵀ H⁻¹ (g + G Δ)`.
struct Predictor {
    merit: f64,
    /// The numbers of each glass that is exchanged.
    sites: Vec<(usize, SiteModel)>,
}

/// The merit after optimization as a function of the index and the Abbe number of one glass.
struct SiteModel {
    /// Index and Abbe number of the present glass.
    numbers: [f64; 2],
    slope: Vector2<f64>,
    bend: Matrix2<f64>,
}

impl Predictor {
    /// Predicts from a lens; the second number is that of evaluations.
    fn new(lens: &Lens, goal: &Goal, light: &[Vec<f64>]) -> Result<(Self, usize), MeritError> {
        let goal = Goal { limits: LimitTreatment::Penalties, ..goal.clone() };
        let (mut lens, rows) = (lens.clone(), sites(lens));
        without_indices(&mut lens, &rows);
        let merit = Merit::new(&lens, &goal, PREDICTION_TOLERANCE)?.with_initial_light(light);
        let sum = merit.evaluate(&merit.values(&lens), DerivativeLevel::Normal)?;
        let mut matrix = 2.0 * sum.normal;
        let smallest = f64::MIN_POSITIVE.max(1e-12 * matrix.diagonal().amax());
        for i in 0..matrix.nrows() {
            matrix[(i, i)] += DAMPING * matrix[(i, i)] + smallest;
        }
        let factors = matrix.cholesky().ok_or(MeritError::NoVariables)?;
        let model = |row: &usize| Some((*row, SiteModel::new(&lens, *row, &merit, &factors)?));
        let sites: Vec<_> = rows.par_iter().filter_map(model).collect();
        Ok((Self { merit: sum.value, sites }, 1 + 6 * rows.len()))
    }

    /// The merit with another glass; `None` if nothing is known of the glass before.
    fn predict(&self, row: usize, glass: &Glass) -> Option<f64> {
        let (_, site) = self.sites.iter().find(|(other, _)| *other == row)?;
        let change = Vector2::new(glass.nd - site.numbers[0], glass.vd - site.numbers[1]);
        Some(self.merit + site.slope.dot(&change) + 0.5 * change.dot(&(site.bend * change)))
    }
}

impl SiteModel {
    /// Differences of the merit and of its gradient by index and Abbe number of the glass behind a row.
    fn new(lens: &Lens, row: usize, merit: &Merit, factors: &Cholesky<f64, Dyn>) -> Option<Self> {
        let numbers = numbers(&lens.surfaces[row].medium)?;
        let at = |steps: [f64; 2]| {
            let [nd, vd] = [0, 1].map(|i| numbers[i] + steps[i] * STEPS[i]);
            let lens = with_medium(lens, row, Medium::Model { nd, vd })?;
            let merit = merit.with_lens(&lens).ok()?;
            merit.evaluate(&merit.values(&lens), DerivativeLevel::Gradient).ok()
        };
        let middle = at([0.0; 2])?;
        let ends = [[1.0, 0.0], [0.0, 1.0]].map(|s| Some((at(s)?, at(s.map(|v| -v))?)));
        let [Some(index), Some(abbe)] = ends else { return None };
        let both = at([1.0, 1.0])?;
        let slope = |(up, down): &Ends, i: usize| 0.5 * (up.value - down.value) / STEPS[i];
        let bend = |(up, down): &Ends, i: usize| {
            (up.value - 2.0 * middle.value + down.value) / STEPS[i].powi(2)
        };
        let mixed =
            (both.value - index.0.value - abbe.0.value + middle.value) / (STEPS[0] * STEPS[1]);
        let change =
            |(up, down): &Ends, i: usize| (&up.gradient - &down.gradient) / (2.0 * STEPS[i]);
        let by = DMatrix::from_columns(&[change(&index, 0), change(&abbe, 1)]);
        let taken_back = factors.solve(&by);
        let (linear, square) =
            (taken_back.transpose() * &middle.gradient, by.transpose() * taken_back);
        Some(Self {
            numbers,
            slope: Vector2::new(slope(&index, 0), slope(&abbe, 1)) - linear.fixed_rows::<2>(0),
            bend: Matrix2::new(bend(&index, 0), mixed, mixed, bend(&abbe, 1))
                - square.fixed_view::<2, 2>(0, 0),
        })
    }
}

/// The merit above and below a number.
type Ends = (SumOfSquares, SumOfSquares);

/// The rays of one evaluation.
fn rays(merit: &Merit) -> usize {
    merit.spot_samplings().iter().map(|spot| spot.rays).sum()
}

/// The distance up to which glasses are tried first; a random order has no distance.
fn first_reach(order: ExchangeOrder) -> f64 {
    if order == ExchangeOrder::Predicted { FIRST_REACH } else { f64::INFINITY }
}

/// The next exchanges, at most so many, taken from the end of those that wait: not too many at one
/// surface, and none farther than `reach`.
fn choose(waiting: &mut Vec<Exchanged>, reach: f64, most: usize) -> Vec<Exchanged> {
    let mut chosen: Vec<Exchanged> = Vec::new();
    let mut left = Vec::new();
    while chosen.len() < most {
        let Some(next) = waiting.pop() else { break };
        let is_there = |other: &&Exchanged| other.exchange.surface == next.exchange.surface;
        let is_near = next.distance <= reach;
        if is_near && chosen.iter().filter(is_there).count() < TRIALS_OF_SURFACE {
            chosen.push(next);
        } else {
            left.push(next);
        }
    }
    waiting.extend(left.into_iter().rev());
    chosen
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
    Some(Exchanged { exchange, lens: other, distance: distance(lens, row, glass)? })
}

/// The distance of a glass from that behind a row, in units of [`NEAR`].
fn distance(lens: &Lens, row: usize, glass: &Glass) -> Option<f64> {
    let [nd, vd] = numbers(&lens.surfaces[row].medium)?;
    Some(((glass.nd - nd) / NEAR[0]).hypot((glass.vd - vd) / NEAR[1]))
}

/// The index and the Abbe number of a glass of the catalogue or a model glass.
fn numbers(medium: &Medium) -> Option<[f64; 2]> {
    match medium {
        Medium::Glass(name) => glass::find(name).map(|glass| [glass.nd, glass.vd]),
        Medium::Model { nd, vd } => Some([*nd, *vd]),
        _ => None,
    }
}

/// The lens with another medium behind a row, and with the powers of its two surfaces as they were;
/// `None` if the lens cannot have it.
fn with_medium(lens: &Lens, row: usize, medium: Medium) -> Option<Lens> {
    let mut other = lens.clone();
    other.surfaces[row].medium = medium;
    without_indices(&mut other, &[row]);
    hold_powers(&mut other, lens, row)?;
    let other = other.with_pickups().ok()?;
    other.check().ok()?;
    Some(other)
}

/// Takes the indices behind some rows from the variables: a glass of the catalogue has none that varies.
fn without_indices(lens: &mut Lens, rows: &[usize]) {
    let is_index = |parameter: Parameter| {
        parameter.quantity == Quantity::Index && rows.contains(&parameter.surface)
    };
    lens.variables.retain(|variable| !is_index(variable.parameter));
}

/// Bends the surfaces around a gap whose curvatures are variables, so that they keep their powers.
fn hold_powers(lens: &mut Lens, before: &Lens, gap: usize) -> Option<()> {
    let um = before.wavelengths[before.primary()].um;
    let [old, new] = [before.resolve(0, um).ok()?, lens.resolve(0, um).ok()?];
    let step = |system: &System<f64>, surface: usize| {
        let front = surface.checked_sub(1).map(|i| system.surfaces[i].index);
        system.surfaces[surface].index - front.unwrap_or(system.index_before)
    };
    for surface in [gap, gap + 1].into_iter().filter(|i| *i < before.surfaces.len()) {
        let curvature = Parameter::new(surface, Quantity::Curvature);
        let ratio = step(&old, surface) / step(&new, surface);
        let is_bent = (1.0 / LARGEST_BENDING..LARGEST_BENDING).contains(&ratio);
        let variable = before.variables.iter().find(|variable| variable.parameter == curvature);
        if let Some(variable) = variable.filter(|_| is_bent) {
            let bent = ratio * before.surfaces[surface].curvature;
            let low = variable.min.unwrap_or(f64::NEG_INFINITY);
            lens.surfaces[surface].curvature =
                bent.max(low).min(variable.max.unwrap_or(f64::INFINITY));
        }
    }
    Some(())
}
