//! The even asphere nearest to a sag that is no polynomial in r² on a conic, by least squares, and the
//! error of it.

use crate::lens::{ASPHERE_TERMS, Shape};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::FRAC_PI_2;

/// The largest accepted error of the sag, in the unit of the file: at millimetres a nanometre.
pub(super) const LARGEST_ERROR: f64 = 1e-6;

/// The number of heights at which the sag is matched; their density grows towards the rim.
const HEIGHTS: usize = 60;

/// The conic constants that are tried: from the first in steps of the second.
const CONICS: (f64, f64) = (-4.0, 0.05);

/// The number of conic constants that are tried.
const TRIES: usize = 120;

/// An even asphere in place of another surface.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct EvenFit {
    pub(super) conic: f64,
    /// Coefficients of r⁴, r⁶, ...
    pub(super) terms: Vec<f64>,
    /// The largest difference between the sags.
    pub(super) error: f64,
}

/// The even asphere of a vertex curvature that is nearest to a sag up to a radius; `None` where the sag
/// ends before.
pub(super) fn fit(sag: impl Fn(f64) -> f64, curvature: f64, radius: f64) -> Option<EvenFit> {
    let height = |i: usize| radius * (FRAC_PI_2 * (i + 1) as f64 / HEIGHTS as f64).sin();
    let heights: Vec<f64> = (0..HEIGHTS).map(height).collect();
    let wanted: Vec<f64> = heights.iter().map(|r| sag(*r)).collect();
    if !(radius > 0.0 && wanted.iter().all(|z| z.is_finite())) {
        return None;
    }
    let power = |i: usize, j: usize| (heights[i] / radius).powi(2 * j as i32 + 4);
    let decomposed = DMatrix::from_fn(HEIGHTS, ASPHERE_TERMS, power).svd(true, true);
    let try_conic = |conic: f64| {
        let base = Shape::Conic { curvature, conic };
        let rest: Option<Vec<f64>> = heights
            .iter()
            .zip(&wanted)
            .map(|(r, z)| base.sag(r * r).map(|(own, _)| z - own))
            .collect();
        let terms = decomposed.solve(&DVector::from_vec(rest?), 1e-15).ok()?;
        let scaled = terms.iter().enumerate();
        let terms = scaled.map(|(j, a)| a * radius.powi(-(2 * j as i32 + 4))).collect();
        let mut fit = EvenFit { conic, terms, error: 0.0 };
        fit.error = fit.error_of(&sag, curvature, radius);
        Some(fit)
    };
    let conics = (0..TRIES).map(|i| CONICS.0 + CONICS.1 * i as f64);
    conics.filter_map(try_conic).min_by(|a, b| a.error.total_cmp(&b.error))
}

impl EvenFit {
    /// The largest difference of the sags, between the matched heights too.
    fn error_of(&self, sag: impl Fn(f64) -> f64, curvature: f64, radius: f64) -> f64 {
        let Ok(shape) = Shape::new(curvature, self.conic, &self.terms, 0) else { return f64::NAN };
        let heights = (1..=3 * HEIGHTS).map(|i| radius * i as f64 / (3 * HEIGHTS) as f64);
        let apart = heights.map(|r| {
            let own = shape.sag(r * r).map_or(f64::NAN, |(z, _)| z);
            (own - sag(r)).abs()
        });
        apart.fold(0.0, |worst: f64, d| if d <= worst { worst } else { d })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_asphere_is_its_own_fit() {
        let terms = [2e-6, -1e-9, 0.0, 1e-15, 0.0, 0.0, 0.0];
        let shape = Shape::Asphere { curvature: 0.02, conic: -0.5, terms };
        let found = fit(|r| shape.sag(r * r).unwrap().0, 0.02, 15.0).unwrap();
        assert!(found.error < 1e-14, "{found:?}");
    }

    #[test]
    fn a_term_in_r2_on_a_sphere_is_fitted() {
        let sphere = Shape::Sphere { curvature: 0.03 };
        let sag = |r: f64| sphere.sag(r * r).unwrap().0 + 1e-3 * r * r;
        let found = fit(sag, 0.032, 12.0).unwrap();
        assert!(found.error < 1e-10, "{found:?}");
        // A cone is not even.
        assert!(fit(|r| 0.1 * r, 0.0, 12.0).unwrap().error > 1e-3);
        assert!(fit(|_| f64::NAN, 0.0, 12.0).is_none());
    }
}
