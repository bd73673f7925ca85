//! Real lenses: random errors of making, and rays traced through each lens.

use super::adjusted::{LensToAdjust, mean_spot};
use super::compensation::adjustments;
use super::draw::draw_errors;
use super::merits::{image_ray, open_tracers};
use super::mixture::ErrorMixture;
use super::pupils::{PupilFinder, PupilTreatment, with_rims};
use super::spot::ImageRay;
use super::{Beam, StopTest, ToleranceError, ToleranceScene, best_focus};
use crate::lens::{Compensator, Perturbation, System, ToleranceSheet};
use crate::trace::{ImagePoints, Landings, Rays, TraceSink as _, Tracer};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, Ordering};

/// A lens with random errors.
#[derive(Debug, Clone)]
pub struct RealLens {
    /// The errors, in their units.
    pub errors: Vec<f64>,
    /// The mean square spot radius in mm² at the image plane, and with focus and compensators adjusted
    /// within their travel; `None` if a ray does not arrive.
    pub mean_square: Option<[f64; 2]>,
    /// The adjustments, focus first, in mm or radians; none if a ray does not arrive.
    pub adjustments: Vec<f64>,
    /// The mean squares with the rims that clip, of the rays that they leave, and the share of the light that
    /// they take; the former are those above where the pupils of the lens were found anew. `None` if it was
    /// not asked for or no light is left: the mean squares above are then of the rays of the lens as
    /// designed.
    pub clipped: Option<([f64; 2], f64)>,
}

/// Traces lenses with random errors, in parallel; lens `i` depends on the seed and on `i` alone. The
/// first `with_rims` lenses are traced once more with rims that clip. Once `stop` is true, the first
/// lenses are returned that are traced.
///
/// # Errors
/// An error of making that is not possible.
pub fn real_lenses(
    scene: &ToleranceScene,
    sheet: &ToleranceSheet,
    seed: u64,
    count: usize,
    with_rims: usize,
    stop: &AtomicBool,
) -> Result<Vec<RealLens>, ToleranceError> {
    let stop = || stop.load(Ordering::Relaxed);
    RealLensRun::new(scene, sheet, seed)?.advance((count, with_rims), &stop, |_| {})
}

/// The same without rims, with the pupils of every lens found anew if they are to move.
///
/// # Errors
/// An error of making that is not possible.
pub fn traced_lenses(
    (scene, moving_pupils): (&ToleranceScene, bool),
    sheet: &ToleranceSheet,
    (seed, count): (u64, usize),
    stop: StopTest<'_>,
) -> Result<Vec<RealLens>, ToleranceError> {
    let run = RealLensRun::new(scene, sheet, seed)?.with_pupils(moving_pupils);
    run.advance((count, 0), stop, |_| {})
}

/// Lenses with random errors, some of which may be known from before.
pub(super) struct RealLensRun<'a> {
    made: RandomLenses<'a>,
    lenses: Vec<RealLens>,
}

impl<'a> RealLensRun<'a> {
    /// No lenses yet.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub(super) fn new(
        scene: &'a ToleranceScene,
        sheet: &'a ToleranceSheet,
        seed: u64,
    ) -> Result<Self, ToleranceError> {
        let made = RandomLenses {
            scene,
            sheet,
            seed,
            mixture: ErrorMixture::new(sheet)?,
            adjustments: adjustments(sheet),
            columns: BeamColumns::new(&scene.beam),
            finder: None,
        };
        Ok(Self { made, lenses: Vec::new() })
    }

    /// The same with the pupils of every lens found anew, if they are to move.
    pub(super) fn with_pupils(mut self, move_them: bool) -> Self {
        if let (true, PupilTreatment::Known(pupils)) = (move_them, &self.made.scene.pupils) {
            self.made.finder = PupilFinder::new(self.made.scene, pupils);
        }
        self
    }

    /// The same with the first lenses known.
    pub(super) fn with_known(mut self, known: &[KnownLens]) -> Self {
        let lens = |(number, own): (usize, &KnownLens)| RealLens {
            errors: self.made.errors(number),
            mean_square: own.mean_square,
            adjustments: own.adjustments.clone(),
            clipped: own.clipped,
        };
        self.lenses = known.iter().enumerate().map(lens).collect();
        self
    }

    /// The first `count` lenses, fewer of them once `stop` says so; all lenses so far are shown to
    /// `visit` after every part.
    ///
    /// # Errors
    /// An error of making that is not possible.
    pub(super) fn advance(
        self,
        (count, with_rims): (usize, usize),
        stop: StopTest<'_>,
        mut visit: impl FnMut(&[RealLens]),
    ) -> Result<Vec<RealLens>, ToleranceError> {
        let Self { made, mut lenses } = self;
        let lens = |i: usize| (!stop()).then(|| made.lens(i, i < with_rims));
        while lenses.len() < count && !stop() {
            let part = lenses.len()..count.min(lenses.len() + PART);
            let part: Vec<Option<_>> = part.into_par_iter().map(lens).collect();
            // Of a part that was broken off, the lenses in front of the first one that is missing.
            for traced in part.into_iter().map_while(|traced| traced) {
                lenses.push(traced?);
            }
            visit(&lenses);
        }
        lenses.truncate(count);
        Ok(lenses)
    }
}

/// The results of a lens with random errors, without the errors: these follow from its number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct KnownLens {
    /// The mean square spot radius in mm² at the image plane, and adjusted; `None` if a ray does not
    /// arrive.
    pub mean_square: Option<[f64; 2]>,
    /// The adjustments, focus first.
    pub adjustments: Vec<f64>,
    /// The mean squares with rims that clip, and the share of the light that they take.
    pub clipped: Option<([f64; 2], f64)>,
}

impl From<&RealLens> for KnownLens {
    fn from(lens: &RealLens) -> Self {
        let RealLens { mean_square, adjustments, clipped, .. } = lens.clone();
        Self { mean_square, adjustments, clipped }
    }
}

/// The number of lenses that are traced in parallel before they are collected.
const PART: usize = 128;

/// The lenses that are made.
struct RandomLenses<'a> {
    scene: &'a ToleranceScene,
    sheet: &'a ToleranceSheet,
    seed: u64,
    mixture: ErrorMixture,
    /// The compensators, focus first.
    adjustments: Vec<Compensator>,
    columns: BeamColumns,
    /// Finds the pupils of each lens; `None` if they are held.
    finder: Option<PupilFinder<'a>>,
}

impl RandomLenses<'_> {
    /// The errors of the lens with a number.
    fn errors(&self, number: usize) -> Vec<f64> {
        draw_errors((&self.sheet.errors, &self.mixture), self.seed, number as u64)
    }

    fn lens(&self, number: usize, with_rims: bool) -> Result<RealLens, ToleranceError> {
        let (tolerances, errors) = (&self.sheet.errors, self.errors(number));
        let set: Vec<(Perturbation, f64)> =
            tolerances.iter().zip(&errors).map(|(t, value)| (t.error, *value)).collect();
        let made = LensToAdjust {
            lens: &self.scene.lens,
            columns: &self.columns,
            errors: &set,
            adjustments: &self.adjustments,
        };
        let unadjusted = made.systems(&[])?;
        let mut lens =
            RealLens { errors, mean_square: None, adjustments: Vec::new(), clipped: None };
        if let Some(finder) = &self.finder
            && let Some((beam, lost)) = finder.beam(unadjusted.clone())
        {
            let columns = BeamColumns::new(&beam);
            let made = LensToAdjust { columns: &columns, ..made };
            if let Some(landed) = columns.landings(&unadjusted) {
                let adjusted = made.adjust(&landed)?;
                let squares = [mean_spot(&landed).a, adjusted.mean_square];
                lens.mean_square = Some(squares);
                lens.adjustments = adjusted.positions;
                lens.clipped = Some((squares, lost));
            }
            return Ok(lens);
        }
        if let Some(landed) = self.columns.landings(&unadjusted) {
            let adjusted = made.adjust(&landed)?;
            lens.mean_square = Some([mean_spot(&landed).a, adjusted.mean_square]);
            lens.adjustments = adjusted.positions;
        }
        if with_rims && self.finder.is_none() {
            lens.clipped = self.clipped(&made, unadjusted, &lens.adjustments)?;
        }
        Ok(lens)
    }

    /// The mean squares with rims that clip, at the image plane and with the adjustments of the lens
    /// without rims, of which those of the sensor are found again; and the share of the light that is
    /// lost. `None` if a field is dark.
    fn clipped(
        &self,
        made: &LensToAdjust<'_>,
        unadjusted: Vec<System<f64>>,
        positions: &[f64],
    ) -> Result<Option<([f64; 2], f64)>, ToleranceError> {
        let Some((fixed, lost)) = clipped_rays(self.scene, unadjusted) else { return Ok(None) };
        let of_sensor = |own: &&Compensator| own.part.in_lens().is_none();
        let sensor: Vec<Compensator> = made.adjustments.iter().filter(of_sensor).copied().collect();
        let mut adjusted = fixed.clone();
        if sensor.len() < made.adjustments.len() {
            match clipped_rays(self.scene, made.systems(positions)?) {
                Some((landed, _)) => adjusted = landed,
                None => return Ok(None),
            }
        }
        let made = LensToAdjust { adjustments: &sensor, ..*made };
        let found = made.adjust(&adjusted)?;
        Ok(Some(([mean_spot(&fixed).a, found.mean_square], lost)))
    }
}

/// The rays that the rims of a lens leave, and the share of the light that they take; `None` if a field
/// is dark.
fn clipped_rays(
    scene: &ToleranceScene,
    systems: Vec<System<f64>>,
) -> Option<(Vec<LandedField>, f64)> {
    let systems = with_rims(&scene.lens, systems);
    let tracers: Result<Vec<_>, _> = systems.iter().map(Tracer::new).collect();
    let (beam, lost) = transmitted(&scene.beam, &tracers.ok()?)?;
    Some((BeamColumns::new(&beam).landings(&systems)?, lost))
}

/// The rays of one field at the image plane.
#[derive(Debug, Clone)]
pub(super) struct LandedField {
    /// The weight of the field.
    pub(super) weight: f64,
    /// The rays with their weights, which add up to 1.
    pub(super) rays: Vec<(ImageRay<f64>, f64)>,
}

/// The rays of a beam, to be traced in blocks.
pub(super) struct BeamColumns {
    fields: Vec<FieldColumns>,
}

/// The rays of one field.
struct FieldColumns {
    weight: f64,
    /// For each colour the wavelength, the rays, and the weight of each ray.
    colours: Vec<(usize, Rays<f64>, Vec<f64>)>,
}

impl BeamColumns {
    pub(super) fn new(beam: &Beam) -> Self {
        let colour = |colour: &super::ColourRays| {
            (colour.wavelength, colour.rays.iter().copied().collect(), colour.weights.clone())
        };
        let field = |field: &super::FieldBeam| FieldColumns {
            weight: field.weight,
            colours: field.colours.iter().map(colour).collect(),
        };
        Self { fields: beam.fields.iter().map(field).collect() }
    }

    /// The rays of all fields at the image plane, without rims; `None` if one does not arrive, or if
    /// there is no best focus.
    pub(super) fn landings(&self, systems: &[System<f64>]) -> Option<Vec<LandedField>> {
        let tracers = open_tracers(systems).ok()?;
        let (mut landed, mut fields) = (Landings::default(), Vec::with_capacity(self.fields.len()));
        for FieldColumns { weight, colours } in &self.fields {
            let mut image_rays = Vec::new();
            for (wavelength, rays, weights) in colours {
                tracers[*wavelength].trace_batch(rays, &mut landed);
                if (0..weights.len()).any(|i| !landed.fate(i).is_imaged()) {
                    return None;
                }
                let weighted = weights.iter().enumerate();
                image_rays.extend(weighted.map(|(i, w)| (image_ray(&landed.ray(i)), *w)));
            }
            fields.push(LandedField { weight: *weight, rays: image_rays });
        }
        let mean = mean_spot(&fields);
        (mean.a.is_finite() && best_focus(&mean).is_finite()).then_some(fields)
    }
}

/// The rays of a beam that arrive, and the share of the light of those that do not; `None` if a field
/// is dark.
fn transmitted(beam: &Beam, tracers: &[Tracer<f64>]) -> Option<(Beam, f64)> {
    let (mut left, mut lost) = (beam.clone(), 0.0);
    for field in &mut left.fields {
        for colour in &mut field.colours {
            let tracer = &tracers[colour.wavelength];
            let mut arrived = super::ColourRays::new(colour.wavelength);
            let mut landed = ImagePoints::default();
            tracer.trace_batch(&colour.rays.iter().copied().collect(), &mut landed);
            for (i, ray) in colour.rays.iter().enumerate() {
                if landed.fate(i).is_imaged() {
                    arrived.push(*ray, colour.weights[i], colour.pupil[i], colour.paths[i]);
                }
            }
            *colour = arrived;
        }
        let total: f64 = field.colours.iter().flat_map(|colour| &colour.weights).sum();
        if !(total > 0.0) {
            return None;
        }
        lost += field.weight * (1.0 - total);
        let weights = field.colours.iter_mut().flat_map(|colour| &mut colour.weights);
        weights.for_each(|weight| *weight /= total);
    }
    Some((left, lost.max(0.0)))
}

/// The interval in which the share of good lenses lies with 95 % confidence, from `good` of `count`
/// lenses (Wilson, Journal of the American Statistical Association 22, 1927).
pub fn wilson_interval(good: usize, count: usize) -> [f64; 2] {
    const Z: f64 = 1.959_963_984_540_054;
    if count == 0 {
        return [0.0, 1.0];
    }
    let (k, n, z2) = (good as f64, count as f64, Z * Z);
    let center = (k + 0.5 * z2) / (n + z2);
    let half = Z * (k * (n - k) / n + 0.25 * z2).sqrt() / (n + z2);
    [(center - half).max(0.0), (center + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Shape, Surface};
    use crate::math::Vec3;
    use crate::tolerance::{ColourRays, FieldBeam};
    use crate::trace::Ray;

    /// A hole of radius 1 in front of the image plane, and a field with this weight whose rays are at
    /// these heights.
    fn clipped(weight: f64, heights: &[f64]) -> Option<(Beam, f64)> {
        let mut hole = Surface::plane(1.0, 1.0);
        hole.semi_diameter = 1.0;
        let image = Surface { shape: Shape::Plane, ..Surface::plane(0.0, 1.0) };
        let system = System { index_before: 1.0, surfaces: vec![hole, image], stop: None };
        let along =
            |y: f64| Ray { point: Vec3::new(0.0, y, 0.0), direction: Vec3::new(0.0, 0.0, 1.0) };
        let mut colour = ColourRays::new(0);
        for y in heights {
            colour.push(along(*y), 1.0 / heights.len() as f64, [0.0, *y], 0.0);
        }
        let field = FieldBeam { weight, colours: vec![colour], chief: (along(0.0), 0.0) };
        transmitted(&Beam { fields: vec![field] }, &[Tracer::new(&system).unwrap()])
    }

    #[test]
    fn clipped_rays_lose_their_light_and_the_others_share_the_weight() {
        let (beam, lost) = clipped(0.8, &[0.0, 0.5, -0.5, 2.0]).unwrap();
        let colour = &beam.fields[0].colours[0];
        assert_eq!(colour.rays.len(), 3);
        assert!(colour.weights.iter().all(|w| (w - 1.0 / 3.0).abs() < 1e-15));
        assert!((lost - 0.2).abs() < 1e-15, "{lost}");
        assert!(clipped(0.8, &[3.0, 2.0]).is_none());
    }

    #[test]
    fn an_interval_without_failures_does_not_reach_certainty() {
        let [low, high] = wilson_interval(100, 100);
        assert!(high > 1.0 - 1e-12 && (low - 0.963).abs() < 1e-3, "{low} {high}");
        let [low, high] = wilson_interval(450, 500);
        assert!((low - 0.8706).abs() < 1e-4 && (high - 0.9234).abs() < 1e-4, "{low} {high}");
        assert_eq!(wilson_interval(0, 0), [0.0, 1.0]);
    }
}
