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

/// Where a walk stands: variables and gradient, and the mean square of all gradients so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Walk {
    values: Vec<f64>,
    gradient: Vec<f64>,
    square: Vec<f64>,
    count: u64,
}

impl Walk {
    /// None where the gradient is no number.
    fn new(slope: Slope) -> Option<Self> {
        let square: Vec<f64> = slope.gradient.iter().map(|g| g * g).collect();
        let finite = square.iter().chain(&slope.values).all(|number| number.is_finite());
        let Slope { values, gradient, .. } = slope;
        finite.then_some(Self { values, gradient, square, count: 1 })
    }

    /// `ε M` of every variable.
    fn variances(&self, settings: &Langevin) -> Vec<f64> {
        self.square.iter().map(|v| settings.epsilon / (v.sqrt() + settings.floor)).collect()
    }

    /// Counts the gradient at the present place, whether the walk moved or not.
    fn adapt(&mut self) {
        self.count += 1;
        let part = 1.0 / self.count as f64;
        for (v, g) in self.square.iter_mut().zip(&self.gradient) {
            *v += (g * g - *v) * part;
        }
    }
}

/// The logarithm of the density of a step from one place to another, up to what both ways share.
fn log_step(from: &[f64], gradient: &[f64], to: &[f64], variances: &[f64]) -> f64 {
    let each = |i: usize| {
        let off = to[i] - from[i] + variances[i] * gradient[i];
        off * off / variances[i]
    };
    -0.5 * (0..from.len()).map(each).sum::<f64>()
}

impl<L: Landscape> Shared<'_, L> {
    /// A mutation or a Langevin step, accepted or not.
    pub(super) fn walk(&self, chain: &mut Chain<L::Point, L::Memory>, turn: &mut Turn<L>) {
        let Some(tour) = &mut chain.tour else { return };
        if chain.random.random::<f64>() < self.settings.metropolis.mutation {
            self.jump(chain, turn);
            return;
        }
        let (accepted, gradients) = self.step(tour, &mut chain.random);
        tour.moves += 1;
        tour.gradients += gradients;
        let (loss, best) = (tour.loss, tour.best_loss);
        turn.push(Happening::Moved(Moved { loss, best, gradients, rejected: !accepted }));
        if tour.moves >= self.settings.longest as u64 {
            let next = Tour { walk: tour.walk.clone(), ..Tour::new(tour.point.clone(), loss) };
            pass_on(chain, next, turn);
        }
    }

    /// A Langevin step; whether it was accepted, and the gradients it took.
    fn step(&self, tour: &mut Tour<L::Point, L::Memory>, random: &mut Random) -> (bool, u64) {
        let (walk, first) = match tour.walk.take() {
            Some(walk) => (walk, 0),
            None => match self.landscape.slope(&tour.point).and_then(Walk::new) {
                Some(walk) => (walk, 1),
                None => return (false, 1),
            },
        };
        let walk = tour.walk.insert(walk);
        let variances = walk.variances(&self.settings.metropolis);
        let noise = |variance: &f64| variance.sqrt() * random.sample::<f64, _>(StandardNormal);
        let noise: Vec<f64> = variances.iter().map(noise).collect();
        let place = |i: usize| walk.values[i] - variances[i] * walk.gradient[i] + noise[i];
        let values: Vec<f64> = (0..walk.values.len()).map(place).collect();
        let point = self.landscape.with_values(&tour.point, &values);
        let next = point.and_then(|point| Some((self.landscape.slope(&point)?, point)));
        let mut accepted = false;
        if let Some((slope, point)) = next {
            let way = log_step(&walk.values, &walk.gradient, &values, &variances);
            let back = log_step(&values, &slope.gradient, &walk.values, &variances);
            let chance = self.temperature.log_ratio(tour.loss, slope.loss) + back - way;
            let squares = slope.gradient.iter().all(|g| (g * g).is_finite());
            accepted = squares && random.random::<f64>().ln() < chance;
            if accepted {
                (walk.values, walk.gradient) = (values, slope.gradient);
                tour.go(point, slope.loss);
            }
        }
        if let Some(walk) = &mut tour.walk {
            walk.adapt();
        }
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
