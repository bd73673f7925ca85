//! What a search walks through.

use super::{Kind, Random, Refusal};
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;

/// What a landscape consists of: a lens, or the numbers of a toy problem.
pub trait Point: Clone + PartialEq + Debug + Send + Sync + Serialize + DeserializeOwned {}

impl<T: Clone + PartialEq + Debug + Send + Sync + Serialize + DeserializeOwned> Point for T {}

/// Points with a loss, a descent, mutations, and draws from anywhere.
///
/// Every method is a function of its arguments alone: that is what makes runs repeatable.
pub trait Landscape: Sync {
    /// A place in it.
    type Point: Point;
    /// What a descent remembers from one move to the next, like the moments of Adam; the default
    /// begins a new descent.
    type Memory: Point + Default;

    /// What a point is worth, less being better: (4.6); infinite where it is worth nothing.
    fn loss(&self, point: &Self::Point) -> f64;

    /// One local move, of as many gradient steps as the settings say: (4.12). Returns where it
    /// leads, its loss there, and how many gradients it took.
    fn descend(&self, point: &Self::Point, memory: &mut Self::Memory) -> (Self::Point, f64, usize);

    /// A point from anywhere: `p_global` of (4.14).
    fn draw(&self, random: &mut Random) -> Result<Self::Point, Refusal>;

    /// A mutation of a point.
    fn mutate(
        &self,
        point: &Self::Point,
        random: &mut Random,
    ) -> Result<Mutated<Self::Point>, Refusal>;

    /// What two points of the same structure have in common: a reservoir may hold one of each.
    fn topology(&self, point: &Self::Point) -> String;
}

/// A point after a mutation.
#[derive(Debug, Clone, PartialEq)]
pub struct Mutated<P> {
    /// The point.
    pub point: P,
    /// What was done.
    pub kind: Kind,
    /// What was done, where, in words.
    pub what: String,
    /// The logarithm of the density of proposing the way back over that of the way there, times
    /// the determinant of the map: what Metropolis and Hastings need; none where there is no way
    /// back.
    pub log_ratio: Option<f64>,
}
