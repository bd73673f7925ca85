//! The light that the surfaces and the glasses of a lens let pass, on its way to a point of the image.

use super::path::intensity;
use super::{GhostError, check};
use crate::analysis::{
    coating::Coating,
    seen_from_image::{limited, surrounded},
};
use crate::lens::System;
use crate::math::Vec3;
use crate::pupil::RayModel;
use crate::trace::{Ray, Tracer};

/// A lens with coatings at one wavelength, as seen from points of its image.
#[derive(Debug, Clone)]
pub struct CoatedLens {
    system: System<f64>,
    indices: Vec<[f64; 2]>,
    tracer: Tracer<f64>,
    open: Tracer<f64>,
    /// The wavelength, in mm.
    wavelength: f64,
    coating: Coating,
    /// The absorbance in 1/mm in front of each surface that a ray backwards meets.
    absorbances: Vec<f64>,
}

/// The light of a ray that surfaces and glasses let pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassedLight {
    /// The shares of light polarised across (s) and in (p) the planes of incidence, as if these were one
    /// plane all along the way.
    pub shares: [f64; 2],
    /// True if no rim clips the ray.
    pub is_lit: bool,
}

impl PassedLight {
    /// The share of unpolarised light.
    pub fn mean(&self) -> f64 {
        0.5 * (self.shares[0] + self.shares[1])
    }
}

impl CoatedLens {
    /// The lens of a model at a wavelength, whose glasses are clear.
    ///
    /// # Errors
    /// A lens with other surfaces than centred refracting ones.
    pub fn new(model: &RayModel, wavelength: usize, coating: Coating) -> Result<Self, GhostError> {
        let channel = &model.channels[wavelength];
        check(&channel.system)?;
        let not_traced =
            |_error| GhostError::NotPlain { surface: 0.into(), what: "cannot be traced" };
        let limited = limited(model).map_err(not_traced)?;
        let (system, _) = surrounded(&limited.channels[wavelength].system);
        let tracer = Tracer::new(&system).map_err(not_traced)?;
        let sides = |k: usize| [system.index_before(k), system.surfaces[k].index];
        Ok(Self {
            indices: (0..system.surfaces.len()).map(sides).collect(),
            open: tracer.clone().without_rims(),
            tracer,
            system,
            wavelength: 1e-3 * channel.um,
            coating,
            absorbances: Vec::new(),
        })
    }

    /// The same with glasses that absorb light: `absorbance` is that of the medium behind a surface, in 1/mm.
    /// The space in front of the image is clear.
    #[must_use]
    pub fn with_absorption(self, absorbance: impl Fn(usize) -> f64) -> Self {
        // A ray backwards meets the last surface first.
        let surfaces = self.indices.len() - 1;
        let absorbances = (1..surfaces).rev().map(|behind| absorbance(behind - 1));
        Self { absorbances: std::iter::once(0.0).chain(absorbances).collect(), ..self }
    }

    /// The share of light that the glasses let pass along a ray that meets the surfaces at these points.
    fn internal_transmission(&self, met: &[Vec3<f64>]) -> f64 {
        let absorbed = |(k, absorbance): (usize, &f64)| {
            let gap = self.system.surfaces[k - 1].thickness;
            let step = met[k] + Vec3::new(0.0, 0.0, gap) - met[k - 1];
            absorbance * step.dot(step).sqrt()
        };
        let glasses = self.absorbances.iter().enumerate().filter(|(_, own)| **own > 0.0);
        (-glasses.map(absorbed).sum::<f64>()).exp()
    }

    /// The light of a ray backwards from the image, as a [`BackwardLens`](crate::analysis::BackwardLens)
    /// begins it; `None` if the ray misses a surface or is totally reflected.
    pub fn passed(&self, ray: Ray<f64>) -> Option<PassedLight> {
        let mut met = Vec::with_capacity(self.indices.len());
        let end = self.open.visit(ray, |_, point| met.push(point));
        if !end.fate.is_imaged() {
            return None;
        }
        let shares =
            intensity(&self.system, (&self.indices, self.coating), ray, &met, self.wavelength);
        let glass = self.internal_transmission(&met);
        let shares = shares.map(|share| share * glass);
        Some(PassedLight { shares, is_lit: self.tracer.trace(ray).fate.is_imaged() })
    }
}
