//! A synthetic plume of gas: a few Gaussians stacked along z, invented for reconstruction tests and
//! not measured.
//!
//! `η = n₀ + s q(p)` with `q = Σ wᵢ exp(-|p - cᵢ|²/2σᵢ²)`: `q` is about 1 where the plume is
//! densest and below 10⁻⁴ on the surface of its cube. A plume of lower index, as of hot gas, has `s
//! < 0`.

use super::{FieldResolution, Hessian, IndexField, IndexSample};
use crate::math::{Real, Vec3};

/// A Gaussian of the plume, in units of half the side of its cube.
struct GaussianBlob {
    centre: [f64; 3],
    /// The standard deviation.
    width: f64,
    weight: f64,
}

const fn blob(centre: [f64; 3], width: f64, weight: f64) -> GaussianBlob {
    GaussianBlob { centre, width, weight }
}

const BLOBS: [GaussianBlob; 7] = [
    blob([0.00, 0.02, -0.40], 0.13, 0.74),
    blob([0.06, -0.03, -0.16], 0.15, 0.58),
    blob([-0.05, 0.06, 0.06], 0.16, 0.46),
    blob([0.15, 0.05, 0.26], 0.15, 0.51),
    blob([-0.17, -0.08, 0.34], 0.15, 0.51),
    blob([0.03, 0.20, 0.38], 0.14, 0.42),
    blob([0.22, -0.17, 0.04], 0.13, 0.37),
];

/// Beyond this exponent a Gaussian is constant, so that its series stays short.
const CUT: f64 = 80.0;
/// The exponent is divided by two to this power before its series is summed.
const SQUARINGS: i32 = 6;
/// Terms of that series.
const TERMS: u32 = 21;

/// The plume; its parameters are `n₀` and `s`.
#[derive(Debug, Clone, PartialEq)]
pub struct Plume<R> {
    parameters: [R; 2],
    half: R,
}

/// `q` and its derivatives.
struct PlumeDensity<R> {
    value: R,
    gradient: Vec3<R>,
    hessian: Hessian<R>,
}

/// `e⁻ᵠ` for `φ ≥ 0`. All terms of the series of `e^(φ/64)` are positive, so nothing cancels.
fn exp_negative<R: Real>(exponent: R) -> R {
    let cut = R::from_f64(CUT);
    let small = R::select(exponent < cut, exponent, cut) * R::from_f64(0.5_f64.powi(SQUARINGS));
    let (mut term, mut sum) = (R::ONE, R::ONE);
    for k in 1..TERMS {
        term = term * small * R::from_f64(1.0 / f64::from(k));
        sum += term;
    }
    (0..SQUARINGS).for_each(|_| sum = sum * sum);
    R::ONE / sum
}

impl<R: Real> Plume<R> {
    /// A plume that changes the index `ambient` by at most about `contrast`, in a cube from `-half`
    /// to `half` on each axis.
    pub fn new(ambient: R, contrast: R, half: R) -> Self {
        Self { parameters: [ambient, contrast], half }
    }

    fn density(&self, at: Vec3<R>) -> PlumeDensity<R> {
        let zero = Hessian::default();
        let mut sum = PlumeDensity { value: R::ZERO, gradient: Vec3::default(), hessian: zero };
        let (mut diagonal, mut mixed) = (Vec3::default(), Vec3::default());
        for GaussianBlob { centre: [x, y, z], width, weight } in &BLOBS {
            let centre: Vec3<R> = Vec3::from_f64(Vec3::new(*x, *y, *z)) * self.half;
            let width = self.half * R::from_f64(*width);
            let narrow = R::ONE / (width * width);
            let d = at - centre;
            let value = R::from_f64(*weight) * exp_negative(d.dot(d) * narrow * R::from_f64(0.5));
            let (slope, bend) = (value * narrow, value * narrow * narrow);
            sum.value += value;
            sum.gradient = sum.gradient - d * slope;
            diagonal = diagonal + Vec3::new(d.x * d.x, d.y * d.y, d.z * d.z) * bend
                - Vec3::new(slope, slope, slope);
            mixed = mixed + Vec3::new(d.y * d.z, d.z * d.x, d.x * d.y) * bend;
        }
        sum.hessian = Hessian { diagonal, mixed };
        sum
    }
}

impl<R: Real> IndexField<R> for Plume<R> {
    fn parameters(&self) -> &[R] {
        &self.parameters
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        &mut self.parameters
    }

    fn sample(&self, at: Vec3<R>) -> IndexSample<R> {
        self.sample_and_hessian(at).0
    }

    fn hessian(&self, at: Vec3<R>) -> Hessian<R> {
        self.sample_and_hessian(at).1
    }

    fn sample_and_hessian(&self, at: Vec3<R>) -> (IndexSample<R>, Hessian<R>) {
        let [ambient, contrast] = self.parameters;
        let PlumeDensity { value, gradient, hessian } = self.density(at);
        let sample =
            IndexSample { index: ambient + contrast * value, gradient: gradient * contrast };
        let Hessian { diagonal, mixed } = hessian;
        (sample, Hessian { diagonal: diagonal * contrast, mixed: mixed * contrast })
    }

    fn accumulate(&self, at: Vec3<R>, weight: R, pull: Vec3<R>, gradient: &mut [R]) {
        let density = self.density(at);
        gradient[0] += weight;
        gradient[1] += weight * density.value + pull.dot(density.gradient);
    }

    fn resolution(&self) -> FieldResolution {
        FieldResolution { voxel: None, continuous_force: true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_right_to_rounding_and_ends_quietly() {
        for i in 0..800 {
            let exponent = 0.1 * f64::from(i);
            let (found, exact) = (exp_negative(exponent), (-exponent).exp());
            assert!((found - exact).abs() <= 1e-13 * exact, "{exponent}: {found} {exact}");
        }
        assert_eq!(exp_negative(1e9), exp_negative(CUT));
        assert!(exp_negative(80.0_f32) > 0.0 && exp_negative(f64::MAX).is_finite());
    }

    #[test]
    fn the_plume_stays_in_its_cube() {
        let plume = Plume::new(0.0, 1.0, 2.0);
        let at = |n: usize| 2.0 * (n as f64 / 20.0 - 1.0);
        let mut most = 0.0_f64;
        for n in 0..41 * 41 * 41 {
            let p = Vec3::new(at(n % 41), at(n / 41 % 41), at(n / 41 / 41));
            let value = plume.sample(p).index;
            most = most.max(value);
            let is_edge = p.x.abs().max(p.y.abs()).max(p.z.abs()) >= 2.0;
            assert!(value >= 0.0 && (!is_edge || value < 1e-4), "{p:?}: {value}");
        }
        assert!(most > 0.85 && most < 1.0, "{most}");
    }
}
