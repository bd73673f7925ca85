//! The rays by which a lens is judged: launched once for the lens as designed, and held.

use super::nominal::mirror_image;
use crate::trace::Ray;

/// The rays of all fields.
#[derive(Debug, Clone)]
pub struct Beam {
    /// The fields; their weights add up to 1.
    pub fields: Vec<FieldBeam>,
}

/// The rays of one field.
#[derive(Debug, Clone)]
pub struct FieldBeam {
    /// The weight of the field among all.
    pub weight: f64,
    /// The rays at each wavelength; all weights together add up to 1.
    pub colours: Vec<ColourRays>,
    /// The ray through the centre of the pupil, and its optical path up to its start, in mm.
    pub chief: (Ray<f64>, f64),
}

/// The rays of one field at one wavelength.
#[derive(Debug, Clone, Default)]
pub struct ColourRays {
    /// The index of the wavelength.
    pub wavelength: usize,
    /// The rays, each starting in the frame of the first vertex.
    pub rays: Vec<Ray<f64>>,
    /// The weight of each ray in the spot of the field.
    pub weights: Vec<f64>,
    /// The pupil coordinates of each ray.
    pub pupil: Vec<[f64; 2]>,
    /// The optical path of each ray from a common wavefront to its start, in mm.
    pub paths: Vec<f64>,
}

impl Beam {
    /// The number of rays, without chief rays.
    pub fn rays(&self) -> usize {
        self.fields.iter().flat_map(|field| &field.colours).map(|colour| colour.rays.len()).sum()
    }
}

impl ColourRays {
    /// No rays yet.
    pub fn new(wavelength: usize) -> Self {
        Self { wavelength, ..Self::default() }
    }

    /// Adds a ray and its mirror image in the plane x = 0, with half of the weight each.
    pub(super) fn push_both_sides(
        &mut self,
        ray: Ray<f64>,
        weight: f64,
        pupil: [f64; 2],
        path: f64,
    ) {
        self.push(ray, 0.5 * weight, pupil, path);
        self.push(mirror_image(ray), 0.5 * weight, [-pupil[0], pupil[1]], path);
    }

    /// Adds a ray.
    pub fn push(&mut self, ray: Ray<f64>, weight: f64, pupil: [f64; 2], path: f64) {
        self.rays.push(ray);
        self.weights.push(weight);
        self.pupil.push(pupil);
        self.paths.push(path);
    }
}
