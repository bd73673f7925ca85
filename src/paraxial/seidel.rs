//! Third-order aberrations, surface by surface (Welford 1986, chapter 8).
//!
//! With `A = n (u + y c)`, `Ā = n (ū + ȳ c)` and `Δ` the difference behind minus in front:
//! `S₁ = −A² y Δ(u/n)`, `S₂ = −A Ā y Δ(u/n)`, `S₃ = −Ā² y Δ(u/n)`, `S₄ = −H² c Δ(1/n)`, and
//! `S₅ = Ā (c Δ(1/n) ȳ (Ā y + H) − Ā² y Δ(1/n²))`, which is `Ā (S₃ + S₄) / A` without the
//! division. An aspheric surface adds `8 a Δn` times `y⁴, y³ȳ, y²ȳ², yȳ³`, where `a` is the excess of
//! its r⁴ term over that of the sphere.

use super::first_order::FirstOrder;
use super::ray::signed_indices;
use crate::lens::{Surface, System};
use crate::math::Real;
use serde::Serialize;

/// The third-order wave aberrations of a surface or a lens, in mm, and its first-order chromatic
/// ones: `W = S₁/8 r⁴ + S₂/2 h r³ cos φ + S₃/2 h² r² cos² φ + (S₃ + S₄)/4 h² r² + S₅/2 h³ r cos φ`
/// at the pupil coordinate `r` and the field coordinate `h`, both 1 at the edge.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct SeidelSums<R> {
    /// Spherical aberration, positive where undercorrected.
    pub s1: R,
    /// Coma.
    pub s2: R,
    /// Astigmatism.
    pub s3: R,
    /// Petzval curvature.
    pub s4: R,
    /// Distortion.
    pub s5: R,
    /// Axial colour between the two outer wavelengths.
    pub c1: R,
    /// Lateral colour between the two outer wavelengths.
    pub c2: R,
}

/// The symbol and the meaning of each sum, in the order of [`SeidelSums::to_array`].
pub const SEIDEL_SUM_NAMES: [(&str, &str); 7] = [
    ("S1", "spherical aberration"),
    ("S2", "coma"),
    ("S3", "astigmatism"),
    ("S4", "Petzval"),
    ("S5", "distortion"),
    ("C1", "axial colour"),
    ("C2", "lateral colour"),
];

impl<R: Real> SeidelSums<R> {
    /// S1 to S5, C1 and C2.
    pub const fn to_array(&self) -> [R; 7] {
        [self.s1, self.s2, self.s3, self.s4, self.s5, self.c1, self.c2]
    }

    fn is_finite(&self) -> bool {
        self.to_array().into_iter().all(|sum| sum.value().is_finite())
    }

    fn plus(self, o: &Self) -> Self {
        Self {
            s1: self.s1 + o.s1,
            s2: self.s2 + o.s2,
            s3: self.s3 + o.s3,
            s4: self.s4 + o.s4,
            s5: self.s5 + o.s5,
            c1: self.c1 + o.c1,
            c2: self.c2 + o.c2,
        }
    }
}

/// The third-order sums of a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Seidel<R> {
    /// The sums of each surface, without the image plane.
    pub surfaces: Vec<SeidelSums<R>>,
    /// The sums of the lens.
    pub total: SeidelSums<R>,
}

/// The third-order sums along the marginal and chief ray of `data`, which belongs to `system`.
/// `outer` is the same lens at the shortest and the longest wavelength; without it the chromatic
/// sums are zero. `None` without a chief ray, for surfaces so steep that a sum is no finite number, and
/// for a lens with a GRIN medium, whose third-order contributions are not implemented.
pub fn seidel<R: Real>(
    system: &System<R>,
    data: &FirstOrder<R>,
    outer: Option<(&System<R>, &System<R>)>,
) -> Option<Seidel<R>> {
    if system.has_grin() {
        return None;
    }
    let (chief, lagrange) = (data.chief.as_ref()?, data.lagrange?);
    let indices = signed_indices(system);
    let spread = relative_dispersions(system, &indices, outer);
    let at = |i: usize| {
        let (n, behind) = (indices[i], indices[i + 1]);
        let surface = &system.surfaces[i];
        let c = surface.shape.curvature();
        let (y, y_chief) = (data.marginal.heights[i], chief.heights[i]);
        let heights = SurfaceHeights {
            n,
            behind,
            c,
            y,
            y_chief,
            a: n * (data.marginal.slope_before(i) + y * c),
            a_chief: n * (chief.slope_before(i) + y_chief * c),
            lagrange,
        };
        let colour = spread[i + 1] - spread[i];
        heights.sums(figuring(surface), colour)
    };
    let surfaces: Vec<_> = (0..system.surfaces.len().saturating_sub(1)).map(at).collect();
    let total = surfaces.iter().fold(SeidelSums::default(), SeidelSums::plus);
    let is_finite = surfaces.iter().chain([&total]).all(SeidelSums::is_finite);
    is_finite.then_some(Seidel { surfaces, total })
}

/// `δn/n` of every gap.
fn relative_dispersions<R: Real>(
    system: &System<R>,
    indices: &[R],
    outer: Option<(&System<R>, &System<R>)>,
) -> Vec<R> {
    let Some((short, long)) = outer else { return vec![R::ZERO; indices.len()] };
    let gap = |i: usize| (short.index_before(i) - long.index_before(i)) / system.index_before(i);
    (0..indices.len()).map(gap).collect()
}

/// The excess of the r⁴ term of a surface over that of the sphere with its curvature.
fn figuring<R: Real>(surface: &Surface<R>) -> R {
    let (c, conic, terms) = surface.shape.numbers();
    conic * c * c * c * R::from_f64(0.125) + terms[0]
}

/// The marginal and the chief ray at one surface.
struct SurfaceHeights<R> {
    n: R,
    behind: R,
    c: R,
    y: R,
    y_chief: R,
    a: R,
    a_chief: R,
    lagrange: R,
}

impl<R: Real> SurfaceHeights<R> {
    fn sums(&self, figuring: R, colour: R) -> SeidelSums<R> {
        let Self { n, behind, c, y, y_chief, a, a_chief, lagrange } = *self;
        let (before, after) = (R::ONE / n, R::ONE / behind);
        let inverse = after - before;
        let inverse2 = after * after - before * before;
        let slope = a * inverse2 - y * c * inverse; // Δ(u/n)
        let bent = R::from_f64(8.0) * figuring * (behind - n) * y;
        let tail = c * inverse * y_chief * (a_chief * y + lagrange);
        SeidelSums {
            s1: -(a * a * y * slope) + bent * y * y * y,
            s2: -(a * a_chief * y * slope) + bent * y * y * y_chief,
            s3: -(a_chief * a_chief * y * slope) + bent * y * y_chief * y_chief,
            s4: -(lagrange * lagrange * c * inverse),
            s5: a_chief * (tail - a_chief * a_chief * y * inverse2)
                + bent * y_chief * y_chief * y_chief,
            c1: a * y * colour,
            c2: a_chief * y * colour,
        }
    }
}
