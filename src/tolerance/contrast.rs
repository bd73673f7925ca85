//! The contrast at a frequency of lenses with errors of making.
//!
//! The geometric contrast of the held rays, `|Σ w exp(2πi ν s)|` with `s` the place of a ray along the
//! image of a field, tangential and sagittal, is computed for the lens with each error at both ends of
//! its range, at the fixed image plane and with all compensators adjusted for the least spot. The rays move
//! there by their derivatives, from one sweep back ([`super::linear_contrast`]); a lens without such a sweep
//! is traced. Diffraction lowers the contrast before and after.

use super::adjusted::LensToAdjust;
use super::compensation::adjustments;
use super::linear_contrast::linear_changes;
use super::monte_carlo::{BeamColumns, LandedField};
use super::spot::ImageRay;
use super::{
    RealMerit, RealMeritRequest, StopTest, ToleranceError, ToleranceScene, refuse_if_stopped,
};
use crate::lens::{Compensator, Lens, Perturbation, Tolerance, ToleranceSheet};
use crate::math::{SimdWidth, run_vectorized, sin_cos_turns};
use rayon::prelude::*;
use serde::Serialize;

/// The contrast of a lens at a frequency and its changes by errors of making.
#[derive(Debug, Clone, PartialEq)]
pub struct ContrastChanges {
    /// The frequency in cycles/mm.
    pub frequency: f64,
    /// The contrast of the lens as designed at the fixed image plane and adjusted, the mean over fields
    /// and over the tangential and the sagittal direction.
    pub nominal: [f64; 2],
    /// The error of the contrast by the sampling of the pupils: its change with more rays.
    pub sampling_error: f64,
    /// For each error the changes of the contrast; `None` if a ray does not arrive there.
    pub changes: Vec<Option<ContrastChange>>,
}

/// The changes of a contrast by an error, at the fixed image plane and adjusted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContrastChange {
    /// At the lower and at the upper end of its range.
    pub ends: [[f64; 2]; 2],
    /// The derivative, per unit of the error.
    pub first: [f64; 2],
}

/// The error at which derivatives are taken, as a share of the range: the contrast is a smooth function of it, so
/// that the part of the third order is some 1e-6 of the derivative.
const SHARE: f64 = 1e-3;

impl ContrastChange {
    /// The sum of both.
    pub(super) fn plus(self, other: Self) -> Self {
        let sum = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1] + b[1]];
        Self {
            ends: [0, 1].map(|i| sum(self.ends[i], other.ends[i])),
            first: sum(self.first, other.first),
        }
    }

    /// The changes by an error of a half range from the contrasts at shares of it; `None` if one is missing.
    ///
    /// # Errors
    /// As those of `contrast`.
    pub(super) fn of_range(
        half_range: f64,
        nominal: [f64; 2],
        contrast: impl Fn(f64) -> Result<Option<[f64; 2]>, ToleranceError>,
    ) -> Result<Option<Self>, ToleranceError> {
        let shares = [-1.0, -SHARE, SHARE, 1.0].map(|share| contrast(share * half_range));
        let [low, before, behind, high] = shares;
        let all = (low?, before?, behind?, high?);
        let (Some(low), Some(before), Some(behind), Some(high)) = all else { return Ok(None) };
        let step = 2.0 * SHARE * half_range;
        let first = |i: usize| if step > 0.0 { (behind[i] - before[i]) / step } else { 0.0 };
        Ok(Some(Self {
            ends: [0, 1].map(|i| [low[i] - nominal[i], high[i] - nominal[i]]),
            first: [0, 1].map(first),
        }))
    }
}

/// The contrast at a frequency of lenses that are made, the mean over fields and over the tangential and the
/// sagittal direction; each at the fixed image plane and refocused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ContrastSummary {
    /// The frequency in cycles/mm.
    pub frequency: f64,
    /// The contrast of the lens as designed.
    pub nominal: [f64; 2],
    /// The contrast that is expected by the changes at both ends of the range of each error; `None` if a ray
    /// does not arrive at an end.
    pub expected: Option<[f64; 2]>,
    /// The error by the sampling of the pupils.
    pub sampling_error: f64,
    /// The mean over lenses with random errors by their rays.
    pub real: RealMerit,
}

/// More rays than those of the spots are taken until they change the contrast by less than this.
const ENOUGH: f64 = 1e-3;
/// The factor by which the tolerance of the spots falls for that, the changes of the rays that are compared, and the
/// tolerance below which rays do not change any more.
const FINER: f64 = 0.1;
const ROUNDS: usize = 3;
const FINEST: f64 = 1e-12;

impl ContrastChanges {
    /// The contrast of a lens at a zoom position at a frequency in cycles/mm, with its tolerances and
    /// compensators; `tolerance` is that of the spots of `scene`.
    ///
    /// # Errors
    /// A lens as designed of which a ray does not arrive, an error or a compensator that is not possible,
    /// and [`ToleranceError::Stopped`] once `stop` says so.
    pub fn new(
        (lens, zoom, tolerance): (&Lens, usize, f64),
        scene: &ToleranceScene,
        (sheet, frequency): (&ToleranceSheet, f64),
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        Ok(Self::with_judge((lens, zoom, tolerance), scene, (sheet, frequency), stop)?.0)
    }

    /// The same with the contrast of lenses with random errors by their rays.
    ///
    /// # Errors
    /// As those of [`ContrastChanges::new`]; once `stop` says so there are fewer lenses.
    pub fn with_real_lenses(
        place: (&Lens, usize, f64),
        scene: &ToleranceScene,
        (sheet, frequency): (&ToleranceSheet, f64),
        request: RealMeritRequest,
        stop: StopTest<'_>,
    ) -> Result<(Self, RealMerit), ToleranceError> {
        let (found, judge) = Self::with_judge(place, scene, (sheet, frequency), stop)?;
        let real = RealMerit::new(sheet, request, stop, |errors| judge.contrast(errors))?;
        Ok((found, real))
    }

    fn with_judge(
        (lens, zoom, tolerance): (&Lens, usize, f64),
        scene: &ToleranceScene,
        (sheet, frequency): (&ToleranceSheet, f64),
        stop: StopTest<'_>,
    ) -> Result<(Self, ContrastJudge), ToleranceError> {
        let mut judge = ContrastJudge::new(scene.clone(), sheet, frequency)?;
        let mut nominal = judge.as_designed()?;
        let (mut tolerance, mut sampling_error) = (tolerance, f64::INFINITY);
        let mut compared = 0;
        while compared < ROUNDS && tolerance > FINEST {
            tolerance *= FINER;
            let finer = ToleranceScene::new_until(lens, zoom, tolerance, stop)?;
            // The same rays tell nothing.
            if finer.beam.rays() == judge.scene.beam.rays() {
                continue;
            }
            compared += 1;
            judge = ContrastJudge::new(finer, sheet, frequency)?;
            let found = judge.as_designed()?;
            let apart = [0, 1].map(|i| (found[i] - nominal[i]).abs());
            (nominal, sampling_error) = (found, apart[0].max(apart[1]));
            if sampling_error < ENOUGH {
                break;
            }
        }
        let changes = match linear_changes((scene, &judge.scene), (sheet, frequency), stop)? {
            Some(changes) => changes.into_iter().map(Some).collect(),
            None => judge.changes(sheet, nominal, stop)?,
        };
        Ok((Self { frequency, nominal, sampling_error, changes }, judge))
    }

    /// These changes with the contrast of lenses with random errors.
    pub fn summary(&self, sheet: &ToleranceSheet, real: RealMerit) -> ContrastSummary {
        ContrastSummary {
            frequency: self.frequency,
            nominal: self.nominal,
            expected: self.expected(sheet),
            sampling_error: self.sampling_error,
            real,
        }
    }

    /// The expected contrast of lenses that are made, at the fixed image plane and adjusted: each error
    /// adds the curvature of its changes at the ends. `None` if a ray does not arrive at an end.
    pub fn expected(&self, sheet: &ToleranceSheet) -> Option<[f64; 2]> {
        let mut sum = self.nominal;
        for (tolerance, changes) in sheet.errors.iter().zip(&self.changes) {
            let share = tolerance.distribution.deviation().powi(2);
            let changes = (*changes)?;
            for (sum, [low, high]) in sum.iter_mut().zip(changes.ends) {
                *sum += 0.5 * share * (low + high);
            }
        }
        Some(sum)
    }
}

/// The rays by which contrasts are judged.
struct ContrastJudge {
    scene: ToleranceScene,
    columns: BeamColumns,
    adjustments: Vec<Compensator>,
    frequency: f64,
    /// The tangential direction of each field.
    directions: Vec<[f64; 2]>,
}

impl ContrastJudge {
    fn new(
        scene: ToleranceScene,
        sheet: &ToleranceSheet,
        frequency: f64,
    ) -> Result<Self, ToleranceError> {
        let columns = BeamColumns::new(&scene.beam);
        let designed = columns.landings(&scene.lens.systems).ok_or_else(lost_as_designed)?;
        let directions = designed.iter().map(tangential).collect();
        Ok(Self { scene, columns, adjustments: adjustments(sheet), frequency, directions })
    }

    /// The changes by errors whose rays are traced.
    fn changes(
        &self,
        sheet: &ToleranceSheet,
        nominal: [f64; 2],
        stop: StopTest<'_>,
    ) -> Result<Vec<Option<ContrastChange>>, ToleranceError> {
        let change = |own: &Tolerance| {
            refuse_if_stopped(stop)?;
            let contrast = |value: f64| self.contrast(&[(own.error, value)]);
            ContrastChange::of_range(own.half_range, nominal, contrast)
        };
        sheet.errors.par_iter().map(change).collect()
    }

    fn as_designed(&self) -> Result<[f64; 2], ToleranceError> {
        self.contrast(&[])?.ok_or_else(lost_as_designed)
    }

    /// The contrast with some errors at the fixed image plane and adjusted; `None` if a ray does not
    /// arrive.
    fn contrast(&self, errors: &[(Perturbation, f64)]) -> Result<Option<[f64; 2]>, ToleranceError> {
        let made = LensToAdjust {
            lens: &self.scene.lens,
            columns: &self.columns,
            errors,
            adjustments: &self.adjustments,
        };
        let Some(landed) = self.columns.landings(&made.systems(&[])?) else { return Ok(None) };
        let positions = made.adjust(&landed)?.positions;
        let adjusted = made.on_sensor(&landed, &positions)?;
        let contrast = |fields: &[LandedField]| -> f64 {
            let pairs = fields.iter().zip(&self.directions);
            pairs.map(|(field, along)| field_contrast(field, *along, self.frequency)).sum()
        };
        Ok(adjusted.map(|adjusted| [contrast(&landed), contrast(&adjusted)]))
    }
}

fn lost_as_designed() -> ToleranceError {
    ToleranceError::Other("a ray of the lens as designed is lost".to_owned())
}

/// The distance of a point from the axis in mm below which it has no direction of its own.
const ON_AXIS: f64 = 1e-9;

/// The tangential direction of the field of some rays, along y for one on the axis.
pub(super) fn tangential(field: &LandedField) -> [f64; 2] {
    let mean = |i: usize| field.rays.iter().map(|(ray, w)| w * ray[i]).sum::<f64>();
    let [x, y] = [mean(0), mean(1)];
    let far = x.hypot(y);
    if far > ON_AXIS { [x / far, y / far] } else { [0.0, 1.0] }
}

/// The number of rays whose phases are turned into sines at once.
const LANES: usize = 8;

/// The mean contrast along a direction and across it, times the weight of the field.
pub(super) fn field_contrast(field: &LandedField, along: [f64; 2], frequency: f64) -> f64 {
    let across = [along[1], -along[0]];
    let sums = [along, across].map(|direction| {
        run_vectorized(
            SimdWidth::detect(),
            #[inline(always)]
            || phase_sum(&field.rays, direction.map(|part| frequency * part)),
        )
    });
    field.weight * 0.5 * sums.iter().map(|[re, im]| re.hypot(*im)).sum::<f64>()
}

/// The sum of `w exp(2πi u·x)` over rays in points `x` with weights `w`, `u` in cycles/mm.
#[inline(always)]
fn phase_sum(rays: &[(ImageRay<f64>, f64)], [ux, uy]: [f64; 2]) -> [f64; 2] {
    let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
    let mut add = |j: usize, (ray, weight): &(ImageRay<f64>, f64)| {
        let (sin, cos) = sin_cos_turns(ray[0] * ux + ray[1] * uy);
        re[j] += weight * cos;
        im[j] += weight * sin;
    };
    let (blocks, rest) = rays.as_chunks::<LANES>();
    blocks.iter().for_each(|block| (0..LANES).for_each(|j| add(j, &block[j])));
    rest.iter().enumerate().for_each(|(j, ray)| add(j, ray));
    [re, im].map(|lanes| lanes.iter().sum())
}
