//! A hand on a run between two rounds.

use super::reservoir::ReservoirEntry;
use super::{Landscape, MutationKind, SearchError, SearchPoint, SearchRun, Temperature};
use crate::math::format_short;
use serde::{Deserialize, Serialize};

/// What a person tells a run between two rounds. All of it is part of the run's state, and so of
/// its checkpoints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SteerCommand {
    /// Every regeneration begins with a mutation of this generation's best point; Metropolis and
    /// Hastings, and brute force, have no regenerations.
    Pin(u64),
    /// Regenerations begin from the reservoir again.
    Unpin,
    /// A kind of mutation is tried so often, relatively; 0 forbids it. Of [`MutationKind::Global`] only 0
    /// or not counts: how often it is tried is γ.
    Weight(MutationKind, f64),
    /// Another temperature.
    Temperature(Temperature),
    /// A higher temperature, by the factor of the settings.
    Reheat,
    /// The run is over after this round.
    Stop,
    /// A stopped run goes on.
    Resume,
}

impl<P: SearchPoint, M: SearchPoint + Default> SearchRun<P, M> {
    /// Steers the run.
    ///
    /// # Errors
    /// No such generation is remembered, or a weight is negative or not finite; the run is then as
    /// it was.
    pub fn steer<L>(&mut self, landscape: &L, steer: SteerCommand) -> Result<(), SearchError>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        match steer {
            SteerCommand::Pin(number) => {
                self.pinned = Some(self.best_of_generation(landscape, number)?)
            }
            SteerCommand::Unpin => self.pinned = None,
            SteerCommand::Weight(kind, weight) => {
                if !self.weights.set(kind, weight) {
                    let (name, found) = ("weight", format_short(weight));
                    return Err(SearchError::Setting { name, found, expected: "0 or more" });
                }
            }
            SteerCommand::Temperature(temperature) => self.temperature = temperature,
            SteerCommand::Reheat => {
                self.temperature = self.temperature.scale_by(self.settings.reheat)
            }
            SteerCommand::Stop => self.stopped = true,
            SteerCommand::Resume => self.stopped = false,
        }
        Ok(())
    }

    /// The best point of a generation so far.
    fn best_of_generation<L>(
        &self,
        landscape: &L,
        number: u64,
    ) -> Result<ReservoirEntry<P>, SearchError>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let living = self.chains.iter().find(|chain| chain.number == number);
        let living = living.and_then(|chain| chain.best());
        let node = self.tree.node(number).map(|node| (&node.point, node.descended));
        let forgotten = SearchError::UnknownGeneration { number, born: self.tree.total() };
        let (point, loss) = living.or(node).ok_or(forgotten)?;
        Ok(ReservoirEntry::new(landscape, number, loss, point.clone()))
    }
}
