//! The profile of a gradient-index lens: the sum of a polynomial in r² and a polynomial in z.
//!
//! The common form of the standard profiles of lens design (Marchand, *Gradient Index Optics*,
//! 1978, chapter 4): `u(r, z) = B + Σ aᵢ r²ⁱ + Σ bⱼ zʲ`, where `u` is the index or its square, or
//! the hyperbolic secant in place of the radial polynomial. A ray needs `η²` and the force `η ∇η =
//! ∇(η²)/2` only, so that the square costs no root.

use super::{ProfileFunction, Sech};
use crate::math::{Real, Vec3};
use serde::{Deserialize, Serialize};

/// The largest number of radial coefficients, of r² to r¹².
pub const RADIAL_TERMS: usize = 6;
/// The largest number of axial coefficients, of z to z⁴.
pub const AXIAL_TERMS: usize = 4;
/// The number of all coefficients; the radial ones come first.
pub const PROFILE_TERMS: usize = RADIAL_TERMS + AXIAL_TERMS;

/// The quantity that the coefficients define.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProfileLaw {
    /// The index: `n = n₀ + Σ aᵢ r²ⁱ + Σ bⱼ zʲ`.
    #[default]
    Index,
    /// Its square: `n² = n₀² + Σ aᵢ r²ⁱ + Σ bⱼ zʲ`.
    Square,
    /// `n = n₀ / cosh(a₁ r) + Σ bⱼ zʲ`; the other radial coefficients are ignored.
    Sech,
}

/// Coefficients of an index profile, without the base index to which they are added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileCoefficients<R> {
    /// The quantity that they define.
    pub law: ProfileLaw,
    /// The radial coefficients, of r² to r¹², then the axial ones, of z to z⁴.
    pub terms: [R; PROFILE_TERMS],
    /// The origin of the axial polynomial, whose variable is `origin + sense z`.
    pub origin: R,
    /// The direction of its variable, +1 towards +z or -1 towards -z.
    pub sense: R,
    /// The numbers of radial and of axial coefficients in use; those behind are zero and cost
    /// nothing.
    pub used: [usize; 2],
    /// The largest distance from the axis at which the profile is used, for the choice of the step;
    /// infinite if unknown.
    pub reach: f64,
}

impl<R: Real> ProfileCoefficients<R> {
    /// Coefficients of a profile whose axial polynomial begins at the front vertex.
    pub fn new(law: ProfileLaw, terms: [R; PROFILE_TERMS]) -> Self {
        let count = |part: &[R]| part.iter().rposition(|a| a.value() != 0.0).map_or(0, |i| i + 1);
        let (radial, axial) = terms.split_at(RADIAL_TERMS);
        let used = [count(radial), count(axial)];
        Self { law, terms, origin: R::ZERO, sense: R::ONE, used, reach: f64::INFINITY }
    }

    /// Marks coefficient `k` as used even if it is zero.
    #[must_use]
    pub fn with_term(mut self, k: usize) -> Self {
        let (part, count) = if k < RADIAL_TERMS { (0, k + 1) } else { (1, k + 1 - RADIAL_TERMS) };
        self.used[part] = self.used[part].max(count);
        self
    }

    /// True if the index is constant.
    pub fn is_constant(&self) -> bool {
        self.terms.iter().all(|term| term.value() == 0.0)
    }

    /// The same with every number mapped.
    pub fn map<S: Real>(&self, f: impl Fn(R) -> S) -> ProfileCoefficients<S> {
        let Self { law, terms, origin, sense, used, reach } = *self;
        ProfileCoefficients {
            law,
            terms: terms.map(&f),
            origin: f(origin),
            sense: f(sense),
            used,
            reach,
        }
    }

    /// The same profile seen from the other end of a gap of this thickness.
    #[must_use]
    pub fn reversed(self, thickness: R) -> Self {
        Self { origin: self.origin + self.sense * thickness, sense: -self.sense, ..self }
    }
}

/// `η²` and the force `η ∇η` at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Force<R> {
    /// `η²`.
    pub square: R,
    /// `η ∇η`.
    pub force: Vec3<R>,
}

/// An index profile with rotational symmetry about z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationalProfile<R> {
    /// The index on the axis at z = 0.
    pub base: R,
    /// The coefficients added to it.
    pub coefficients: ProfileCoefficients<R>,
}

/// A polynomial without a constant term and its first two derivatives.
#[inline(always)]
fn polynomial<R: Real>(terms: &[R], s: R) -> [R; 3] {
    let (mut value, mut slope, mut half_curvature) = (R::ZERO, R::ZERO, R::ZERO);
    for term in terms.iter().rev().copied().chain([R::ZERO]) {
        half_curvature = half_curvature * s + slope;
        slope = slope * s + value;
        value = value * s + term;
    }
    [value, slope, half_curvature + half_curvature]
}

/// `u` and its first and second derivatives with respect to r² and z.
struct ProfileDerivatives<R> {
    value: R,
    by_s: R,
    by_z: R,
    by_ss: R,
    by_zz: R,
}

impl<R: Real> RotationalProfile<R> {
    fn coordinates(&self, at: Vec3<R>) -> (R, R) {
        (at.x * at.x + at.y * at.y, self.coefficients.origin + self.coefficients.sense * at.z)
    }

    fn secant(&self) -> Sech<R> {
        Sech::new(self.base, self.coefficients.terms[0])
    }

    #[inline(always)]
    fn evaluate(&self, at: Vec3<R>) -> ProfileDerivatives<R> {
        let (s, z) = self.coordinates(at);
        let (radial, axial) = self.coefficients.terms.split_at(RADIAL_TERMS);
        let (radial, axial) =
            (&radial[..self.coefficients.used[0]], &axial[..self.coefficients.used[1]]);
        let [base, by_s, by_ss] = match self.coefficients.law {
            ProfileLaw::Index => add(self.base, polynomial(radial, s)),
            ProfileLaw::Square => add(self.base * self.base, polynomial(radial, s)),
            ProfileLaw::Sech => {
                let f = self.secant().evaluate(s);
                [f.value, f.slope, f.curvature]
            }
        };
        let [along, by_z, by_zz] = polynomial(axial, z);
        ProfileDerivatives {
            value: base + along,
            by_s,
            by_z: by_z * self.coefficients.sense,
            by_ss,
            by_zz,
        }
    }

    #[inline(always)]
    fn profile_slope(at: Vec3<R>, built: &ProfileDerivatives<R>) -> Vec3<R> {
        let across = built.by_s + built.by_s;
        Vec3::new(at.x * across, at.y * across, built.by_z)
    }

    /// `η²` and `η ∇η` at a point.
    #[inline(always)]
    pub fn force(&self, at: Vec3<R>) -> Force<R> {
        let built = self.evaluate(at);
        let climb = Self::profile_slope(at, &built);
        match self.coefficients.law {
            ProfileLaw::Square => Force { square: built.value, force: climb * R::from_f64(0.5) },
            ProfileLaw::Index | ProfileLaw::Sech => {
                Force { square: built.value * built.value, force: climb * built.value }
            }
        }
    }

    /// The index at a point; NaN where its square is negative.
    pub fn index(&self, at: Vec3<R>) -> R {
        let value = self.evaluate(at).value;
        if self.coefficients.law == ProfileLaw::Square { value.sqrt() } else { value }
    }

    /// The derivative of the force along a direction; the Jacobian is symmetric, so this is also
    /// the product with its transpose.
    #[inline(always)]
    pub fn force_derivative(&self, at: Vec3<R>, along: Vec3<R>) -> Vec3<R> {
        let built = self.evaluate(at);
        let outward = at.x * along.x + at.y * along.y;
        let four = R::from_f64(4.0);
        let (across, radial) = (built.by_s + built.by_s, built.by_ss * outward * four);
        let curved = Vec3::new(
            along.x * across + at.x * radial,
            along.y * across + at.y * radial,
            along.z * built.by_zz,
        );
        match self.coefficients.law {
            ProfileLaw::Square => curved * R::from_f64(0.5),
            ProfileLaw::Index | ProfileLaw::Sech => {
                let climb = Self::profile_slope(at, &built);
                curved * built.value + climb * climb.dot(along)
            }
        }
    }

    /// Adds the derivatives of `weight η² + pull · η ∇η` with respect to the base index and to
    /// every coefficient.
    #[inline(always)]
    pub fn accumulate(&self, at: Vec3<R>, weight: R, pull: Vec3<R>, by: &mut ProfileGradient<R>) {
        let (s, z) = self.coordinates(at);
        let built = self.evaluate(at);
        // With respect to the value and to the gradient of u.
        let (by_value, by_climb) = match self.coefficients.law {
            ProfileLaw::Square => (weight, pull * R::from_f64(0.5)),
            ProfileLaw::Index | ProfileLaw::Sech => {
                let climb = Self::profile_slope(at, &built);
                (R::TWO * weight * built.value + pull.dot(climb), pull * built.value)
            }
        };
        let by_slope = R::TWO * (by_climb.x * at.x + by_climb.y * at.y);
        let (radial, axial) = by.terms.split_at_mut(RADIAL_TERMS);
        match self.coefficients.law {
            ProfileLaw::Index => by.base += by_value,
            ProfileLaw::Square => by.base += R::TWO * self.base * by_value,
            ProfileLaw::Sech => {
                let mut pair = [R::ZERO; 2];
                self.secant().accumulate(s, by_value, by_slope, &mut pair);
                by.base += pair[0];
                radial[0] += pair[1];
            }
        }
        if self.coefficients.law != ProfileLaw::Sech {
            accumulate_powers(s, by_value, by_slope, radial);
        }
        accumulate_powers(z, by_value, by_climb.z * self.coefficients.sense, axial);
    }
}

/// Derivatives with respect to the base index and the coefficients of a profile.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ProfileGradient<R> {
    /// With respect to the index on the axis at z = 0.
    pub base: R,
    /// With respect to the coefficients.
    pub terms: [R; PROFILE_TERMS],
}

fn add<R: Real>(base: R, [value, slope, curvature]: [R; 3]) -> [R; 3] {
    [base + value, slope, curvature]
}

/// Adds `value sᵏ + slope k sᵏ⁻¹` for each power k from 1 on.
#[inline(always)]
fn accumulate_powers<R: Real>(s: R, value: R, slope: R, by: &mut [R]) {
    let (mut power, mut derived) = (s, R::ONE);
    for g in by {
        *g += value * power + slope * derived;
        derived = derived * s + power;
        power = power * s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Dual;

    /// Derivatives by three coordinates, the base and every coefficient.
    type All = Dual<f64, { 4 + PROFILE_TERMS }>;

    fn graded(law: ProfileLaw) -> RotationalProfile<f64> {
        let radial = [-0.09, 0.004, -3e-4, 1e-4, -2e-5, 1e-5];
        let axial = [0.03, -0.02, 0.005, 1e-3];
        let terms = std::array::from_fn(|i| if i < 6 { radial[i] } else { axial[i - 6] });
        RotationalProfile {
            base: 1.6,
            coefficients: ProfileCoefficients::new(law, terms).reversed(0.7),
        }
    }

    #[test]
    fn grin_every_derivative_of_a_graded_profile_is_that_of_dual_numbers() {
        let at = Vec3::new(0.4, -0.7, 1.1);
        for law in [ProfileLaw::Index, ProfileLaw::Square, ProfileLaw::Sech] {
            let plain = graded(law);
            let mut dual: RotationalProfile<All> = RotationalProfile {
                base: All::variable(1.6, 3),
                coefficients: plain.coefficients.map(All::constant),
            };
            for (i, term) in dual.coefficients.terms.iter_mut().enumerate() {
                *term = All::variable(term.value, 4 + i);
            }
            let x =
                Vec3::new(All::variable(at.x, 0), All::variable(at.y, 1), All::variable(at.z, 2));
            let Force { square, force } = dual.force(x);
            let here = plain.force(at);
            assert!((here.square.sqrt() - plain.index(at)).abs() < 1e-15);
            let half = Vec3::new(square.slope[0], square.slope[1], square.slope[2]) * 0.5;
            let off = half - here.force;
            assert!(off.dot(off).sqrt() < 1e-14, "{law:?} {off:?}");
            let (weight, pull) = (0.3, Vec3::new(0.7, -0.2, 0.9));
            let bent = plain.force_derivative(at, pull);
            let rows = [force.x, force.y, force.z];
            let expected = |i: usize| {
                pull.x * rows[0].slope[i] + pull.y * rows[1].slope[i] + pull.z * rows[2].slope[i]
            };
            for (i, found) in [bent.x, bent.y, bent.z].into_iter().enumerate() {
                assert!((found - expected(i)).abs() < 1e-13, "{law:?} {i}: {found}");
            }
            let mut by = ProfileGradient::default();
            plain.accumulate(at, weight, pull, &mut by);
            let all = std::iter::once(by.base).chain(by.terms);
            for (i, found) in all.enumerate() {
                let expected = weight * square.slope[3 + i] + expected(3 + i);
                assert!((found - expected).abs() < 1e-13, "{law:?} {i}: {found} {expected}");
            }
        }
    }
}
