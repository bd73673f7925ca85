//! Ghosts: light that two surfaces reflect on its way to the image.
//!
//! Light is reflected at a surface j and again at a surface i in front of it. Unfolded, its path is a lens
//! of its own: surfaces 0 to j, back to i, and on to the image, with j and i as mirrors; first-order optics
//! and real rays are those of that lens, and every rim clips at every pass. First-order numbers rank the
//! pairs. They say nothing of aberrations and total reflection, so real rays follow.
//!
//! Four reflections are left out: they bring at most about a thousandth of what two do.

mod coated_lens;
mod path;
mod real;

pub use coated_lens::{CoatedLens, PassedLight};
pub use path::{GhostPath, GhostRay};
pub use real::GhostPatch;

use super::coating::Coating;
use crate::lens::{FieldPoint, Surface, SurfaceNumber, System};
use crate::math::Vec3;
use crate::pupil::RayModel;
use rayon::prelude::*;

/// The lens cannot be searched for ghosts.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GhostError {
    /// A surface is a mirror, decentred, tilted or an ideal element, a gradient begins there, or light cannot be
    /// traced through it.
    #[error(
        "surface {surface} {what}; ghosts are those of centred lenses without mirrors and gradients"
    )]
    NotPlain {
        /// The surface.
        surface: SurfaceNumber,
        /// Its kind, as the rest of a sentence.
        what: &'static str,
    },
    /// Fewer than two surfaces reflect.
    #[error("fewer than two surfaces reflect light; expected two where the index changes")]
    NoPair,
    /// The surfaces do not reflect in this order.
    #[error(
        "no light is reflected at surface {first}, then at surface {second}; expected a later and an \
             earlier surface where the index changes"
    )]
    WrongPair {
        /// The surface of the first reflection.
        first: SurfaceNumber,
        /// The surface of the second one.
        second: SurfaceNumber,
    },
}

/// A ghost by first-order optics, for collimated light along the axis that fills the entrance pupil.
#[derive(Debug, Clone, PartialEq)]
pub struct ParaxialGhost {
    /// The surface of the first reflection.
    pub first: usize,
    /// The surface of the second one, in front of it.
    pub second: usize,
    /// The rows (A, B) and (C, D) of the matrix of `(y, n u)` from the first vertex to the last.
    pub matrix: [[f64; 2]; 2],
    /// The focal length in mm, −1/C; `None` for an afocal path.
    pub focal_length: Option<f64>,
    /// The focus behind the image plane, in mm; `None` for an afocal path.
    pub focus: Option<f64>,
    /// The radius of the full beam in the image plane, in mm.
    pub radius: f64,
    /// The share of the diameter of the beam that passes all rims; 1 if it passes whole.
    pub clip_factor: f64,
    /// The surface that clips most.
    pub clipped_at: Option<usize>,
    /// The height of the centre of the ghost per unit tangent of the field, in mm.
    pub height_per_tangent: f64,
    /// The product of both reflected shares, at normal incidence.
    pub reflected: f64,
    /// That times what all surfaces on the way let pass.
    pub transmitted: f64,
    /// The irradiance inside the ghost over that at the entrance of the lens; infinite in focus.
    pub irradiance: f64,
    /// The share of the light of the entrance pupil in the ghost.
    pub flux: f64,
}

/// The ghosts of a lens by first-order optics.
#[derive(Debug, Clone, PartialEq)]
pub struct GhostRanking {
    /// The brightest first, by the irradiance inside.
    pub ghosts: Vec<ParaxialGhost>,
    /// The share of the light that arrives without reflections, at normal incidence.
    pub direct: f64,
    /// The share of the light of the entrance pupil in all ghosts.
    pub flux: f64,
}

/// A ghost of a field, by first-order optics and by real rays.
#[derive(Debug, Clone, PartialEq)]
pub struct Ghost {
    /// First-order optics.
    pub paraxial: ParaxialGhost,
    /// Real rays.
    pub patch: GhostPatch,
}

/// Ranks the ghosts of a lens at a wavelength by first-order optics.
///
/// # Errors
/// A lens with other surfaces than centred refracting ones, or with fewer than two that reflect.
pub fn rank_ghosts(
    model: &RayModel,
    wavelength: usize,
    coating: Coating,
) -> Result<GhostRanking, GhostError> {
    let channel = &model.channels[wavelength];
    let (system, mm) = (&channel.system, 1e-3 * channel.um);
    check(system)?;
    let surfaces = reflecting(system);
    let pairs = surfaces.iter().enumerate();
    let pairs = pairs.flat_map(|(k, j)| surfaces[..k].iter().map(move |i| [*j, *i]));
    let mut ghosts = Vec::new();
    for pair in pairs {
        ghosts.push(GhostPath::new(system, pair)?.paraxial(model, mm, coating));
    }
    if ghosts.is_empty() {
        return Err(GhostError::NoPair);
    }
    ghosts.sort_by(|a, b| b.irradiance.total_cmp(&a.irradiance));
    let passed = |i: &usize| 1.0 - normal(system, *i, mm, coating);
    Ok(GhostRanking {
        direct: surfaces.iter().map(passed).product(),
        flux: ghosts.iter().map(|ghost| ghost.flux).sum(),
        ghosts,
    })
}

/// The ghosts of a field by about `rays` real rays each, the brightest first, for the first `count` of a
/// ranking.
///
/// # Errors
/// As of [`rank_ghosts`].
pub fn ghosts(
    model: &RayModel,
    (field, wavelength): (FieldPoint, usize),
    coating: Coating,
    (count, rays): (usize, usize),
) -> Result<(GhostRanking, Vec<Ghost>), GhostError> {
    let ranking = rank_ghosts(model, wavelength, coating)?;
    let system = &model.channels[wavelength].system;
    let beam = real::ArrivingBeam::new(model, field, wavelength, rays);
    let real = |ghost: &ParaxialGhost| {
        let path = GhostPath::new(system, [ghost.first, ghost.second])?;
        let patch = beam.patch(&path, coating);
        Ok(Ghost { paraxial: ghost.clone(), patch })
    };
    let found: Result<Vec<Ghost>, GhostError> =
        ranking.ghosts[..count.min(ranking.ghosts.len())].par_iter().map(real).collect();
    let mut found = found?;
    found.sort_by(|a, b| b.patch.irradiance.total_cmp(&a.patch.irradiance));
    Ok((ranking, found))
}

/// The rays of a ghost in the section of a field, from in front of the lens to where each ends: about
/// `count` of them, which fill the entrance pupil.
///
/// # Errors
/// As of [`rank_ghosts`], or a pair that does not reflect.
pub fn ghost_section(
    model: &RayModel,
    (field, wavelength): (FieldPoint, usize),
    pair: [usize; 2],
    count: usize,
) -> Result<Vec<Vec<Vec3<f64>>>, GhostError> {
    let system = &model.channels[wavelength].system;
    let path = GhostPath::new(system, pair)?;
    let Ok(launch) = model.launch(field, wavelength) else { return Ok(Vec::new()) };
    let front = -FRONT * system.total_track().abs();
    let height = |i: usize| 2.0 * (i as f64 + 0.5) / count as f64 - 1.0;
    let rays = (0..count).filter_map(|i| launch.ray([0.0, height(i)]));
    let points = rays.map(|ray| {
        let back = (front - ray.point.z) / ray.direction.z;
        let start = ray.point + ray.direction * back.min(0.0);
        std::iter::once(start).chain(path.points(ray)).collect()
    });
    Ok(points.collect())
}

/// The distance in front of the lens at which drawn rays begin, over the length of the lens.
const FRONT: f64 = 0.2;

fn check(system: &System<f64>) -> Result<(), GhostError> {
    let other = |(i, surface): (usize, &Surface<f64>)| {
        let what = match surface {
            own if own.mirror => "is a mirror",
            own if own.is_mounted() => "is not centred, or an ideal element",
            own if own.grin.is_some() => "is in front of a GRIN medium",
            _ => return None,
        };
        Some(GhostError::NotPlain { surface: i.into(), what })
    };
    system.surfaces.iter().enumerate().find_map(other).map_or(Ok(()), Err)
}

/// The surfaces where the index changes, the image plane left out.
fn reflecting(system: &System<f64>) -> Vec<usize> {
    let last = system.surfaces.len().saturating_sub(1);
    (0..last).filter(|i| system.index_before(*i) != system.surfaces[*i].index).collect()
}

/// The reflected share of a surface at normal incidence.
fn normal(system: &System<f64>, surface: usize, wavelength: f64, coating: Coating) -> f64 {
    let indices = [system.index_before(surface), system.surfaces[surface].index];
    coating.reflectance(indices, wavelength, 1.0)[0]
}
