//! Spreads of light with the aberrations in them, and the rays that they are about.
//!
//! Where aberrations are a part of a wavelength, light of a point spreads as the Fourier transform of the pupil
//! with its phase, and not as the pupil without aberrations and the rays one after the other. All light of an image
//! point then follows one ray, the chief ray, into the scene, and is displaced by that spread. The phase is that
//! of backward rays: the optical path from the image point to the wave of the object point that the chief ray
//! meets. It belongs to one distance of the scene, and to aberrations that the raster of directions resolves.

use super::diffraction::{field_at, offsets};
use super::lit_directions::LitDirections;
use super::pupil_spread::{DirectionRaster, PupilSpread, PupilSpreads, RAYS};
use super::{ColorBand, Scene};
use crate::analysis::{BackwardLens, ImageFold, irradiance_beside};
use crate::math::Vec3;
use crate::pupil::{Accuracy, RayModel};
use crate::trace::{Landings, Ray, Rays, TraceSink as _};
use rayon::prelude::*;

/// The distances from the axis at which spreads are tabulated, and at which light is.
const KNOTS: usize = 9;
const LIGHTS: usize = 33;
/// The largest difference of the paths of neighbours of a raster, in waves: beyond half a wave it is folded.
const LARGEST_STEP: f64 = 0.25;
/// The accuracy of the irradiance.
const ACCURACY: Accuracy = Accuracy { tolerance: 1e-4, max_rays: 20_000 };

/// The chief rays of the points of an image, and the light that each stands for.
#[derive(Debug, Clone)]
pub(super) struct AimedLight {
    /// The distances of knots in mm, of chief rays and of light.
    steps: [f64; 2],
    /// The direction cosines along y of the chief rays for points of the y axis.
    chiefs: Vec<f64>,
    /// The irradiance for radiance 1, by wavelength of every colour.
    lights: Vec<Vec<f64>>,
    /// The number of wavelengths of each colour that come before it.
    offsets: Vec<usize>,
}

/// A number between knots.
fn between(knots: &[f64], step: f64, radius: f64) -> f64 {
    let last = knots.len() - 1;
    let place = (radius / step).clamp(0.0, last as f64);
    let index = (place as usize).min(last - 1);
    knots[index] + (place - index as f64) * (knots[index + 1] - knots[index])
}

impl AimedLight {
    /// The direction cosines of the chief ray at a distance from the axis, for a point of the y axis.
    #[inline(always)]
    pub(super) fn chief(&self, radius: f64) -> [f64; 2] {
        [0.0, between(&self.chiefs, self.steps[0], radius)]
    }

    /// The irradiance there for radiance 1, at a wavelength of a colour.
    #[inline(always)]
    pub(super) fn light(&self, [color, wavelength]: [usize; 2], radius: f64) -> f64 {
        between(&self.lights[self.offsets[color] + wavelength], self.steps[1], radius)
    }

    /// The chief rays of a model up to `reach` mm from the axis, and their light in some colours; `None` where one
    /// is not known.
    pub(super) fn new(model: &RayModel, bands: &[ColorBand], reach: f64) -> Option<Self> {
        let steps = [reach / (KNOTS - 1) as f64, reach / (LIGHTS - 1) as f64];
        let chiefs = (0..KNOTS).map(|i| chief(model, steps[0] * i as f64));
        let chiefs = chiefs.collect::<Option<Vec<f64>>>()?;
        let all: Vec<usize> = wavelengths(bands);
        let folds: Vec<_> =
            all.iter().map(|wavelength| ImageFold::find(model, *wavelength)).collect();
        let light = |i: usize| {
            let (set, at) = (i / LIGHTS, [0.0, steps[1] * (i % LIGHTS) as f64]);
            match irradiance_beside(folds[set], model, all[set], at, ACCURACY) {
                Ok(found) => Some(found.value),
                Err(why) => why.is_loss_of_light().then_some(0.0),
            }
        };
        let lights: Option<Vec<f64>> = (0..all.len() * LIGHTS).into_par_iter().map(light).collect();
        let lights = lights?;
        let lights = lights.chunks(LIGHTS).map(<[f64]>::to_vec).collect();
        Some(Self { steps, chiefs, lights, offsets: offsets(bands) })
    }
}

/// A lens whose spreads are tabulated, and its scene, which is at the distance of its first plane.
pub(super) struct AberratedLens<'a> {
    pub(super) model: &'a RayModel,
    pub(super) bands: &'a [ColorBand],
    pub(super) directions: &'a LitDirections,
    pub(super) scene: &'a Scene,
}

impl AberratedLens<'_> {
    /// The spreads at points up to `reach` mm from the axis, with displacements up to `margin` mm; `None` where a
    /// chief ray is lost or the aberrations are too large for the raster.
    pub(super) fn spreads(&self, reach: f64, margin: f64) -> Option<PupilSpreads> {
        let aimed = AimedLight::new(self.model, self.bands, reach)?;
        let wavelengths = wavelengths(self.bands);
        let lens = |w: &usize| BackwardLens::for_picture(self.model, *w).ok();
        let lenses = wavelengths.iter().map(lens).collect::<Option<Vec<BackwardLens>>>()?;
        let one = |i: usize| {
            let (set, knot) = (i / KNOTS, i % KNOTS);
            let radius = aimed.steps[0] * knot as f64;
            self.spread((&lenses[set], wavelengths[set]), radius, aimed.chiefs[knot])
        };
        let found: Option<Vec<PupilSpread>> =
            (0..lenses.len() * KNOTS).into_par_iter().map(one).collect();
        let sets = found?.chunks(KNOTS).map(<[PupilSpread]>::to_vec).collect();
        PupilSpreads::aberrated((sets, offsets(self.bands)), aimed, [reach, margin])
    }

    /// The spread at a distance from the axis about a chief ray.
    fn spread(
        &self,
        (lens, wavelength): (&BackwardLens, usize),
        radius: f64,
        chief: f64,
    ) -> Option<PupilSpread> {
        let channel = &self.model.channels[wavelength];
        let wave = 1e-3 * channel.um;
        let mut first = Rays::default();
        first.push(lens.ray([0.0, radius], [0.0, chief])?.0);
        let mut landed = Landings::default();
        lens.trace(&first, &mut landed);
        if !landed.fate(0).is_imaged() {
            return None;
        }
        let index = channel.system.index_before;
        // Paths end in front of the lens: beyond it, what rays miss the object by would count with the square.
        let ended = |landed: &Landings<f64>, i: usize| {
            let (far, near) = (lens.exit(landed.ray(i)), lens.scene_ray(landed.ray(i)));
            let back = (far.point - near.point).dot(near.direction);
            (near, landed.opl[i] - index * back)
        };
        let (chief, path) = ended(&landed, 0);
        let distance = self.scene.layers().first().and_then(|layer| layer.distance);
        let target = ObjectWave { chief, path, index, distance };
        let raster = DirectionRaster::new(self.directions, radius)?;
        let (landed, places) = raster.trace(lens, radius);
        let (mut lit, mut waves) = (vec![false; RAYS * RAYS], vec![0.0; RAYS * RAYS]);
        for (ray, place) in places.into_iter().enumerate() {
            lit[place] = landed.fate(ray).is_imaged();
            if lit[place] {
                let (ray, path) = ended(&landed, ray);
                waves[place] = target.difference(ray, path)? / wave;
            }
        }
        is_resolved(&lit, &waves)
            .then(|| PupilSpread::of_raster(&lit, Some(&waves), raster.step))?
    }
}

/// The wavelengths of all colours, one after the other.
fn wavelengths(bands: &[ColorBand]) -> Vec<usize> {
    bands.iter().flat_map(|band| &band.wavelengths).map(|(wavelength, _)| *wavelength).collect()
}

/// The direction cosine along y, backwards, of the chief ray that lands at a distance from the axis.
fn chief(model: &RayModel, radius: f64) -> Option<f64> {
    let field = field_at(model, radius)?;
    let launch = model.launch(field, model.primary).ok()?;
    let landed = launch.unclipped_landing([0.0; 2])?.ray;
    let [height, cosine, ahead] =
        [landed.point.y, landed.direction.y, landed.direction.z].map(|v| v.value);
    // Light goes the other way; on the other side of the axis it is mirrored.
    let side = if height < 0.0 { -1.0 } else { 1.0 };
    (ahead.abs() > 0.0).then_some(-side * cosine)
}

/// The wave of the object point that a chief ray meets.
struct ObjectWave {
    /// The chief ray where it leaves the lens, its optical path until there, and the index there.
    chief: Ray<f64>,
    path: f64,
    index: f64,
    /// The distance of the object point in front of the first vertex; `None` at infinity.
    distance: Option<f64>,
}

impl ObjectWave {
    /// The optical path of a ray that leaves the lens, from the image point to the object's wave, beyond that of the
    /// chief ray, in mm.
    fn difference(&self, ray: Ray<f64>, path: f64) -> Option<f64> {
        let (at, toward) = (self.chief.point, self.chief.direction);
        let beyond = match self.distance {
            None => toward.dot(at - ray.point),
            Some(distance) => {
                let ahead = (-distance - at.z) / toward.z;
                let object = at + toward * ahead;
                // The difference of two lengths without that of large numbers.
                let (a, b) = (object - ray.point, object - at);
                let sign = if ahead < 0.0 { -1.0 } else { 1.0 };
                sign * (a - b).dot(a + b) / (length(a) + length(b))
            }
        };
        let difference = path - self.path + self.index * beyond;
        difference.is_finite().then_some(difference)
    }
}

fn length(v: Vec3<f64>) -> f64 {
    v.dot(v).sqrt()
}

/// True if the paths of lit neighbours, in waves, differ by less than what the raster resolves.
fn is_resolved(lit: &[bool], waves: &[f64]) -> bool {
    let near =
        |a: usize, b: usize| !(lit[a] && lit[b]) || (waves[a] - waves[b]).abs() < LARGEST_STEP;
    (0..RAYS * RAYS).all(|i| {
        (i % RAYS == RAYS - 1 || near(i, i + 1)) && (i + RAYS >= RAYS * RAYS || near(i, i + RAYS))
    })
}
