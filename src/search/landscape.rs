//! What a search walks through.

use super::{MutationError, MutationKind, MutationWeights, Random};
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;

/// What a landscape consists of: a lens, or the numbers of a toy problem.
///
/// A checkpoint keeps it as JSON, which has no word for infinity: a type that can hold one writes
/// it in another way. A checkpoint that would not read back as it was is refused when it is saved.
pub trait SearchPoint:
    Clone + PartialEq + Debug + Send + Sync + Serialize + DeserializeOwned
{
}

impl<T: Clone + PartialEq + Debug + Send + Sync + Serialize + DeserializeOwned> SearchPoint for T {}

/// Points with a loss, a descent, mutations, and draws from anywhere.
///
/// Every method is a function of its arguments alone: that is what makes runs repeatable, on any
/// number of threads. A loss that is not finite says that a point is worth nothing.
pub trait Landscape: Sync {
    /// A place in it.
    type Point: SearchPoint;
    /// What a descent remembers from one move to the next, like the moments of Adam; the default
    /// begins a new descent.
    type Memory: SearchPoint + Default;

    /// What a point is worth, less being better: (4.6); infinite where it is worth nothing.
    fn loss(&self, point: &Self::Point) -> f64;

    /// One local move, of as many gradient steps as the landscape's settings say: (4.12). Returns
    /// where it leads, its loss there, and how many gradients it took.
    fn descend(&self, point: &Self::Point, memory: &mut Self::Memory) -> (Self::Point, f64, usize);

    /// A local move of no more than so many gradients, at least one: what is left of a budget. A
    /// landscape whose moves are all as long takes a whole one.
    fn descend_within(
        &self,
        point: &Self::Point,
        memory: &mut Self::Memory,
        _most: usize,
    ) -> (Self::Point, f64, usize) {
        self.descend(point, memory)
    }

    /// A point from anywhere: `p_global` of (4.14).
    fn draw(&self, random: &mut Random) -> Result<Self::Point, MutationError>;

    /// A mutation of a point, of a kind drawn with these weights times those of the landscape's own
    /// rules; a weight of 0 forbids a kind.
    fn mutate(
        &self,
        point: &Self::Point,
        weights: &MutationWeights,
        random: &mut Random,
    ) -> Result<MutatedPoint<Self::Point>, MutationError>;

    /// What two points of the same structure have in common: a reservoir may hold one of each.
    fn topology(&self, point: &Self::Point) -> String;

    /// How far the structure of a point is from those that are asked for: 0 for one of them. A point
    /// that is nearer to them is better than any that is farther away, whatever their losses.
    fn structure_violation(&self, _point: &Self::Point) -> u64 {
        0
    }

    /// What distinguishes this landscape from others, like its rules and its objective: a
    /// checkpoint made on another one is refused, by the name of the first field that differs. A
    /// field `start` says where searches begin, and is compared first.
    fn fingerprint(&self) -> serde_json::Value {
        serde_json::Value::Null
    }

    /// How many elements a point has; brute force adds after each and removes each.
    fn element_count(&self, _point: &Self::Point) -> usize {
        0
    }

    /// The mutation of this kind of one element, counted from 0: brute force asks for
    /// [`MutationKind::AddSinglet`] and [`MutationKind::RemoveSinglet`].
    fn mutate_at(
        &self,
        _point: &Self::Point,
        _element: usize,
        kind: MutationKind,
        _random: &mut Random,
    ) -> Result<MutatedPoint<Self::Point>, MutationError> {
        Err(MutationError { kind, why: "this landscape has no elements".to_owned() })
    }

    /// Loss and gradient by every variable, in the units in which a descent takes its steps: what
    /// Langevin steps of Metropolis and Hastings need. None where there is no gradient.
    fn loss_gradient(&self, _point: &Self::Point) -> Option<LossGradient> {
        None
    }

    /// The point with other values of the variables that [`Landscape::loss_gradient`] lists; none where
    /// they are out of bounds. It may not change them, or the proposal would be another one.
    fn with_values(&self, _point: &Self::Point, _values: &[f64]) -> Option<Self::Point> {
        None
    }
}

/// A loss and its gradient.
#[derive(Debug, Clone, PartialEq)]
pub struct LossGradient {
    /// The loss.
    pub loss: f64,
    /// The variables.
    pub values: Vec<f64>,
    /// The derivative of the loss by each of them.
    pub gradient: Vec<f64>,
}

/// A point after a mutation.
#[derive(Debug, Clone, PartialEq)]
pub struct MutatedPoint<P> {
    /// The point.
    pub point: P,
    /// What was done.
    pub kind: MutationKind,
    /// What was done, where, in words.
    pub what: String,
    /// The logarithm of the density of proposing the way back over that of the way there, times
    /// the determinant of the map: what Metropolis and Hastings need; none where there is no way
    /// back.
    pub log_ratio: Option<f64>,
}
