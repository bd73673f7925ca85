//! The comparison of minima. Two lenses lie at the same one if their curvatures and powers have the same
//! signs, their glasses are alike, and they are near in the metric of the residuals, `d² = dxᵀ Jᵀ J dx / F`, which predicts the
//! relative change of the merit between them. Near a distance of 1 the merit between them decides: a hill
//! above both means two minima (hill-valley test; Maree et al., GECCO 2018).

use super::LensLandscape;
use crate::lens::{Lens, Medium, glass};
use crate::merit::{DerivativeLevel, Merit, MeritError};
use nalgebra::{DMatrix, DVector};

/// The curvature relative to the focal length below which a surface counts as plane.
const PLANE: f64 = 0.05;
/// The differences of index and Abbe number below which two glasses are alike.
const ALIKE: [f64; 2] = [0.02, 3.0];
/// The relative change of the merit, the square of the distance, below which two minima are the same.
pub const SAME_MINIMUM: f64 = 1e-2;
/// That above which they are not.
const DIFFERENT: f64 = 1.0;
/// The relative height of a hill that parts two minima.
const HILL: f64 = 1e-2;
/// The places between two minima where the merit is evaluated.
const BETWEEN: [f64; 4] = [0.2, 0.4, 0.6, 0.8];

/// The signs of the curvatures of a lens and of the powers of its glasses, with 0 for planes.
pub fn curvature_signs(lens: &Lens, focal_length: f64) -> String {
    let sign = |curvature: f64| match curvature * focal_length {
        c if c.abs() < PLANE => '0',
        c if c > 0.0 => '+',
        _ => '-',
    };
    let curvatures = lens.surfaces.iter().map(|row| sign(row.curvature));
    let powers = lens.surfaces.windows(2).filter(|pair| pair[0].medium != Medium::Air);
    let powers = powers.map(|pair| sign(pair[0].curvature - pair[1].curvature));
    curvatures.chain(['/']).chain(powers).collect()
}

/// True if two lenses of one structure have alike glasses.
pub fn has_same_glasses(one: &Lens, other: &Lens) -> bool {
    let pairs = one.surfaces.iter().zip(&other.surfaces);
    one.surfaces.len() == other.surfaces.len()
        && pairs.into_iter().all(|(a, b)| a.medium == b.medium || is_alike(&a.medium, &b.medium))
}

fn is_alike(one: &Medium, other: &Medium) -> bool {
    let number = |medium: &Medium| match medium {
        Medium::Glass(name) => glass::find(name).map(|glass| (glass.nd, glass.vd)),
        Medium::Model { nd, vd } => Some((*nd, *vd)),
        _ => None,
    };
    let both = number(one).zip(number(other));
    both.is_some_and(|(a, b)| (a.0 - b.0).abs() < ALIKE[0] && (a.1 - b.1).abs() < ALIKE[1])
}

impl LensLandscape {
    /// True if two lenses of one topology lie at the same minimum.
    pub(super) fn are_at_one_minimum(&self, one: &Lens, other: &Lens) -> bool {
        let signs = |lens: &Lens| curvature_signs(lens, self.focal_length);
        if signs(one) != signs(other) || !has_same_glasses(one, other) {
            return false;
        }
        self.is_near(one, other)
    }

    /// True if two lenses with the same surfaces have a merit, and are near in the metric of the residuals of
    /// the first one.
    fn is_near(&self, one: &Lens, other: &Lens) -> bool {
        let Ok(found) = MinimumPlace::new(self, one, self.local.tolerance) else { return false };
        let other = DVector::from_vec(found.merit.values(other));
        let value = found.merit.value(other.as_slice());
        value.is_ok_and(|value| found.is_same(&other, value))
    }
}

/// A lens at a minimum in the metric of its residuals.
#[derive(Debug)]
pub struct MinimumPlace {
    merit: Merit,
    /// The values of the variables.
    pub values: DVector<f64>,
    /// `Jᵀ J` of the residuals.
    normal: DMatrix<f64>,
    /// The merit in mm².
    pub value: f64,
}

impl MinimumPlace {
    /// The place of a lens, with spots of a relative tolerance.
    ///
    /// # Errors
    /// The lens has no merit.
    pub fn new(landscape: &LensLandscape, lens: &Lens, tolerance: f64) -> Result<Self, MeritError> {
        let merit = landscape.merit(lens, tolerance)?;
        let values = merit.values(lens);
        let sum = merit.evaluate(&values, DerivativeLevel::Normal)?;
        let values = DVector::from_vec(values);
        Ok(Self { merit, values, normal: sum.normal, value: sum.value })
    }

    /// True if a lens with these values of the variables and this merit in mm² lies at the same minimum.
    pub fn is_same(&self, other: &DVector<f64>, merit: f64) -> bool {
        match self.square_distance(other) {
            near if near < SAME_MINIMUM => true,
            near if near < DIFFERENT => !self.has_hill_before(other, merit),
            _ => false,
        }
    }

    /// The square of the distance, `dxᵀ Jᵀ J dx / F` with the merit of this lens.
    fn square_distance(&self, other: &DVector<f64>) -> f64 {
        if other.len() != self.values.len() {
            return f64::INFINITY;
        }
        let step = other - &self.values;
        step.dot(&(&self.normal * &step)) / self.value.abs().max(f64::MIN_POSITIVE)
    }

    /// True if the merit between two places rises above both, or does not exist.
    fn has_hill_before(&self, other: &DVector<f64>, merit: f64) -> bool {
        let top = (1.0 + HILL) * self.value.max(merit);
        BETWEEN.iter().any(|part| {
            let between = &self.values + (other - &self.values) * *part;
            !self.merit.value(between.as_slice()).is_ok_and(|merit| merit <= top)
        })
    }
}
