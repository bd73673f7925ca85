//! The path of a ghost, unfolded into a lens with two mirrors.

use super::{GhostError, ParaxialGhost, check, reflecting};
use crate::analysis::coating::Coating;
use crate::lens::{Surface, System};
use crate::math::Vec3;
use crate::paraxial::paraxial_ray;
use crate::pupil::RayModel;
use crate::trace::{Fate, Ray, TracedRay, Tracer};

/// The path of light that is reflected at a surface and again at one in front of it.
#[derive(Debug, Clone)]
pub struct GhostPath {
    /// The surface of the first and of the second reflection.
    pub pair: [usize; 2],
    /// The surfaces of the lens in the order in which light meets them, the image plane last.
    pub steps: Vec<usize>,
    /// The indices in front of every surface on the way and on its other side.
    indices: Vec<[f64; 2]>,
    /// The z of the vertex of every surface on the way, from the first vertex.
    vertices: Vec<f64>,
    system: System<f64>,
    tracer: Tracer<f64>,
}

/// A ray along the path of a ghost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GhostRay {
    /// Its fate, at a step of the path, and its end.
    pub traced: TracedRay<f64>,
    /// The share of its light that arrives, polarised across (s) and in (p) the planes of incidence, as if
    /// these were one plane all along the way.
    pub intensity: [f64; 2],
}

impl GhostPath {
    /// The path through a lens with its image plane last.
    ///
    /// # Errors
    /// A lens with other surfaces than centred refracting ones, or a pair that does not reflect.
    pub fn new(lens: &System<f64>, pair: [usize; 2]) -> Result<Self, GhostError> {
        check(lens)?;
        let [first, second] = pair;
        let surfaces = reflecting(lens);
        if second >= first || pair.iter().any(|i| !surfaces.contains(i)) {
            return Err(GhostError::WrongPair { first: first.into(), second: second.into() });
        }
        let back = (second..first).rev();
        let steps: Vec<usize> =
            (0..=first).chain(back).chain(second + 1..lens.surfaces.len()).collect();
        let z = vertices(lens);
        let vertices = steps.iter().map(|step| z[*step]).collect();
        let system = unfolded(lens, &z, pair, &steps);
        let other = |(k, i): (usize, &usize)| {
            let (front, behind) = (lens.index_before(*i), lens.surfaces[*i].index);
            // Backwards light comes from behind.
            let backwards = k > first && k <= 2 * first - second;
            if backwards { [behind, front] } else { [front, behind] }
        };
        let indices = steps.iter().enumerate().map(other).collect();
        let refuse = |_error| GhostError::NotPlain {
            surface: first.into(),
            what: "cannot be traced backwards",
        };
        let tracer = Tracer::new(&system).map_err(refuse)?;
        Ok(Self { pair, steps, indices, vertices, system, tracer })
    }

    /// A ray that starts in the frame of the first vertex; with rims it ends where one clips it.
    pub fn trace(&self, ray: Ray<f64>, wavelength: f64, coating: Coating) -> GhostRay {
        let mut met = Vec::with_capacity(self.steps.len());
        let traced = self.tracer.visit(ray, |_, point| met.push(point));
        let intensity = intensity(&self.system, (&self.indices, coating), ray, &met, wavelength);
        GhostRay { traced, intensity }
    }

    /// The points where a ray meets the surfaces on the way, as far as it gets, from the first vertex.
    pub fn points(&self, ray: Ray<f64>) -> Vec<Vec3<f64>> {
        let mut met = Vec::with_capacity(self.steps.len());
        self.tracer.visit(ray, |_, point| met.push(point));
        let place = |(point, z): (Vec3<f64>, &f64)| point + Vec3::new(0.0, 0.0, *z);
        met.into_iter().zip(&self.vertices).map(place).collect()
    }

    /// The same path without rims and obstructions that clip.
    #[must_use]
    pub fn without_rims(self) -> Self {
        Self { tracer: self.tracer.without_rims(), ..self }
    }

    /// The surface of the lens at which a ray is lost.
    pub fn lost_at(&self, fate: Fate) -> Option<usize> {
        fate.surface().and_then(|step| self.steps.get(step)).copied()
    }

    /// The ghost by first-order optics.
    pub(super) fn paraxial(
        &self,
        model: &RayModel,
        wavelength: f64,
        coating: Coating,
    ) -> ParaxialGhost {
        let end = self.steps.len() - 2;
        let index = self.system.surfaces[end].index;
        let from = |height: f64, slope: f64| {
            let ray = paraxial_ray(&self.system, height, slope / self.system.index_before);
            (ray.heights[end], index * ray.slopes[end], ray)
        };
        let (a, c, marginal) = from(1.0, 0.0);
        let (b, d, _) = from(0.0, 1.0);
        // A reduced length, as n u is a reduced slope.
        let gap = self.system.surfaces[end].thickness;
        let spread = a + gap / index * c;
        let pupil = 0.5 * model.first_order.entrance_pupil.diameter.unwrap_or(0.0).abs();
        let (clip_factor, clipped_at) = self.clip_factor(&marginal.heights, pupil);
        let shares = self.normal_shares(wavelength, coating);
        let [reflected, passed] = [true, false].map(|mirror| {
            let mine = |(k, share): (usize, &f64)| {
                (self.system.surfaces[k].mirror == mirror).then_some(*share)
            };
            shares.iter().enumerate().filter_map(mine).product::<f64>()
        });
        let transmitted = reflected * passed;
        let position = model.first_order.entrance_pupil.position.unwrap_or(0.0);
        ParaxialGhost {
            first: self.pair[0],
            second: self.pair[1],
            matrix: [[a, b], [c, d]],
            focal_length: (c != 0.0).then(|| -1.0 / c),
            focus: (c != 0.0).then(|| -index * a / c - gap),
            radius: spread.abs() * pupil,
            clip_factor,
            clipped_at,
            height_per_tangent: -spread * position + (b + gap / index * d),
            reflected,
            transmitted,
            irradiance: transmitted / (spread * spread),
            flux: transmitted * clip_factor * clip_factor,
        }
    }

    /// The shares that pass or are reflected at every step at normal incidence.
    fn normal_shares(&self, wavelength: f64, coating: Coating) -> Vec<f64> {
        let steps = self.indices.iter().zip(&self.system.surfaces).take(self.steps.len() - 1);
        let share = |(indices, surface): (&[f64; 2], &Surface<f64>)| {
            let reflected = coating.reflectance(*indices, wavelength, 1.0)[0];
            if surface.mirror { reflected } else { 1.0 - reflected }
        };
        steps.map(share).collect()
    }

    /// The share of a beam of a radius that passes all rims, and the surface that clips most.
    fn clip_factor(&self, heights: &[f64], radius: f64) -> (f64, Option<usize>) {
        let mut least = (1.0, None);
        for (k, step) in self.steps.iter().enumerate().take(self.steps.len() - 1) {
            let factor = self.system.surfaces[k].outer_radius() / (heights[k] * radius).abs();
            if factor < least.0 {
                least = (factor, Some(*step));
            }
        }
        least
    }
}

/// The share of the light of a ray that all surfaces in front of the last let pass, or reflect where they
/// are mirrors, from the points where it meets them; the indices in front of each surface and behind it.
pub(super) fn intensity(
    system: &System<f64>,
    (indices, coating): (&[[f64; 2]], Coating),
    ray: Ray<f64>,
    met: &[Vec3<f64>],
    wavelength: f64,
) -> [f64; 2] {
    let mut shares = [1.0; 2];
    let mut direction = ray.direction;
    for (k, point) in met.iter().enumerate().take(system.surfaces.len() - 1) {
        if k > 0 {
            let gap = system.surfaces[k - 1].thickness;
            direction = unit(*point + Vec3::new(0.0, 0.0, gap) - met[k - 1], direction);
        }
        let surface = &system.surfaces[k];
        let cosine = direction.dot(normal_at(surface, *point)).abs();
        let reflected = coating.reflectance(indices[k], wavelength, cosine);
        for (share, r) in shares.iter_mut().zip(reflected) {
            *share *= if surface.mirror { r } else { 1.0 - r };
        }
    }
    shares
}

/// The z of every vertex, from the first one.
fn vertices(lens: &System<f64>) -> Vec<f64> {
    let mut z = vec![0.0; lens.surfaces.len()];
    for i in 1..z.len() {
        z[i] = z[i - 1] + lens.surfaces[i - 1].thickness;
    }
    z
}

/// The lens that light meets along some steps: gaps run backwards between the two mirrors.
fn unfolded(
    lens: &System<f64>,
    z: &[f64],
    [first, second]: [usize; 2],
    steps: &[usize],
) -> System<f64> {
    let turned = 2 * first - second;
    let surface = |(k, i): (usize, &usize)| {
        let surface = lens.surfaces[*i].clone();
        let next = steps.get(k + 1).map_or(0.0, |next| z[*next] - z[*i]);
        let backwards = k >= first && k < turned;
        let index = if backwards { lens.index_before(*i) } else { surface.index };
        Surface { thickness: next, index, mirror: k == first || k == turned, ..surface }
    };
    let surfaces = steps.iter().enumerate().map(surface).collect();
    System { index_before: lens.index_before, surfaces, stop: None }
}

/// The direction of a step, or that of the one before if two surfaces touch there.
fn unit(step: Vec3<f64>, before: Vec3<f64>) -> Vec3<f64> {
    let length = step.dot(step).sqrt();
    if length > 1e-9 { step * (1.0 / length) } else { before }
}

/// The normal of a surface at a point of it.
fn normal_at(surface: &Surface<f64>, point: Vec3<f64>) -> Vec3<f64> {
    let slope = surface.shape.sag(point.x * point.x + point.y * point.y).map_or(0.0, |(_, s)| s);
    let normal = Vec3::new(-2.0 * slope * point.x, -2.0 * slope * point.y, 1.0);
    normal * (1.0 / normal.dot(normal).sqrt())
}
