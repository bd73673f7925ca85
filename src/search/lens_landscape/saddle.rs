//! Elements that are added at saddle points of the merit: a [`NullMeniscus`] leaves the merit unchanged, and
//! the direction of the two new curvatures in which the merit falls fastest, taken either way, leads to two
//! different lenses. Thickness comes last.

use super::LensLandscape;
use crate::lens::{Lens, Parameter, Quantity, Variable, glass};
use crate::merit::{DerivativeLevel, Goal, Merit, Term};
use crate::search::mutation::NullMeniscus;
use crate::search::{MutatedPoint, MutationError, MutationKind, Random, SearchRules, mutation};
use nalgebra::{Matrix2, SymmetricEigen, Vector2};
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
        let slope = |i: usize, step: f64| {
            let mut values = [null.curvature; 2];
            values[i] += step;
            let sum = merit.evaluate(&values, DerivativeLevel::Gradient).ok()?;
            Some(Vector2::new(sum.gradient[0], sum.gradient[1]))
        };
        let column = |i: usize| Some((slope(i, step)? - slope(i, -step)?) / (2.0 * step));
        let hessian = Matrix2::from_columns(&[column(0)?, column(1)?]);
        let found = SymmetricEigen::new(0.5 * (hessian + hessian.transpose()));
        let least = if found.eigenvalues[0] < found.eigenvalues[1] { 0 } else { 1 };
        let direction = found.eigenvectors.column(least);
        let second_derivatives = [found.eigenvalues[least], found.eigenvalues[1 - least]];
        (second_derivatives[0] < 0.0).then(|| SaddlePoint {
            lens: null.lens.clone(),
            first: null.first,
            direction: [direction[0], direction[1]],
            second_derivatives,
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
