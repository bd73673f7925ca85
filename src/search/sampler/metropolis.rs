//! Metropolis–Hastings sampling: Langevin steps (4.10) and reversible mutations (Green, "Reversible
//! Jump Markov Chain Monte Carlo Computation and Bayesian Model Determination", Biometrika 1995),
//! each accepted with the probability (4.8).
//!
//! Here a descent is the part of the chain between two accepted mutations. After the maximum number
//! of moves of a descent it is recorded and continues as a new one.

use super::chain::{
    Chain, ChainDescent, LocalMove, NewDescent, RoundContext, TurnEvent, TurnEvents, end_descent,
};
use super::langevin::{LangevinProposal, LangevinState, has_finite_squares};
use crate::search::{DescentEnd, Landscape, LossGradient, StructureChange};
use rand::RngExt as _;

impl<L: Landscape> RoundContext<'_, L> {
    /// One turn of Metropolis–Hastings: a mutation or a Langevin step, accepted or rejected.
    pub(in crate::search) fn metropolis_turn(
        &self,
        chain: &mut Chain<L::Point, L::Memory>,
        most: usize,
        turn: &mut TurnEvents<L>,
    ) {
        if chain.tour.is_none() {
            return;
        }
        if chain.random.random::<f64>() < self.settings.metropolis.mutation {
            self.mutation_step(chain, turn);
            return;
        }
        let (accepted, gradients) = self.langevin_step(chain, most as u64);
        let Some(tour) = &mut chain.tour else { return };
        tour.moves += 1;
        tour.gradients += gradients;
        let (loss, best) = (tour.loss, tour.best_loss);
        turn.push(TurnEvent::Moved(LocalMove { loss, best, gradients, rejected: !accepted }));
        if tour.moves >= self.settings.longest as u64 {
            let next = ChainDescent {
                walk: tour.walk.clone(),
                ..ChainDescent::new(tour.point.clone(), loss)
            };
            continue_as_new_descent(chain, next, turn);
        }
    }

    /// The state at a point; `None` where there is no gradient.
    fn initial_state(&self, point: &L::Point) -> Option<LangevinState> {
        let LossGradient { values, gradient, .. } = self.landscape.loss_gradient(point)?;
        let topology = self.landscape.topology(point);
        has_finite_squares(&gradient).then_some(LangevinState { topology, values, gradient })
    }

    /// A Langevin step: true if it was accepted, and the gradients it took. The first step of a
    /// descent takes two gradients; if the budget has only one left, the point stays.
    fn langevin_step(&self, chain: &mut Chain<L::Point, L::Memory>, most: u64) -> (bool, u64) {
        let Chain { tour: Some(tour), random, scales, .. } = chain else { return (false, 0) };
        let first = u64::from(tour.walk.is_none());
        let Some(mut walk) = tour.walk.take().or_else(|| self.initial_state(&tour.point)) else {
            return (false, 1);
        };
        if first >= most {
            tour.walk = Some(walk);
            return (false, first);
        }
        let scale = scales.entry(walk.topology.clone()).or_default();
        if scale.square.len() != walk.gradient.len() {
            scale.add_gradient(&walk.gradient);
        }
        let steps = LangevinProposal {
            variances: scale.variances(&self.settings.metropolis),
            drift: (0.5 / self.temperature.value()).min(1.0),
        };
        let values = steps.sample(&walk.values, &walk.gradient, random);
        let point = self.landscape.with_values(&tour.point, &values);
        let next = point.and_then(|point| Some((self.landscape.loss_gradient(&point)?, point)));
        let mut accepted = false;
        if let Some((slope, point)) = next.filter(|(slope, _)| has_finite_squares(&slope.gradient))
        {
            let way = steps.log_density(&walk.values, &walk.gradient, &values);
            let back = steps.log_density(&values, &slope.gradient, &walk.values);
            let chance = self.temperature.log_ratio(tour.loss, slope.loss) + back - way;
            accepted = random.random::<f64>().ln() < chance;
            if accepted {
                (walk.values, walk.gradient) = (values, slope.gradient);
                tour.move_to(point, slope.loss);
            }
        }
        scale.add_gradient(&walk.gradient);
        tour.walk = Some(walk);
        (accepted, first + 1)
    }

    /// Proposes a mutation, which begins the next descent if it is accepted.
    fn mutation_step(&self, chain: &mut Chain<L::Point, L::Memory>, turn: &mut TurnEvents<L>) {
        let Some(tour) = &chain.tour else { return };
        let before = tour.loss;
        let mutated = self.landscape.mutate(&tour.point, self.weights, &mut chain.random);
        let ratio = mutated.as_ref().ok().and_then(|new| new.log_ratio);
        let birth = mutated.and_then(|new| self.new_descent(Some((chain.number, before)), new));
        let birth = match birth {
            Ok(birth) => birth,
            Err(error) => return turn.push(TurnEvent::Refused(error)),
        };
        let chance = ratio.map(|ratio| self.temperature.log_ratio(before, birth.loss) + ratio);
        if chance.is_some_and(|chance| chain.random.random::<f64>().ln() < chance) {
            end_descent(chain, DescentEnd::Mutation, turn);
            chain.tour = Some(ChainDescent::new(birth.point.clone(), birth.loss));
            turn.push(TurnEvent::Started(birth));
        } else {
            turn.extend(birth.kind.map(TurnEvent::Rejected));
        }
    }
}

/// Ends a descent of maximum length and continues from its last point as a new one.
fn continue_as_new_descent<P: Clone, M>(
    chain: &mut Chain<P, M>,
    next: ChainDescent<P, M>,
    turn: &mut Vec<TurnEvent<P>>,
) {
    let (parent, loss) = (Some(chain.number), next.loss);
    let (point, record) = (next.point.clone(), StructureChange::Continuation.into());
    end_descent(chain, DescentEnd::MaxMoves, turn);
    let birth = NewDescent { parent, kind: None, record, before: Some(loss), loss, point };
    turn.push(TurnEvent::Started(birth));
    chain.tour = Some(next);
}
