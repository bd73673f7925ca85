//! Central differences of the integral, with the edge of the pupil searched for in every changed
//! lens.
//!
//! Each number is changed by plus and minus a step and twice that, with the same pupil coordinates:
//!
//! ```text
//! D(h) = (L(t+h) − L(t−h)) / 2h    dL/dt ≈ D(h) + (D(h) − D(2h)) / 3
//! ```
//!
//! (Richardson, Phil. Trans. A 210, 1911). The correction is the estimate of the error: much too
//! large if the integral is smooth, and right if a step reaches a corner of it. No derivative is
//! computed here, which makes this the check of those that are, at the cost of four searches for
//! the edge and four quadratures a number.

use super::{PupilDerivative, QuadraticIntegrand};
use crate::lens::{
    APERTURE_NUMBERS, ProfileCoefficients, ProfileLaw, RADIAL_TERMS, System, SystemError,
};
use crate::pupil::region::{Region, RegionKind, TracedPupil};
use crate::trace::{SurfaceParameter, SystemGradient};

/// The shorter step, relative to the scale of a number: long enough that rounding of the integral
/// leaves ten digits, short enough that its fourth power is negligible.
const STEP: f64 = 3e-4;
/// The smallest ray height at a surface, relative to the largest at any, from which its steps are
/// derived.
const NARROW: f64 = 1e-3;
/// The smallest `c² r²` from which the step of a conic constant is derived: surfaces may be flat.
const FLAT: f64 = 1e-2;

impl Region<'_> {
    /// The derivative of an integral over this pupil by central differences, at an order of
    /// quadrature; `None` if nothing gets through or nothing limits the beam.
    pub fn difference_derivative(
        &self,
        cost: &QuadraticIntegrand,
        order: usize,
    ) -> Option<PupilDerivative> {
        if matches!(self.kind, RegionKind::Dark | RegionKind::Unbounded) {
            return None;
        }
        let lit = self.trace_pupil(order);
        let scales = SurfaceScales::of(&lit);
        let mut moved =
            PerturbedIntegral { region: self, cost, order, rays: self.rays + lit.rays_traced };
        let system = &self.launch.channel().system;
        let mut found = PupilDerivative::zero(system.surfaces.len());
        let of_index = |system: &mut System<f64>, step: f64| system.index_before += step;
        [found.gradient.index_before, found.error.index_before] =
            moved.derivative(STEP * system.index_before, of_index);
        for (i, surface) in system.surfaces.iter().enumerate() {
            for slot in SurfaceParameter::all().filter(|slot| slot.exists_on(surface)) {
                let Some(step) = scales.step(system, i, slot) else { continue };
                let by_slot = |system: &mut System<f64>, step: f64| {
                    slot.promote_shape(system, i);
                    slot.shift(system, i, step);
                };
                let [by, error] = moved.derivative(step, by_slot);
                found.gradient.surfaces[i].set(slot, by);
                found.error.surfaces[i].set(slot, error);
            }
        }
        found.rays = moved.rays;
        Some(found)
    }
}

/// The largest ray height at each surface, in mm.
struct SurfaceScales {
    heights: Vec<f64>,
    widest: f64,
}

impl SurfaceScales {
    fn of(lit: &TracedPupil<'_>) -> Self {
        let tracer = &lit.region.launch.channel().tracer;
        let mut heights = vec![0.0_f64; tracer.surfaces()];
        for i in 0..lit.rays.len() {
            tracer.visit(lit.rays.get(i), |surface, p| {
                heights[surface] = heights[surface].max(p.x.hypot(p.y));
            });
        }
        let widest = heights.iter().copied().fold(0.0, f64::max);
        heights.iter_mut().for_each(|height| *height = height.max(NARROW * widest));
        Self { heights, widest }
    }

    /// The shorter step of a number: each turns rays by about the same small angle. `None` for an
    /// infinite semi-diameter and if there is no scale.
    fn step(&self, system: &System<f64>, surface: usize, slot: SurfaceParameter) -> Option<f64> {
        let (row, r) = (&system.surfaces[surface], self.heights[surface]);
        let scale = match slot {
            SurfaceParameter::Curvature => 1.0 / r,
            SurfaceParameter::Conic => 1.0 / (row.shape.curvature() * r).powi(2).max(FLAT),
            SurfaceParameter::AsphereTerm(term) => {
                let power = 2 * i32::try_from(term).ok()? + 4;
                1.0 / (f64::from(power) * r.powi(power - 1))
            }
            SurfaceParameter::Thickness => self.widest,
            SurfaceParameter::Index => row.index,
            SurfaceParameter::SemiDiameter => row.semi_diameter,
            // A change of the index that turns rays by about the same angle.
            SurfaceParameter::GrinTerm(k) => {
                let length = row.thickness.abs().max(r);
                grin_scale(row.grin.as_ref()?, k, r, length)
            }
            // A change of the sag by a length r times the angle.
            SurfaceParameter::Freeform(k) => r.powi(row.freeform.as_ref()?.kind.power(k)),
            // An angle in degrees that moves the edge as far as a shift of the others.
            SurfaceParameter::Aperture(k) if k % APERTURE_NUMBERS == APERTURE_NUMBERS - 1 => 30.0,
            SurfaceParameter::Aperture(_) => r,
        };
        let step = STEP * scale;
        (step.is_finite() && step > 0.0).then_some(step)
    }
}

/// The change of a coefficient of an index profile that changes the index by 0.1 at a distance from
/// the axis, or from the vertex.
fn grin_scale(grade: &ProfileCoefficients<f64>, k: usize, r: f64, length: f64) -> f64 {
    let power = match k.checked_sub(RADIAL_TERMS) {
        None if grade.law == ProfileLaw::Sech => return 0.1 / r,
        None => return 0.1 * r.powi(-2 * (k as i32 + 1)),
        Some(j) => j as i32 + 1,
    };
    0.1 * length.powi(-power)
}

/// The integral as a function of the changed lens.
struct PerturbedIntegral<'a> {
    region: &'a Region<'a>,
    cost: &'a QuadraticIntegrand,
    order: usize,
    rays: usize,
}

impl PerturbedIntegral<'_> {
    /// A derivative and its error; the error is infinite if the changed lens has no beam.
    fn derivative(&mut self, step: f64, change: impl Fn(&mut System<f64>, f64)) -> [f64; 2] {
        let mut slope = |h: f64| {
            let [up, down] = [h, -h].map(|h| self.integral(|system| change(system, h)));
            Some((up? - down?) / (2.0 * h))
        };
        let Some((near, far)) = slope(step).zip(slope(2.0 * step)) else {
            return [0.0, f64::INFINITY];
        };
        let correction = (near - far) / 3.0;
        [near + correction, correction.abs()]
    }

    /// The integral over the pupil of a changed lens; `None` if nothing limits its beam.
    fn integral(&mut self, change: impl FnOnce(&mut System<f64>)) -> Option<f64> {
        let launch = &self.region.launch;
        let mut system = launch.channel().system.clone();
        change(&mut system);
        let model: Result<_, SystemError> = launch.model.with_system(launch.wavelength, system);
        let model = model.ok()?;
        let region = Region::new(launch.to_fixed().launch(&model));
        if region.kind == RegionKind::Unbounded {
            return None;
        }
        let lit = region.trace_pupil(region.order_like(&self.region.kind, self.order));
        self.rays += region.rays + lit.rays_traced;
        Some(self.cost.integrate(&lit.moments))
    }
}

impl PupilDerivative {
    fn zero(surfaces: usize) -> Self {
        Self {
            gradient: SystemGradient::zero(surfaces),
            error: SystemGradient::zero(surfaces),
            rays: 0,
            reached: false,
        }
    }
}
