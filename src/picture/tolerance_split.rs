//! One tolerance, split over the effects that take a part of it: each may use the same share of its square.

use serde::Serialize;

/// The part of the error of a picture that an effect may use and that it uses, as a share of mid grey, or of the
/// pixel where that is brighter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorShare {
    /// The name of the effect.
    pub effect: &'static str,
    /// The part that it may use: the tolerance over the square root of the number of effects.
    pub allowed: f64,
    /// The part that it uses.
    pub used: f64,
}

/// A tolerance and the effects that share it.
#[derive(Debug, Clone, PartialEq)]
pub struct ToleranceSplit {
    tolerance: f64,
    shares: Vec<ErrorShare>,
}

impl ToleranceSplit {
    /// A tolerance that these effects share; each counts as much as it may use until it is known better.
    pub fn new(tolerance: f64, effects: &[&'static str]) -> Self {
        let allowed = tolerance / (effects.len().max(1) as f64).sqrt();
        let share = |effect: &&'static str| ErrorShare { effect, allowed, used: allowed };
        Self { tolerance, shares: effects.iter().map(share).collect() }
    }

    /// Lets one more effect share the tolerance.
    pub fn share_with(&mut self, effect: &'static str) {
        let allowed = self.tolerance / ((self.shares.len() + 1) as f64).sqrt();
        self.shares.iter_mut().for_each(|share| share.allowed = allowed);
        self.shares.push(ErrorShare { effect, allowed, used: allowed });
    }

    /// The part that every effect may use.
    pub fn allowed(&self) -> f64 {
        self.shares.first().map_or(self.tolerance, |share| share.allowed)
    }

    /// Notes what an effect uses.
    pub fn note(&mut self, effect: &str, used: f64) {
        self.shares.iter_mut().filter(|s| s.effect == effect).for_each(|s| s.used = used);
    }

    /// The part that the others leave for an effect, and never less than its own share.
    pub fn rest(&self, effect: &str) -> f64 {
        let square = self.without(effect).powi(2);
        (self.tolerance * self.tolerance - square).max(0.0).sqrt().max(self.allowed())
    }

    /// The error of all effects but one.
    pub fn without(&self, effect: &str) -> f64 {
        let others = self.shares.iter().filter(|share| share.effect != effect);
        others.map(|share| share.used * share.used).sum::<f64>().sqrt()
    }

    /// The error of all effects: the root of the sum of their squares.
    pub fn error(&self) -> f64 {
        self.shares.iter().map(|share| share.used * share.used).sum::<f64>().sqrt()
    }

    /// The effects.
    pub fn shares(&self) -> &[ErrorShare] {
        &self.shares
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_an_effect_does_not_use_is_left_for_others() {
        let mut split = ToleranceSplit::new(0.05, &["sampling", "diffraction"]);
        assert!((split.allowed() - 0.05 / 2.0_f64.sqrt()).abs() < 1e-15);
        assert!((split.error() - 0.05).abs() < 1e-15);
        split.note("diffraction", 0.03);
        assert!((split.rest("sampling") - 0.04).abs() < 1e-15);
        // One that takes too much leaves the others their own share, and the error says so.
        split.note("diffraction", 0.2);
        assert_eq!(split.rest("sampling"), split.allowed());
        assert!((split.without("sampling") - 0.2).abs() < 1e-15);
        split.note("sampling", 0.0);
        assert!((split.error() - 0.2).abs() < 1e-15);
        split.share_with("blur");
        assert!((split.allowed() - 0.05 / 3.0_f64.sqrt()).abs() < 1e-15);
        assert_eq!(split.shares()[2].used, split.allowed());
    }
}
