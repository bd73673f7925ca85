//! The first intersection of a ray with an even asphere.
//!
//! Newton's iteration from the conic alone is not safe: it can jump to another crossing of a wavy
//! surface, or leave the domain. Its result is trusted if the surface is nowhere steep enough to be
//! crossed twice. Otherwise the crossings are isolated (`asphere_crossing`).

use super::interface::Interface;
use crate::lens::{ASPHERE_TERMS, Shape};
use crate::math::Real;
use crate::math::Vec3;

/// A bound of the slope `|dz/dr|` of an asphere within `radius` of the axis, at most a few percent
/// above the largest slope; infinite if there is none. It is the slope at the middle of each of
/// several intervals plus a bound of its change inside.
pub(super) fn slope_bound<R: Real>(shape: &Shape<R>, radius: f64) -> f64 {
    let Shape::Asphere { curvature, conic, terms } = shape else { return 0.0 };
    slope_bound_between(
        curvature.value(),
        conic.value(),
        &terms.map(Real::value),
        (0.0, radius),
        64,
    )
}

/// A lower and an upper bound of the sag of an asphere within `radius` of the axis, in mm; infinite if
/// there is none.
pub(super) fn sag_range<R: Real>(shape: &Shape<R>, radius: f64) -> (f64, f64) {
    let Shape::Asphere { curvature, conic, terms } = shape else { return (0.0, 0.0) };
    let (c, conic, terms) = (curvature.value(), conic.value(), terms.map(Real::value));
    let plain = Shape::Asphere { curvature: c, conic, terms };
    let (mut low, mut high, width) = (0.0_f64, 0.0_f64, radius / 64.0);
    for i in 0..64 {
        let (from, to) = (f64::from(i) * width, f64::from(i + 1) * width);
        let middle = 0.5 * (from + to);
        let change = 0.5 * width * slope_bound_between(c, conic, &terms, (from, to), 1);
        let Some((z, _)) = plain.sag(middle * middle).filter(|_| change.is_finite()) else {
            return (f64::NEG_INFINITY, f64::INFINITY);
        };
        (low, high) = (low.min(z - change), high.max(z + change));
    }
    (low, high)
}

/// A bound of the slope between two distances from the axis, from a number of intervals.
#[inline]
pub(super) fn slope_bound_between(
    c: f64,
    conic: f64,
    terms: &[f64],
    (from, to): (f64, f64),
    intervals: u32,
) -> f64 {
    let (mut bound, width): (f64, f64) = (0.0, (to - from) / f64::from(intervals));
    for i in 0..intervals {
        let start = from + f64::from(i) * width;
        let change = 0.5 * width * second_derivative_bound(c, conic, terms, start + width);
        // `max` would ignore NaN.
        if !change.is_finite() {
            return f64::INFINITY;
        }
        bound = bound.max(slope_at(c, conic, terms, start + 0.5 * width).abs() + change);
    }
    bound
}

/// `dz/dr` at a distance from the axis.
#[inline]
fn slope_at(c: f64, conic: f64, terms: &[f64], r: f64) -> f64 {
    let r2 = r * r;
    let polynomial = terms.iter().enumerate().rev();
    let sum = polynomial.fold(0.0, |sum, (j, a)| sum * r2 + (2 * j + 4) as f64 * a);
    c * r / (1.0 - (1.0 + conic) * c * c * r2).sqrt() + sum * r2 * r
}

/// A bound of `|d²z/dr²|` within `radius` of the axis.
#[inline]
pub(super) fn second_derivative_bound(c: f64, conic: f64, terms: &[f64], radius: f64) -> f64 {
    let r2 = radius * radius;
    let radicand = 1.0 - (1.0 + conic) * c * c * r2;
    if !(radicand > 0.0 && radius.is_finite()) {
        return f64::INFINITY;
    }
    // A conic that flattens outwards has its largest second derivative at the vertex.
    let least = radicand.min(1.0);
    let mut bound = c.abs() / (least * least.sqrt());
    let mut power = r2;
    for (j, a) in terms.iter().enumerate() {
        bound += ((2 * j + 4) * (2 * j + 3)) as f64 * a.abs() * power;
        power *= r2;
    }
    bound
}

impl Interface<f64> {
    /// A lower and an upper bound of the sag between two distances from the axis at which the surface
    /// exists, and the size of the numbers that it is the sum of, in mm.
    #[inline]
    pub(super) fn sag_bounds(&self, (from, to): (f64, f64)) -> (f64, f64, f64) {
        let conic = Self { terms: [0.0; ASPHERE_TERMS], ..*self };
        // A conic rises or falls all the way to its edge.
        let (a, b) = (conic.sag(from * from).0, conic.sag(to * to).0);
        let flat = Self { curvature: 0.0, ..*self };
        let flat_sag = |terms, r: f64| Self { terms, ..flat }.sag(r * r).0;
        let middle = flat_sag(self.terms, 0.5 * (from + to));
        let largest = Self { terms: self.terms.map(f64::abs), ..flat };
        let change = (to - from) * to * largest.sag(to * to).1;
        // Terms of one sign rise or fall all the way: far better in a wide interval.
        let (rising, falling) = (self.terms.map(|a| a.max(0.0)), self.terms.map(|a| a.min(0.0)));
        let lowest = flat_sag(rising, from) + flat_sag(falling, to);
        let highest = flat_sag(rising, to) + flat_sag(falling, from);
        let (low, high) = (lowest.max(middle - change), highest.min(middle + change));
        let size = a.abs() + b.abs() + largest.sag(to * to).0;
        (a.min(b) + low, a.max(b) + high, size)
    }
}

impl<R: Real> Interface<R> {
    /// The square of the distance from the axis up to which the conic exists and nothing is clipped.
    #[inline(always)]
    fn usable_radius2(&self) -> R {
        let square = (R::ONE + self.conic) * self.curvature * self.curvature;
        let exists = R::select(square > R::ZERO, R::ONE / square, self.rim2);
        R::select(exists < self.rim2, exists, self.rim2)
    }
}

/// The crossings of rays with an asphere by Newton's iteration, and whether they can be trusted.
pub(super) struct NewtonResult<R, const W: usize> {
    /// The parameters along `k`.
    pub(super) s: [R; W],
    /// 1 if this is the only crossing inside the semi-diameter, else 0; a number of the same width as
    /// the others, so that the vector instructions need no conversion.
    pub(super) trusted: [R; W],
}

/// Points of rays and optical directions, as columns.
pub(super) struct RayStarts<R, const W: usize> {
    columns: [[R; W]; 6],
}

impl<R: Real, const W: usize> RayStarts<R, W> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { columns: [[R::ZERO; W]; 6] }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, j: usize, p: Vec3<R>, k: Vec3<R>) {
        let numbers = [p.x, p.y, p.z, k.x, k.y, k.z];
        self.columns.iter_mut().zip(numbers).for_each(|(column, number)| column[j] = number);
    }

    #[inline(always)]
    pub(super) fn get(&self, j: usize) -> (Vec3<R>, Vec3<R>) {
        let [x, y, z, kx, ky, kz] = &self.columns;
        (Vec3::new(x[j], y[j], z[j]), Vec3::new(kx[j], ky[j], kz[j]))
    }
}

/// At most `STEPS` steps of Newton's iteration for the distances `s` along rays in a medium whose index
/// has the square `n2`, by the height above a surface and its slope along the ray. Returns which rays
/// still move: each stops on its own, so that its result does not depend on the other rays.
#[inline(always)]
pub(super) fn iterate_newton<R: Real, const W: usize, const STEPS: usize>(
    rays: &RayStarts<R, W>,
    n2: R,
    s: &mut [R; W],
    height: impl Fn(Vec3<R>, Vec3<R>) -> (R, R),
) -> [R; W] {
    let mut moving = [R::ONE; W];
    let tolerance = R::from_f64(R::EPSILON.powf(2.0 / 3.0));
    for _ in 0..STEPS {
        for j in 0..W {
            let (p, k) = rays.get(j);
            let (f, slope) = height(p + k * s[j], k);
            let step = f / slope;
            // The next step would be smaller than the square of this one.
            let size = p.x.abs() + p.y.abs() + p.z.abs();
            let settled = step * step * n2 <= tolerance * tolerance * size * size;
            s[j] = R::select(moving[j] > R::ZERO, s[j] - step, s[j]);
            moving[j] = R::select(settled, R::ZERO, moving[j]);
        }
        if moving.iter().all(|moving| *moving == R::ZERO) {
            break;
        }
    }
    moving
}

/// Newton's iteration from the conic, or from the vertex plane for a ray that misses the conic.
#[inline(always)]
pub(super) fn newton_crossings<R: Real, const W: usize>(
    surface: &Interface<R>,
    rays: &RayStarts<R, W>,
) -> NewtonResult<R, W> {
    let near = Interface { starts_far: false, ..*surface };
    let mut s = [R::ZERO; W];
    for (j, s) in s.iter_mut().enumerate() {
        let (p, k) = rays.get(j);
        let conic = near.intersect_conic(p, k);
        *s = R::select(conic.missed, -(p.z / k.z), conic.s);
    }
    let moving = iterate_newton::<R, W, NEWTON_STEPS>(rays, surface.n2, &mut s, |point, k| {
        surface.height_above(point, k)
    });
    let bound = R::from_f64(surface.slope_bound);
    let bound2 = bound * bound;
    let trusted = std::array::from_fn(|j| {
        let (p, k) = rays.get(j);
        let point = p + k * s[j];
        let across2 = k.x * k.x + k.y * k.y;
        // A ray along the axis crosses a graph once, however steep that may be elsewhere.
        let unique = (across2 == R::ZERO) | (bound2 * across2 < k.z * k.z);
        let inside = point.x * point.x + point.y * point.y <= surface.usable_radius2();
        R::select(unique & inside & !(moving[j] > R::ZERO), R::ONE, R::ZERO)
    });
    NewtonResult { s, trusted }
}

/// The number of steps of Newton's iteration before a crossing is isolated instead.
const NEWTON_STEPS: usize = 10;

#[cfg(test)]
mod tests {
    use crate::lens::{ASPHERE_TERMS, Shape, Surface, System};
    use crate::trace::Tracer;

    #[test]
    fn the_sag_of_an_asphere_stays_within_its_bounds() {
        let shape = Shape::Asphere {
            curvature: 0.05,
            conic: -0.4,
            terms: std::array::from_fn(|j| [-2e-5, 3e-7, -1e-9].get(j).copied().unwrap_or(0.0)),
        };
        let surface = Surface { shape, ..Surface::plane(1.0, 1.5) };
        let surfaces = vec![surface, Surface::plane(0.0, 1.5)];
        let tracer = Tracer::new(&System { index_before: 1.0, surfaces, stop: None }).unwrap();
        let interface = tracer.interfaces[0];
        for range in [(0.0, 0.1), (2.0, 2.05), (4.0, 4.02)] {
            let (low, high, _) = interface.sag_bounds(range);
            let sag = |r: f64| interface.sag(r * r).0;
            for r in [range.0, 0.5 * (range.0 + range.1), range.1] {
                assert!(low <= sag(r) && sag(r) <= high, "{low} {} {high}", sag(r));
            }
            let own = (sag(range.1) - sag(range.0)).abs();
            assert!(high - low < 10.0 * own + 1e-3, "{low} {high}, but it changes by {own}");
        }
    }

    #[test]
    fn the_bounds_of_terms_of_one_sign_are_their_ends() {
        let mut terms = [0.0; ASPHERE_TERMS];
        (terms[1], terms[2]) = (3e-4, 0.046);
        let shape = Shape::Asphere { curvature: 0.0, conic: 0.0, terms };
        let surface = Surface { shape, ..Surface::plane(1.0, 1.5) };
        let surfaces = vec![surface, Surface::plane(0.0, 1.5)];
        let tracer = Tracer::new(&System { index_before: 1.0, surfaces, stop: None }).unwrap();
        let interface = tracer.interfaces[0];
        let (low, high, _) = interface.sag_bounds((5.0, 22.0));
        assert_eq!([low, high], [25.0, 484.0].map(|r2| interface.sag(r2).0));
    }

    /// The second differences of the sag, by `z = c r²/(1 + √(1 − (1 + k) c² r²)) + Σ a r^(4 + 2 j)`, are
    /// nowhere above their bound.
    #[test]
    fn the_bound_of_the_second_derivative_holds() {
        for (c, conic, terms) in [
            (0.0, 0.0, vec![3e-5]),
            (0.05, -0.7, vec![1e-5, -4e-8]),
            (-0.04, 0.5, vec![0.0, 0.0, 2e-10]),
            (0.02, 0.0, vec![-2e-5, 0.0, 0.0, 5e-13]),
        ] {
            let sag = |r: f64| {
                let conic = c * r * r / (1.0 + (1.0 - (1.0 + conic) * c * c * r * r).sqrt());
                terms.iter().enumerate().fold(conic, |z, (j, a)| z + a * r.powi(4 + 2 * j as i32))
            };
            let radius = 9.0;
            let bound = super::second_derivative_bound(c, conic, &terms, radius);
            let h = 1e-3;
            for i in 0..=200 {
                let r = (radius - h) * f64::from(i) / 200.0;
                let second = (sag(r + h) - 2.0 * sag(r) + sag(r - h)) / (h * h);
                assert!(second.abs() <= bound * (1.0 + 1e-6) + 1e-8, "{r}: {second} {bound}");
            }
        }
    }
}
