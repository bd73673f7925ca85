//! The problem that a search explores.

use super::{MutationError, MutationKind, MutationRecord, MutationWeights, Random, Refusal};
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;

/// A point of a landscape: a lens, or the numbers of a toy problem.
///
/// Checkpoints store it as JSON, which cannot represent infinity: a type that can hold one
/// serializes it in another way. A checkpoint that would not read back unchanged is refused on
/// saving.
pub trait SearchPoint:
    Clone + PartialEq + Debug + Send + Sync + Serialize + DeserializeOwned
{
}

impl<T: Clone + PartialEq + Debug + Send + Sync + Serialize + DeserializeOwned> SearchPoint for T {}

/// A search problem: points with a loss, local descent, mutations and random draws.
///
/// Every method is a pure function of its arguments: that makes runs reproducible on any number of
/// threads. A loss that is not finite marks a point without merit.
pub trait Landscape: Sync {
    /// A point.
    type Point: SearchPoint;
    /// The state that a descent keeps between moves, like the moments of Adam; the default begins a
    /// new descent.
    type Memory: SearchPoint + Default;

    /// The loss of a point (4.6), smaller being better; infinite for a point without merit.
    fn loss(&self, point: &Self::Point) -> f64;

    /// One local move of as many gradient steps as the landscape's settings say (4.12). Returns the
    /// new point, its loss, and the number of gradients.
    fn descend(&self, point: &Self::Point, memory: &mut Self::Memory) -> (Self::Point, f64, usize);

    /// A local move of at most `most` gradients, but at least one: the rest of a budget. A
    /// landscape whose moves have a fixed length makes a whole one.
    fn descend_within(
        &self,
        point: &Self::Point,
        memory: &mut Self::Memory,
        _most: usize,
    ) -> (Self::Point, f64, usize) {
        self.descend(point, memory)
    }

    /// True if the last move of the descent with this memory met a test of its method that ends it, so that
    /// the next moves are expected to gain nothing; by default a descent never ends by itself.
    fn has_ended(&self, _memory: &Self::Memory) -> bool {
        false
    }

    /// Allows longer moves from here on, for a descent that nothing else waits for; by default moves keep
    /// their length.
    fn allow_long_moves(&self, _memory: &mut Self::Memory) {}

    /// A random point: `p_global` of (4.14).
    fn draw(&self, random: &mut Random) -> Result<Self::Point, MutationError>;

    /// A mutation of a point. Its kind is drawn with these weights times those of the landscape's
    /// own rules; weight 0 excludes a kind.
    fn mutate(
        &self,
        point: &Self::Point,
        weights: &MutationWeights,
        random: &mut Random,
    ) -> Result<MutatedPoint<Self::Point>, MutationError>;

    /// A mutation of a point for a search that takes the better of two points and needs no way back, so
    /// that it may be drawn from a distribution without a reverse; by default as [`Landscape::mutate`].
    fn perturb(
        &self,
        point: &Self::Point,
        weights: &MutationWeights,
        random: &mut Random,
    ) -> Result<MutatedPoint<Self::Point>, MutationError> {
        self.mutate(point, weights, random)
    }

    /// The relative frequency of a kind of perturbation by the landscape's own rules, 0 if there is none; by
    /// default points are mutated and not displaced.
    fn weight(&self, kind: MutationKind) -> f64 {
        f64::from(u8::from(kind != MutationKind::Displacement))
    }

    /// The topology of a point, the same for all points of one structure: a reservoir may hold one
    /// of each.
    fn topology(&self, point: &Self::Point) -> String;

    /// The distance of the structure of a point from the permitted ones; 0 if it is permitted. A
    /// point with a smaller distance is better than any with a larger one, whatever their losses.
    fn structure_violation(&self, _point: &Self::Point) -> u64 {
        0
    }

    /// A point near another one that keeps every limit: a loss may count limits as penalties, which points
    /// break a little. By default there are no limits.
    fn settle(&self, _point: &Self::Point) -> Settlement<Self::Point> {
        Settlement::Kept
    }

    /// True if two points of one topology lie at the same minimum; by default all of them do.
    fn is_same_minimum(&self, _one: &Self::Point, _other: &Self::Point) -> bool {
        true
    }

    /// The data that distinguish this landscape from others, like its rules and its objective. A
    /// checkpoint of another landscape is refused, naming the first field that differs. The
    /// optional field `start` holds the start of the search and is compared first.
    fn fingerprint(&self) -> serde_json::Value {
        serde_json::Value::Null
    }

    /// The number of elements of a point; brute force adds one after each and removes each.
    fn element_count(&self, _point: &Self::Point) -> usize {
        0
    }

    /// A mutation of the given kind of one element, indexed from 0. Brute force requests
    /// [`MutationKind::AddSinglet`] and [`MutationKind::RemoveSinglet`].
    fn mutate_at(
        &self,
        _point: &Self::Point,
        _element: usize,
        kind: MutationKind,
        _random: &mut Random,
    ) -> Result<MutatedPoint<Self::Point>, MutationError> {
        Err(MutationError::new(kind, Refusal::NoElement))
    }

    /// The loss and its gradient by all variables, in the units of Langevin steps; `None` where
    /// there is no gradient.
    fn loss_gradient(&self, _point: &Self::Point) -> Option<LossGradient> {
        None
    }

    /// The point with other values of the variables of [`Landscape::loss_gradient`]; `None` if they
    /// are out of bounds. Values may not be altered, since that would change the proposal density.
    fn with_values(&self, _point: &Self::Point, _values: &[f64]) -> Option<Self::Point> {
        None
    }
}

/// A loss and its gradient.
#[derive(Debug, Clone, PartialEq)]
pub struct LossGradient {
    /// The loss.
    pub loss: f64,
    /// The values of the variables.
    pub values: Vec<f64>,
    /// The derivative of the loss by each variable.
    pub gradient: Vec<f64>,
}

/// A point after a mutation.
#[derive(Debug, Clone, PartialEq)]
pub struct MutatedPoint<P> {
    /// The point.
    pub point: P,
    /// The kind of mutation.
    pub kind: MutationKind,
    /// The description of the mutation.
    pub record: MutationRecord,
    /// The logarithm of the ratio of the proposal densities, reverse over forward, times the
    /// determinant of the map, as Metropolis–Hastings needs it; `None` if the mutation is not
    /// reversible.
    pub log_ratio: Option<f64>,
    /// The gradients that were made to choose it.
    pub gradients: u64,
}

/// The outcome of keeping the limits of a point.
#[derive(Debug, Clone, PartialEq)]
pub enum Settlement<P> {
    /// The point keeps them as it is.
    Kept,
    /// A point near it keeps them.
    Restored {
        /// That point.
        point: P,
        /// Its loss.
        loss: f64,
        /// The gradients that were made to find it.
        gradients: u64,
    },
    /// No point was found near it that keeps them.
    Broken {
        /// The gradients that were made.
        gradients: u64,
    },
}
