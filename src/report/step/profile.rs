//! The profile of an asphere as a cubic spline: each piece has the sag and the slope of the surface at its
//! ends.

use crate::lens::Shape;

/// The largest distance in mm from the true profile that is aimed at.
const TOLERANCE: f64 = 1e-6;
/// The largest number of pieces.
const MOST_PIECES: usize = 512;
/// The points of each piece at which the distance is measured.
const SAMPLES: usize = 8;

/// A cubic spline with continuous slope over the distance from the axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ProfileSpline {
    /// The control points as distance from the axis and sag, in mm.
    pub(super) controls: Vec<[f64; 2]>,
    /// The knots; those at the ends count four times, the others twice.
    pub(super) knots: Vec<f64>,
    /// The largest distance from the true profile along the axis, in mm.
    pub(super) deviation: f64,
}

/// The spline of a surface up to a height, with as many pieces as it needs.
pub(super) fn profile_spline(shape: &Shape<f64>, height: f64) -> ProfileSpline {
    let mut pieces = 4;
    loop {
        let spline = with_pieces(shape, height, pieces);
        if spline.deviation <= TOLERANCE || pieces >= MOST_PIECES {
            return spline;
        }
        pieces *= 2;
    }
}

fn with_pieces(shape: &Shape<f64>, height: f64, pieces: usize) -> ProfileSpline {
    let step = height / pieces as f64;
    let place = |i: usize| height * i as f64 / pieces as f64;
    let nodes: Vec<[f64; 2]> = (0..=pieces).map(|i| sag_and_slope(shape, place(i))).collect();
    let mut controls = vec![[0.0, nodes[0][0]]];
    for i in 0..pieces {
        let ([z0, s0], [z1, s1]) = (nodes[i], nodes[i + 1]);
        controls.push([place(i) + step / 3.0, z0 + s0 * step / 3.0]);
        controls.push([place(i + 1) - step / 3.0, z1 - s1 * step / 3.0]);
    }
    controls.push([height, nodes[pieces][0]]);
    let knots = (0..=pieces).map(place).collect();
    let deviation = (0..pieces)
        .flat_map(|i| (1..SAMPLES).map(move |k| (i, k as f64 / SAMPLES as f64)))
        .map(|(i, t)| {
            let spline = hermite([nodes[i], nodes[i + 1]], step, t);
            (spline - sag_and_slope(shape, place(i) + t * step)[0]).abs()
        })
        .fold(0.0, f64::max);
    ProfileSpline { controls, knots, deviation }
}

/// The sag and its derivative by the distance from the axis.
fn sag_and_slope(shape: &Shape<f64>, height: f64) -> [f64; 2] {
    let (sag, by_square) = shape.sag(height * height).unwrap_or((f64::NAN, f64::NAN));
    [sag, 2.0 * height * by_square]
}

fn hermite([[z0, s0], [z1, s1]]: [[f64; 2]; 2], step: f64, t: f64) -> f64 {
    let (u, t2) = (1.0 - t, t * t);
    u * u * ((1.0 + 2.0 * t) * z0 + t * step * s0) + t2 * ((3.0 - 2.0 * t) * z1 - u * step * s1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_exact_and_an_asphere_within_a_nanometre() {
        let parabola = Shape::Conic { curvature: 0.02, conic: -1.0 };
        let spline = profile_spline(&parabola, 12.0);
        assert!(spline.deviation < 1e-15 && spline.controls.len() == 10, "{spline:?}");
        let shape = Shape::Asphere {
            curvature: 0.08,
            conic: -0.7,
            terms: [3e-5, -4e-7, 2e-9, 0.0, 0.0, 0.0, 0.0],
        };
        let spline = profile_spline(&shape, 8.0);
        assert!(spline.deviation <= TOLERANCE, "{}", spline.deviation);
        assert_eq!(spline.controls.len(), 2 * spline.knots.len());
    }
}
