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
        events: &mut TurnEvents<L>,
    ) {
        if chain.descent.is_none() {
            return;
        }
        if chain.random.random::<f64>() < self.settings.metropolis.mutation {
            self.mutation_step(chain, events);
            return;
        }
        let (accepted, gradients) = self.langevin_step(chain, most as u64);
        let Some(descent) = &mut chain.descent else { return };
        descent.moves += 1;
        descent.gradients += gradients;
        let (loss, best) = (descent.loss, descent.best_loss);
        events.push(TurnEvent::Moved(LocalMove { loss, best, gradients, rejected: !accepted }));
        if descent.moves >= self.settings.longest as u64 {
            let next = ChainDescent {
                langevin: descent.langevin.clone(),
                ..ChainDescent::new(descent.point.clone(), loss)
            };
            continue_as_new_descent(chain, next, events);
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
        let Chain { descent: Some(descent), random, scales, .. } = chain else { return (false, 0) };
        let first = u64::from(descent.langevin.is_none());
        let Some(mut state) =
            descent.langevin.take().or_else(|| self.initial_state(&descent.point))
        else {
            return (false, 1);
        };
        if first >= most {
            descent.langevin = Some(state);
            return (false, first);
        }
        let scale = scales.entry(state.topology.clone()).or_default();
        if scale.square.len() != state.gradient.len() {
            scale.add_gradient(&state.gradient);
        }
        let steps = LangevinProposal {
            variances: scale.variances(&self.settings.metropolis),
            drift: (0.5 / self.temperature.value()).min(1.0),
        };
        let values = steps.sample(&state.values, &state.gradient, random);
        let point = self.landscape.with_values(&descent.point, &values);
        let next = point.and_then(|point| Some((self.landscape.loss_gradient(&point)?, point)));
        let mut accepted = false;
        if let Some((slope, point)) = next.filter(|(slope, _)| has_finite_squares(&slope.gradient))
        {
            let forward = steps.log_density(&state.values, &state.gradient, &values);
            let reverse = steps.log_density(&values, &slope.gradient, &state.values);
            let chance = self.temperature.log_ratio(descent.loss, slope.loss) + reverse - forward;
            accepted = random.random::<f64>().ln() < chance;
            if accepted {
                (state.values, state.gradient) = (values, slope.gradient);
                descent.move_to(point, slope.loss);
            }
        }
        scale.add_gradient(&state.gradient);
        descent.langevin = Some(state);
        (accepted, first + 1)
    }

    /// Proposes a mutation, which begins the next descent if it is accepted.
    fn mutation_step(&self, chain: &mut Chain<L::Point, L::Memory>, events: &mut TurnEvents<L>) {
        let Some(descent) = &chain.descent else { return };
        let before = descent.loss;
        let mutated = self.landscape.mutate(&descent.point, self.weights, &mut chain.random);
        let ratio = mutated.as_ref().ok().and_then(|new| new.log_ratio);
        let started =
            mutated.and_then(|new| self.new_descent(Some((chain.generation, before)), new));
        let started = match started {
            Ok(started) => started,
            Err(error) => return events.push(TurnEvent::Refused(error)),
        };
        let chance = ratio.map(|ratio| self.temperature.log_ratio(before, started.loss) + ratio);
        if chance.is_some_and(|chance| chain.random.random::<f64>().ln() < chance) {
            end_descent(chain, DescentEnd::Mutation, events);
            chain.descent = Some(ChainDescent::new(started.point.clone(), started.loss));
            events.push(TurnEvent::Started(started));
        } else {
            events.extend(started.kind.map(TurnEvent::Rejected));
        }
    }
}

/// Ends a descent of maximum length and continues from its last point as a new one.
fn continue_as_new_descent<P: Clone, M>(
    chain: &mut Chain<P, M>,
    next: ChainDescent<P, M>,
    events: &mut Vec<TurnEvent<P>>,
) {
    let (parent, loss) = (Some(chain.generation), next.loss);
    let (point, record) = (next.point.clone(), StructureChange::Continuation.into());
    end_descent(chain, DescentEnd::MaxMoves, events);
    let before = Some(loss);
    let started = NewDescent { parent, kind: None, record, before, loss, point, gradients: 0 };
    events.push(TurnEvent::Started(started));
    chain.descent = Some(next);
}
