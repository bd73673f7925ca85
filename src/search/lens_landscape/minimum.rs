//! The comparison of minima. Two lenses lie at the same one if their curvatures and powers have the same
//! signs, their glasses are alike, and they are near in the metric of the residuals, `d² = dxᵀ Jᵀ J dx / F`, which predicts the
//! relative change of the merit between them. Near a distance of 1 the merit between them decides: a hill
//! above both means two minima (hill-valley test; Maree et al., GECCO 2018).

use super::LensLandscape;
use crate::lens::{Lens, Medium, glass};
use crate::merit::{DerivativeLevel, Merit};
use nalgebra::DVector;

/// The curvature relative to the focal length below which a surface counts as plane.
const PLANE: f64 = 0.05;
/// The differences of index and Abbe number below which two glasses are alike.
const ALIKE: [f64; 2] = [0.02, 3.0];
/// The square of the distance below which two minima are the same, and that above which they are not.
const SAME: f64 = 1e-2;
const DIFFERENT: f64 = 1.0;
/// The relative height of a hill that parts two minima.
const HILL: f64 = 1e-2;
/// The places between two minima where the merit is evaluated.
const BETWEEN: [f64; 3] = [0.25, 0.5, 0.75];

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
        self.is_near(one, other).unwrap_or(false)
    }

    /// True if two lenses are near in the metric of the residuals of the first one; `None` if it has no
    /// merit, or if they have different variables.
    fn is_near(&self, one: &Lens, other: &Lens) -> Option<bool> {
        let merit = self.merit(one, self.local.tolerance).ok()?;
        let [from, to] = [one, other].map(|lens| DVector::from_vec(merit.values(lens)));
        let same_rows = one.surfaces.len() == other.surfaces.len();
        let step = (same_rows && from.len() == to.len()).then(|| &to - &from)?;
        let sum = merit.evaluate(from.as_slice(), DerivativeLevel::Normal).ok()?;
        let square = step.dot(&(&sum.normal * &step)) / sum.value.abs().max(f64::MIN_POSITIVE);
        Some(match square {
            near if near < SAME => true,
            near if near < DIFFERENT => !has_hill_between(&merit, &from, &step, sum.value),
            _ => false,
        })
    }
}

/// True if the merit on the way from one lens to another rises above both ends, or does not exist.
fn has_hill_between(merit: &Merit, from: &DVector<f64>, step: &DVector<f64>, value: f64) -> bool {
    let at = |part: f64| merit.value((from + step * part).as_slice()).ok();
    let Some(end) = at(1.0) else { return true };
    let top = (1.0 + HILL) * value.max(end);
    BETWEEN.iter().any(|part| !at(*part).is_some_and(|merit| merit <= top))
}
