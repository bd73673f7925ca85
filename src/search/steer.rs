//! A hand on a run between two rounds.

use super::reservoir::Entry;
use super::{Kind, Landscape, Point, Run, SearchError, Temperature};
use crate::math::brief;
use serde::{Deserialize, Serialize};

/// What a person tells a run between two rounds. All of it is part of the run's state, and so of
/// its checkpoints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Steer {
    /// Every regeneration begins with a mutation of this generation's best point; Metropolis and
    /// Hastings, and brute force, have no regenerations.
    Pin(u64),
    /// Regenerations begin from the reservoir again.
    Unpin,
    /// A kind of mutation is tried so often, relatively; 0 forbids it. Of [`Kind::Global`] only 0
    /// or not counts: how often it is tried is γ.
    Weight(Kind, f64),
    /// Another temperature.
    Temperature(Temperature),
    /// A higher temperature, by the factor of the settings.
    Reheat,
    /// The run is over after this round.
    Stop,
    /// A stopped run goes on.
    Resume,
}

impl<P: Point, M: Point + Default> Run<P, M> {
    /// Steers the run.
    ///
    /// # Errors
    /// No such generation is remembered, or a weight is negative or not finite; the run is then as
    /// it was.
    pub fn steer<L>(&mut self, landscape: &L, steer: Steer) -> Result<(), SearchError>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        match steer {
            Steer::Pin(number) => self.pinned = Some(self.best_of(landscape, number)?),
            Steer::Unpin => self.pinned = None,
            Steer::Weight(kind, weight) => {
                if !self.weights.set(kind, weight) {
                    let (name, found) = ("weight", brief(weight));
                    return Err(SearchError::Setting { name, found, expected: "0 or more" });
                }
            }
            Steer::Temperature(temperature) => self.temperature = temperature,
            Steer::Reheat => self.temperature = self.temperature.times(self.settings.reheat),
            Steer::Stop => self.stopped = true,
            Steer::Resume => self.stopped = false,
        }
        Ok(())
    }

    /// The best point of a generation so far.
    fn best_of<L>(&self, landscape: &L, number: u64) -> Result<Entry<P>, SearchError>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let living = self.chains.iter().find(|chain| chain.number == number);
        let living = living.and_then(|chain| chain.best());
        let node = self.tree.node(number).map(|node| (&node.point, node.descended));
        let forgotten = SearchError::Forgotten { number, born: self.tree.born() };
        let (point, loss) = living.or(node).ok_or(forgotten)?;
        Ok(Entry::of(landscape, number, loss, point.clone()))
    }
}
