//! Elements that are added at saddle points of the merit: a [`NullMeniscus`] leaves the merit unchanged, and
//! the direction of the two new curvatures in which the merit falls fastest, taken either way, leads to two
//! different lenses. Thickness comes last.

use super::LensLandscape;
use crate::lens::{Lens, Parameter, Quantity, Variable, glass};
use crate::merit::{DerivativeLevel, Goal, Merit, Term};
use crate::search::mutation::NullMeniscus;
use crate::search::{MutatedPoint, MutationError, MutationKind, Random, SearchRules, mutation};
use nalgebra::Vector2;
use rand::RngExt as _;
use std::sync::Arc;

/// The step of curvatures for differences, times the focal length.
const DIFFERENCE: f64 = 1e-3;
/// The step away from the saddle point, times the focal length.
const DEPARTURE: f64 = 0.05;
/// The gradients by two curvatures that a saddle point takes.
const GRADIENTS: u64 = 4;

/// A lens with a meniscus without thickness, at a saddle point of the merit without its limits.
#[derive(Debug, Clone)]
pub struct SaddlePoint {
    /// The lens.
    pub lens: Lens,
    /// The first surface of the meniscus.
    pub first: usize,
    /// The direction of its two curvatures in which the merit falls fastest, of length 1.
    pub direction: [f64; 2],
    /// The second derivatives of the merit in that direction and across, in mm⁴.
    pub second_derivatives: [f64; 2],
}

impl LensLandscape {
    /// The saddle point with a meniscus of this glass behind a surface, or in front of it; `None` if there is
    /// no place for it, no such glass, or if the merit falls in no direction.
    pub fn saddle_point(
        &self,
        lens: &Lens,
        place: (usize, bool),
        name: &str,
    ) -> Option<SaddlePoint> {
        let glass = glass::find(name)?;
        self.departure(&NullMeniscus::beside(lens, &self.rules, place, glass).ok()?)
    }

    /// The direction in which the merit falls fastest from a null meniscus.
    fn departure(&self, null: &NullMeniscus) -> Option<SaddlePoint> {
        let curvatures = [0, 1].map(|i| Parameter::new(null.first + i, Quantity::Curvature));
        let free = |parameter| Variable { parameter, min: None, max: None };
        let lens = Lens { variables: curvatures.map(free).to_vec(), ..null.lens.clone() };
        let merit = Merit::new(&lens, &self.optical_goal(), self.local.tolerance).ok()?;
        let merit = merit.with_initial_light(&self.light);
        let step = DIFFERENCE / self.focal_length.abs();
        let slope = |direction: Vector2<f64>, step: f64| {
            let values = [0, 1].map(|i| null.curvature + step * direction[i]);
            let sum = merit.evaluate(&values, DerivativeLevel::Gradient).ok()?;
            Some(Vector2::new(sum.gradient[0], sum.gradient[1]))
        };
        let change = |direction: Vector2<f64>| {
            Some((slope(direction, step)? - slope(direction, -step)?) / (2.0 * step))
        };
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let [bending, power] = [1.0, -1.0].map(|sign| Vector2::new(half, sign * half));
        // Along equal curvatures the merit is constant, so that its second derivative there is none of rounding.
        let mixed = power.dot(&change(bending)?);
        let own = power.dot(&change(power)?);
        let (least, largest) = eigenvalues(mixed, own);
        let direction = (bending * mixed + power * least).normalize();
        (least < 0.0 && direction.iter().all(|part| part.is_finite())).then(|| SaddlePoint {
            lens: null.lens.clone(),
            first: null.first,
            direction: [direction[0], direction[1]],
            second_derivatives: [least, largest],
        })
    }

    /// The goal without its limits but for the focal length.
    fn optical_goal(&self) -> Goal {
        let is_optical = |term: Term| !term.is_limit() || matches!(term, Term::FocalLength(_));
        let terms = self.goal.terms.iter().filter(|weighted| is_optical(weighted.term));
        Goal { terms: terms.copied().collect(), ..self.goal.clone() }
    }

    /// Adds an element at a saddle point, on a random side of it; an ordinary meniscus where there is none.
    pub(super) fn add_at_saddle(
        &self,
        lens: &Arc<Lens>,
        rules: &SearchRules,
        random: &mut Random,
    ) -> Result<MutatedPoint<Arc<Lens>>, MutationError> {
        let null = NullMeniscus::draw(lens, rules, random)?;
        let side = if random.random::<bool>() { 1.0 } else { -1.0 };
        let size = DEPARTURE * (0.5 + random.random::<f64>()) / self.focal_length.abs();
        let Some(saddle) = self.departure(&null) else {
            let usual = mutation::perturb_as(MutationKind::AddSinglet, lens, rules, random)?;
            return Ok(MutatedPoint { gradients: GRADIENTS, ..usual.into() });
        };
        let curvatures = saddle.direction.map(|part| null.curvature + side * size * part);
        let mutated = null.thickened(lens, rules, curvatures)?;
        let mutated: MutatedPoint<Arc<Lens>> = mutated.into();
        Ok(MutatedPoint { log_ratio: None, gradients: GRADIENTS, ..mutated })
    }
}

/// The eigenvalues of a symmetric matrix of two rows, of which the first element is 0: the negative one
/// first, by a form that loses no digits.
fn eigenvalues(mixed: f64, own: f64) -> (f64, f64) {
    let half = 0.5 * own;
    let root = half.hypot(mixed);
    if half > 0.0 {
        (-mixed * mixed / (half + root), half + root)
    } else {
        (half - root, -mixed * mixed / (half - root))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_form_that_vanishes_in_one_direction_has_eigenvalues_of_both_signs() {
        for (mixed, own) in [(1.0, 3.0), (-1e-6, 2.0), (0.5, -4.0), (2.0, 0.0)] {
            let (least, largest) = eigenvalues(mixed, own);
            assert!(least < 0.0 && largest > 0.0, "{least} {largest}");
            assert!((least + largest - own).abs() < 1e-12);
            assert!((least * largest / (mixed * mixed) + 1.0).abs() < 1e-12);
        }
    }
}
