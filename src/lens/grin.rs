//! Gradient-index (GRIN) media as written: a base glass and the coefficients of its index profile;
//! and their first-order optics.

use super::{Lens, Medium, Row};
use crate::grin::field::{
    AXIAL_TERMS, PROFILE_TERMS, ProfileCoefficients, ProfileLaw, RADIAL_TERMS, RotationalProfile,
};
use crate::math::{Real, Vec3};

/// A gradient-index medium: the index of a base glass on the axis at the vertex in front, and
/// polynomials in r² and in z, the distance from that vertex (see [`ProfileLaw`]).
///
/// The base has its dispersion; the coefficients are the same at every wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct GradientIndex {
    /// The glass on the axis at z = 0: a catalogue glass, a model glass or an index.
    pub base: Medium,
    /// The function of the coefficients that gives the index.
    pub law: ProfileLaw,
    /// The coefficients of r², r⁴, … r¹²; for the hyperbolic secant its constant alone, in 1/mm.
    pub radial: Vec<f64>,
    /// The coefficients of z, z², z³, z⁴.
    pub axial: Vec<f64>,
}

impl GradientIndex {
    /// All coefficients; those that are not written are zero.
    pub fn terms(&self) -> [f64; PROFILE_TERMS] {
        std::array::from_fn(|k| self.term(k).unwrap_or(0.0))
    }

    /// The coefficient with index `k`: 0 (r²) to 5 (r¹²), 6 (z) to 9 (z⁴); `None` if the law has no
    /// such coefficient.
    pub fn term(&self, k: usize) -> Option<f64> {
        let (list, place) = self.locate(k)?;
        Some([&self.radial, &self.axial][list].get(place).copied().unwrap_or(0.0))
    }

    /// Sets the coefficient with index `k`. Returns `false` and changes nothing if the law has no
    /// such coefficient.
    pub fn set_term(&mut self, k: usize, value: f64) -> bool {
        let Some((list, place)) = self.locate(k) else { return false };
        let terms = if list == 0 { &mut self.radial } else { &mut self.axial };
        if terms.len() <= place {
            terms.resize(place + 1, 0.0);
        }
        terms[place] = value;
        true
    }

    /// The list (0 radial, 1 axial) that holds a coefficient, and its index there.
    fn locate(&self, k: usize) -> Option<(usize, usize)> {
        let radial = if self.law == ProfileLaw::Sech { 1 } else { RADIAL_TERMS };
        match k {
            _ if k < radial => Some((0, k)),
            RADIAL_TERMS..PROFILE_TERMS => Some((1, k - RADIAL_TERMS)),
            _ => None,
        }
    }

    /// The indices of the coefficients that are written.
    pub fn written_terms(&self) -> impl Iterator<Item = usize> {
        (0..self.radial.len()).chain((0..self.axial.len()).map(|j| RADIAL_TERMS + j))
    }

    /// The power of mm in the unit of the coefficient with index `k`: −2 for that of r².
    pub fn power(&self, k: usize) -> i32 {
        match k {
            0 if self.law == ProfileLaw::Sech => -1,
            _ if k < RADIAL_TERMS => -2 * (k as i32 + 1),
            _ => -(k.min(PROFILE_TERMS) as i32 - RADIAL_TERMS as i32 + 1),
        }
    }

    /// True if the index varies along the axis.
    pub fn is_axial(&self) -> bool {
        self.axial.iter().any(|term| *term != 0.0)
    }

    /// The same medium described from the other end of a gap of this length in mm: with
    /// `s = length − z`, `Σ bⱼ zʲ = Σ bⱼ lengthʲ + Σ b'ₖ sᵏ`, where
    /// `b'ₖ = (−1)ᵏ Σⱼ C(j, k) bⱼ lengthʲ⁻ᵏ`. The constant is added to the index of the base; `None` if
    /// the base has dispersion, which the constant has not, or if the law does not add the two.
    #[must_use]
    pub fn reversed(&self, length: f64) -> Option<Self> {
        if !self.is_axial() {
            return Some(self.clone());
        }
        // From Σ bⱼ zʲ to powers of z − length, by Horner's scheme, one division after the other.
        let mut terms: Vec<f64> = std::iter::once(0.0).chain(self.axial.iter().copied()).collect();
        let top = terms.len() - 1;
        for first in 0..top {
            for i in (first..top).rev() {
                terms[i] += length * terms[i + 1];
            }
        }
        terms.iter_mut().skip(1).step_by(2).for_each(|odd| *odd = -*odd);
        let base = self.base_plus(terms.remove(0))?;
        Some(Self { base, axial: terms, ..self.clone() })
    }

    /// The base for a constant `by` added to the polynomials.
    fn base_plus(&self, by: f64) -> Option<Medium> {
        if by == 0.0 {
            return Some(self.base.clone());
        }
        let radial = self.radial.iter().any(|term| *term != 0.0);
        let index = match self.base {
            Medium::Index(n) => n,
            Medium::Model { nd, vd: 0.0 } => nd,
            _ => return None,
        };
        match self.law {
            ProfileLaw::Sech if radial => None,
            ProfileLaw::Square => {
                let square = index * index + by;
                (square > 0.0).then(|| Medium::Index(square.sqrt()))
            }
            ProfileLaw::Index | ProfileLaw::Sech => {
                let index = index + by;
                (index > 0.0).then_some(Medium::Index(index))
            }
        }
    }

    /// The first fault of the medium, as the rest of a sentence.
    pub(super) fn fault(&self) -> Option<String> {
        let radial = if self.law == ProfileLaw::Sech { 1 } else { RADIAL_TERMS };
        if self.radial.len() > radial {
            let found = self.radial.len();
            return Some(format!("has {found} radial coefficients; expected at most {radial}"));
        }
        if self.axial.len() > AXIAL_TERMS {
            let found = self.axial.len();
            return Some(format!("has {found} axial coefficients; expected at most {AXIAL_TERMS}"));
        }
        if let Some(a) = self.terms().iter().find(|a| !a.is_finite()) {
            return Some(format!("has the coefficient {a}; expected finite numbers"));
        }
        match self.base {
            Medium::Glass(_) | Medium::Model { .. } | Medium::Index(_) => None,
            Medium::Air | Medium::Mirror | Medium::Grin(_) => {
                Some("has no glass as its base; expected a catalogue name or an index".to_owned())
            }
        }
    }

    /// The coefficients for tracing rays up to the distance `reach` in mm from the axis.
    pub(super) fn coefficients(&self, reach: f64) -> ProfileCoefficients<f64> {
        ProfileCoefficients { reach, ..ProfileCoefficients::new(self.law, self.terms()) }
    }
}

impl Lens {
    /// The coefficients of the GRIN medium behind a surface, even if all are zero; `None` for another
    /// medium.
    pub fn grin_coefficients(&self, surface: usize) -> Option<ProfileCoefficients<f64>> {
        let row = self.surfaces.get(surface)?;
        let Medium::Grin(grin) = &row.medium else { return None };
        Some(grin.coefficients(gap_radius(row, self.surfaces.get(surface + 1))))
    }
}

/// The radius in mm of the gap between two surfaces: the larger of the two semi-diameters.
pub(super) fn gap_radius(front: &Row, back: Option<&Row>) -> f64 {
    let radius = |row: &Row| row.semi_diameter.unwrap_or(f64::INFINITY);
    back.map_or(f64::INFINITY, |back| radius(front).max(radius(back)))
}

/// The number of samples of the index from the axis to the rim, and from surface to surface.
const INDEX_SAMPLES: usize = 17;

/// The lowest index of a profile between z = 0 and `length`, up to its radius or, if that is
/// infinite, on the axis.
pub(super) fn lowest_index(field: &RotationalProfile<f64>, length: f64) -> f64 {
    let reach = if field.coefficients.reach.is_finite() { field.coefficients.reach } else { 0.0 };
    let share = |i: usize| i as f64 / (INDEX_SAMPLES - 1) as f64;
    let place = |i: usize| {
        Vec3::new(reach * share(i % INDEX_SAMPLES), 0.0, length * share(i / INDEX_SAMPLES))
    };
    let all = (0..INDEX_SAMPLES * INDEX_SAMPLES).map(|i| field.index(place(i)));
    // NaN counts as 0.
    all.fold(f64::INFINITY, |low, n| {
        if n >= low {
            low
        } else if n.is_nan() {
            0.0
        } else {
            n
        }
    })
}

/// The index `n` at a point of the axis, and the constant `c` of the force `n ∂n/∂r = c r` across
/// the axis.
fn on_axis<R: Real>(field: &RotationalProfile<R>, z: R) -> (R, R) {
    let at = Vec3::new(R::ZERO, R::ZERO, z);
    let across = Vec3::new(R::ONE, R::ZERO, R::ZERO);
    (field.index(at), field.force_derivative(at, across).x)
}

/// The steps in which the paraxial equations are solved: enough for twelve digits in a rod of a few
/// pitches. A purely radial profile is exact in one step.
const MAGNUS_STEPS: usize = 128;

/// The first-order optics of a gap with a GRIN medium. For light that travels towards −z, its index
/// and the optical slope are negative.
#[derive(Debug, Clone, Copy)]
pub struct ParaxialGrin<R> {
    /// The index on the axis at the end of the gap.
    pub index_behind: R,
    /// The derivative of that index by the thickness, in 1/mm.
    pub index_slope: R,
    /// The derivative of the optical slope at the end by the thickness, at a height of 1 mm.
    pub force_constant: R,
    /// The matrix `[[A, B], [C, D]]` from height and optical slope `n u` at the start of the gap to
    /// those at its end.
    pub matrix: [[R; 2]; 2],
    /// The contribution to the Petzval sum, `−∫ 2 n₁/n² dz` with `n = n₀ + n₁ r²`, in 1/mm.
    pub petzval: R,
}

impl<R: Real> ParaxialGrin<R> {
    /// Solves `dy/dz = p/n`, `dp/dz = (c/n) y` through a gap of this thickness in mm, by Magnus's
    /// series to fourth order with two Gauss points a step (Blanes, Casas, Oteo and Ros, Phys. Rep.
    /// 470, 2009, eq. 253); exact for constant coefficients.
    pub fn new(field: &RotationalProfile<R>, thickness: R) -> Self {
        let (index_behind, c) = on_axis(field, thickness);
        let at_end = field.force(Vec3::new(R::ZERO, R::ZERO, thickness));
        let mut gap = Self {
            index_behind,
            index_slope: at_end.force.z / index_behind,
            force_constant: c / index_behind,
            matrix: [[R::ONE, R::ZERO], [R::ZERO, R::ONE]],
            petzval: R::ZERO,
        };
        if field.coefficients.used[1] == 0 {
            gap.solve_radial(thickness);
        } else {
            gap.solve_axial(field, thickness);
        }
        gap
    }

    /// The same for light that travels towards −z if `sense` is negative.
    pub fn directed(field: &RotationalProfile<R>, thickness: R, sense: R) -> Self {
        let gap = Self::new(field, thickness);
        if sense < R::ZERO { gap.reversed() } else { gap }
    }

    /// The same gap for light that travels towards −z; its thickness is negative.
    #[must_use]
    fn reversed(self) -> Self {
        let [[a, b], [c, d]] = self.matrix;
        Self {
            index_behind: -self.index_behind,
            index_slope: -self.index_slope,
            force_constant: -self.force_constant,
            matrix: [[a, -b], [-c, d]],
            petzval: -self.petzval,
        }
    }

    /// Solves a gap without variation along the axis: the matrix of one step, squared repeatedly.
    fn solve_radial(&mut self, thickness: R) {
        let (n, force) = (self.index_behind, self.force_constant);
        let h = thickness * R::from_f64(1.0 / MAGNUS_STEPS as f64);
        self.matrix = matrix_exponential(R::ZERO, h / n, h * force);
        for _ in 0..MAGNUS_STEPS.ilog2() {
            self.matrix = matrix_product(self.matrix, self.matrix);
        }
        self.petzval = -(force / (n * n) * thickness);
    }

    /// Solves a gap whose index varies along the axis.
    fn solve_axial(&mut self, field: &RotationalProfile<R>, thickness: R) {
        let h = thickness * R::from_f64(1.0 / MAGNUS_STEPS as f64);
        let half = R::from_f64(0.5);
        let off = h * R::from_f64(3f64.sqrt() / 6.0);
        let mut middle = h * half;
        for _ in 0..MAGNUS_STEPS {
            let [(n1, c1), (n2, c2)] = [middle - off, middle + off].map(|z| on_axis(field, z));
            let [(b1, g1), (b2, g2)] = [(n1, c1), (n2, c2)].map(|(n, c)| (R::ONE / n, c / n));
            let mixed = h * off * half * (b2 * g1 - b1 * g2);
            let step = matrix_exponential(mixed, (b1 + b2) * h * half, (g1 + g2) * h * half);
            self.matrix = matrix_product(step, self.matrix);
            self.petzval -= (c1 * b1 * b1 * b1 + c2 * b2 * b2 * b2) * h * half;
            middle += h;
        }
    }

    /// Height in mm and optical slope at the end of the gap.
    pub fn transfer(&self, y: R, nu: R) -> (R, R) {
        let [[a, b], [c, d]] = self.matrix;
        (a * y + b * nu, c * y + d * nu)
    }

    /// The transposed transfer: from the derivatives by height and optical slope at the end of the
    /// gap to those by both at its start.
    pub fn transfer_transposed(&self, by_y: R, by_nu: R) -> (R, R) {
        let [[a, b], [c, d]] = self.matrix;
        (a * by_y + c * by_nu, b * by_y + d * by_nu)
    }

    /// The derivatives of height and optical slope at the end of the gap by its thickness, `p/n` and
    /// `(c/n) y`.
    pub fn thickness_derivative(&self, y: R, nu: R) -> (R, R) {
        (nu / self.index_behind, self.force_constant * y)
    }
}

/// `exp [[m, b], [c, −m]]` by its series, which needs few terms for a short step.
fn matrix_exponential<R: Real>(m: R, b: R, c: R) -> [[R; 2]; 2] {
    let q = m * m + b * c;
    // cosh √q and sinh √q / √q.
    let (mut even, mut odd) = (R::ONE, R::ONE);
    let (mut even_term, mut odd_term) = (R::ONE, R::ONE);
    for k in 1..24_u32 {
        let k = f64::from(k);
        even_term = even_term * q * R::from_f64(1.0 / (2.0 * k * (2.0 * k - 1.0)));
        odd_term = odd_term * q * R::from_f64(1.0 / (2.0 * k * (2.0 * k + 1.0)));
        even += even_term;
        odd += odd_term;
        if even_term.value().abs() < 1e-3 * R::EPSILON && k > 4.0 {
            break;
        }
    }
    [[even + odd * m, odd * b], [odd * c, even - odd * m]]
}

/// The product of two matrices.
fn matrix_product<R: Real>(a: [[R; 2]; 2], b: [[R; 2]; 2]) -> [[R; 2]; 2] {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The exponentials of a rotation and of a hyperbolic turn, in closed form.
    #[test]
    fn the_series_of_a_matrix_is_its_exponential() {
        let near = |found: [[f64; 2]; 2], exact: [[f64; 2]; 2]| {
            for (found, exact) in found.iter().flatten().zip(exact.iter().flatten()) {
                assert!((found - exact).abs() < 1e-13 * (1.0 + exact.abs()), "{found} {exact}");
            }
        };
        for t in [0.1_f64, 1.0, 2.5] {
            near(matrix_exponential(0.0, t, -t), [[t.cos(), t.sin()], [-t.sin(), t.cos()]]);
            near(matrix_exponential(0.0, t, t), [[t.cosh(), t.sinh()], [t.sinh(), t.cosh()]]);
            near(matrix_exponential(t, 0.0, 0.0), [[t.exp(), 0.0], [0.0, (-t).exp()]]);
        }
    }
}
