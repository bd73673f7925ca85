//! Metropolis and Hastings: Langevin steps (4.10) and reversible mutations (Green, "Reversible Jump
//! Markov Chain Monte Carlo Computation and Bayesian Model Determination", Biometrika 1995), each
//! accepted with the probability (4.8).
//!
//! Here a descent is what lies between two accepted mutations; after as many moves as a descent may
//! have it is written down, and goes on as the next one.

use super::chain::{Birth, Chain, Happening, Moved, Shared, Tour, Turn, end};
use super::{Ended, Landscape, Langevin, Random, Slope};
use rand::RngExt as _;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// Where a walk stands: the structure, variables and gradient.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Walk {
    topology: String,
    values: Vec<f64>,
    gradient: Vec<f64>,
}

/// The mean square of all gradients that a chain took of a structure. It outlives the visits: one
/// that began anew with each would depend on where the visit began, for ever.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Scale {
    square: Vec<f64>,
    count: u64,
}

impl Scale {
    /// Counts a gradient.
    fn adapt(&mut self, gradient: &[f64]) {
        if self.square.len() != gradient.len() {
            *self = Self { square: vec![0.0; gradient.len()], count: 0 };
        }
        self.count += 1;
        let part = 1.0 / self.count as f64;
        for (v, g) in self.square.iter_mut().zip(gradient) {
            *v += (g * g - *v) * part;
        }
    }

    /// `ε M` of every variable.
    fn variances(&self, settings: &Langevin) -> Vec<f64> {
        self.square.iter().map(|v| settings.epsilon / (v.sqrt() + settings.floor)).collect()
    }
}

/// Langevin steps of these variances, which drift down by a part of variance times gradient.
struct Steps {
    variances: Vec<f64>,
    drift: f64,
}

impl Steps {
    /// Where a step leads without noise.
    fn mean(&self, from: &[f64], gradient: &[f64]) -> Vec<f64> {
        let place = |i: usize| from[i] - self.drift * self.variances[i] * gradient[i];
        (0..from.len()).map(place).collect()
    }

    fn step(&self, from: &[f64], gradient: &[f64], random: &mut Random) -> Vec<f64> {
        let mut noise = |v: &f64| v.sqrt() * random.sample::<f64, _>(StandardNormal);
        let mean = self.mean(from, gradient).into_iter().zip(&self.variances);
        mean.map(|(place, variance)| place + noise(variance)).collect()
    }

    /// The logarithm of the density of a step from one place to another, up to what both ways
    /// share.
    fn log_density(&self, from: &[f64], gradient: &[f64], to: &[f64]) -> f64 {
        let mean = self.mean(from, gradient);
        let each = |i: usize| (to[i] - mean[i]).powi(2) / self.variances[i];
        -0.5 * (0..from.len()).map(each).sum::<f64>()
    }
}

impl<L: Landscape> Shared<'_, L> {
    /// A mutation or a Langevin step, accepted or not.
    pub(super) fn walk(
        &self,
        chain: &mut Chain<L::Point, L::Memory>,
        most: usize,
        turn: &mut Turn<L>,
    ) {
        if chain.tour.is_none() {
            return;
        }
        if chain.random.random::<f64>() < self.settings.metropolis.mutation {
            self.jump(chain, turn);
            return;
        }
        let (accepted, gradients) = self.step(chain, most as u64);
        let Some(tour) = &mut chain.tour else { return };
        tour.moves += 1;
        tour.gradients += gradients;
        let (loss, best) = (tour.loss, tour.best_loss);
        turn.push(Happening::Moved(Moved { loss, best, gradients, rejected: !accepted }));
        if tour.moves >= self.settings.longest as u64 {
            let next = Tour { walk: tour.walk.clone(), ..Tour::new(tour.point.clone(), loss) };
            pass_on(chain, next, turn);
        }
    }

    /// Where a walk begins; none where there is no gradient.
    fn set_out(&self, point: &L::Point) -> Option<Walk> {
        let Slope { values, gradient, .. } = self.landscape.slope(point)?;
        let topology = self.landscape.topology(point);
        is_small(&gradient).then_some(Walk { topology, values, gradient })
    }

    /// A Langevin step; whether it was accepted, and the gradients it took. The first one of a walk
    /// takes two; where only one is left, it stays where it is.
    fn step(&self, chain: &mut Chain<L::Point, L::Memory>, most: u64) -> (bool, u64) {
        let Chain { tour: Some(tour), random, scales, .. } = chain else { return (false, 0) };
        let first = u64::from(tour.walk.is_none());
        let Some(mut walk) = tour.walk.take().or_else(|| self.set_out(&tour.point)) else {
            return (false, 1);
        };
        if first >= most {
            tour.walk = Some(walk);
            return (false, first);
        }
        let scale = scales.entry(walk.topology.clone()).or_default();
        if scale.square.len() != walk.gradient.len() {
            scale.adapt(&walk.gradient);
        }
        let steps = Steps {
            variances: scale.variances(&self.settings.metropolis),
            drift: (0.5 / self.temperature.value()).min(1.0),
        };
        let values = steps.step(&walk.values, &walk.gradient, random);
        let point = self.landscape.with_values(&tour.point, &values);
        let next = point.and_then(|point| Some((self.landscape.slope(&point)?, point)));
        let mut accepted = false;
        if let Some((slope, point)) = next.filter(|(slope, _)| is_small(&slope.gradient)) {
            let way = steps.log_density(&walk.values, &walk.gradient, &values);
            let back = steps.log_density(&values, &slope.gradient, &walk.values);
            let chance = self.temperature.log_ratio(tour.loss, slope.loss) + back - way;
            accepted = random.random::<f64>().ln() < chance;
            if accepted {
                (walk.values, walk.gradient) = (values, slope.gradient);
                tour.go(point, slope.loss);
            }
        }
        scale.adapt(&walk.gradient);
        tour.walk = Some(walk);
        (accepted, first + 1)
    }

    /// A mutation, which begins the next descent if it is accepted.
    fn jump(&self, chain: &mut Chain<L::Point, L::Memory>, turn: &mut Turn<L>) {
        let Some(tour) = &chain.tour else { return };
        let before = tour.loss;
        let mutated = self.landscape.mutate(&tour.point, self.weights, &mut chain.random);
        let ratio = mutated.as_ref().ok().and_then(|new| new.log_ratio);
        let birth = mutated.and_then(|new| self.birth(Some((chain.number, before)), new));
        let birth = match birth {
            Ok(birth) => birth,
            Err(refusal) => return turn.push(Happening::Refused(refusal)),
        };
        let chance = ratio.map(|ratio| self.temperature.log_ratio(before, birth.loss) + ratio);
        if chance.is_some_and(|chance| chain.random.random::<f64>().ln() < chance) {
            end(chain, Ended::Mutated, turn);
            chain.tour = Some(Tour::new(birth.point.clone(), birth.loss));
            turn.push(Happening::Born(birth));
        } else {
            turn.extend(birth.kind.map(Happening::Rejected));
        }
    }
}

/// A long walk is written down and goes on.
fn pass_on<P: Clone, M>(chain: &mut Chain<P, M>, next: Tour<P, M>, turn: &mut Vec<Happening<P>>) {
    let (parent, loss) = (Some(chain.number), next.loss);
    let (point, what) = (next.point.clone(), "goes on".to_owned());
    end(chain, Ended::Longest, turn);
    let birth = Birth { parent, kind: None, what, before: Some(loss), loss, point };
    turn.push(Happening::Born(birth));
    chain.tour = Some(next);
}

/// Whether the squares of a gradient are numbers.
fn is_small(gradient: &[f64]) -> bool {
    gradient.iter().all(|g| (g * g).is_finite())
}
