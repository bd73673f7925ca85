//! User control of a run between rounds.

use super::{SearchRun, Temperature};
use crate::math::format_short;
use crate::search::{Landscape, MutationKind, ReservoirEntry, SearchError, SearchPoint};
use serde::{Deserialize, Serialize};

/// A user command to a run, carried out between rounds. Its effects are part of the run's state,
/// and so of its checkpoints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SteerCommand {
    /// Regenerations mutate the best point of this generation. Metropolis–Hastings and brute force
    /// have no regenerations.
    Pin(u64),
    /// Regenerations mutate points of the reservoir again.
    Unpin,
    /// Sets the relative frequency of a kind of mutation; 0 excludes it. For
    /// [`MutationKind::Global`] only zero and non-zero are distinguished: its frequency is γ.
    Weight(MutationKind, f64),
    /// Sets the temperature.
    Temperature(Temperature),
    /// Multiplies the temperature by the factor of the settings.
    Reheat,
    /// Stops the run after this round.
    Stop,
    /// Resumes a stopped run.
    Resume,
}

impl<P: SearchPoint, M: SearchPoint + Default> SearchRun<P, M> {
    /// Carries out a command.
    ///
    /// # Errors
    /// The generation is not remembered, or a weight is negative or not finite; the run is then
    /// unchanged.
    pub fn steer<L>(&mut self, landscape: &L, steer: SteerCommand) -> Result<(), SearchError>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        match steer {
            SteerCommand::Pin(number) => {
                self.pinned = Some(self.best_of_generation(landscape, number)?);
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
                self.temperature = self.temperature.scale_by(self.settings.reheat);
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
        let active = self.chains.iter().find(|chain| chain.generation == number);
        let active = active.and_then(|chain| chain.best());
        let node = self.lineage.node(number).map(|node| (&node.point, node.best_loss));
        let forgotten = SearchError::UnknownGeneration { number, total: self.lineage.total() };
        let (point, loss) = active.or(node).ok_or(forgotten)?;
        Ok(ReservoirEntry::new(landscape, number, loss, point.clone()))
    }
}
