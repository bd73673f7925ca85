//! The changes of rays behind a lens by the numbers of its surfaces.
//!
//! A sweep back gives the changes of the points in one image plane. Rays are straight there: a second sweep
//! to another plane gives those of their slopes.

use super::covariance::MadeNumber;
use super::merits::open_tracers;
use super::spot::ImageRay;
use super::sweep::SweptField;
use super::{ToleranceError, ToleranceScene};
use crate::lens::System;
use crate::trace::{Rays, Tracer};

/// The share of the length of a lens by which the second image plane is displaced where the best focus
/// tells no better one.
const PLANE: f64 = 1e-3;

/// The lens in front of its image plane and of another one.
pub(super) struct TwoPlanes {
    pub(super) near: Vec<Tracer<f64>>,
    pub(super) far: Vec<Tracer<f64>>,
    /// The distance of the planes in mm.
    pub(super) distance: f64,
}

impl TwoPlanes {
    /// The planes of a lens; the second one at a focus in mm, if that is far enough from the first one.
    pub(super) fn new(scene: &ToleranceScene, focus: f64) -> Result<Self, ToleranceError> {
        let systems = &scene.lens.systems;
        let length = systems[scene.lens.primary].vertex_positions().last().map_or(1.0, |z| z.abs());
        let least = PLANE * if length > 0.0 { length } else { 1.0 };
        let distance = if focus.abs() > least { focus } else { least };
        let displaced = |system: &System<f64>| {
            let mut system = system.clone();
            let last = system.surfaces.len().saturating_sub(2);
            system.surfaces[last].thickness += distance;
            system
        };
        let far: Vec<System<f64>> = systems.iter().map(displaced).collect();
        Ok(Self { near: open_tracers(systems)?, far: open_tracers(&far)?, distance })
    }

    /// The rays of a field, those of each wavelength one after the other, with their changes.
    ///
    /// # Errors
    /// The first ray that does not arrive.
    pub(super) fn rays(
        &self,
        scene: &ToleranceScene,
        field: usize,
        colours: &[(usize, Rays<f64>)],
    ) -> Result<SweptRays, ToleranceError> {
        let lost = |(_, ray, fate)| ToleranceError::RayLost { field, ray, fate };
        let near = SweptField::of_rays(scene, &self.near, colours).map_err(lost)?;
        let far = SweptField::of_rays(scene, &self.far, colours).map_err(lost)?;
        Ok(SweptRays { near, far, distance: self.distance })
    }
}

/// The rays of a field at the image plane and their derivatives by numbers of surfaces.
pub(super) struct SweptRays {
    near: SweptField,
    far: SweptField,
    distance: f64,
}

impl SweptRays {
    /// The rays.
    pub(super) fn at_rest(&self) -> Vec<ImageRay<f64>> {
        let ([x, y], [u, v]) = (self.near.offsets(), self.near.slopes());
        (0..x.len()).map(|i| [x[i], y[i], u[i], v[i]]).collect()
    }

    /// Their derivatives by a combination of numbers.
    pub(super) fn changes<'a>(
        &self,
        combination: impl Iterator<Item = (&'a MadeNumber, f64)>,
    ) -> Vec<ImageRay<f64>> {
        let count = self.near.offsets()[0].len();
        let mut changes = vec![[0.0; 4]; count];
        let mut effects = [vec![0.0; count], vec![0.0; count]];
        for (number, by) in combination {
            for axis in 0..2 {
                self.near.number_effect(axis, *number, &mut effects[0]);
                self.far.number_effect(axis, *number, &mut effects[1]);
                for (change, (near, far)) in
                    changes.iter_mut().zip(effects[0].iter().zip(&effects[1]))
                {
                    change[axis] += by * near;
                    change[2 + axis] += by * (far - near) / self.distance;
                }
            }
        }
        changes
    }
}
