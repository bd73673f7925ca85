//! The adjustment of a real lens: the compensators within their travel at which the rays of all fields
//! make the least mean square spot.
//!
//! The mean square is that of distances in the plane of the sensor. Rays behind the lens are straight, so
//! that focus and tilts of the sensor move their ends along them; what is adjusted in the lens is
//! traced. Steps are those of Gauss and Newton, with the derivatives of each lens itself.

use super::monte_carlo::{BeamColumns, LandedField};
use super::spot::ImageRay;
use super::{NominalLens, SpotMoments, ToleranceError, best_focus, perturb};
use crate::lens::{AdjustedPart, Compensator, Perturbation, System};
use crate::solve::{BoxedQuadratic, scaled_pseudoinverse};
use nalgebra::{DMatrix, DVector};

/// The most steps of an adjustment.
const STEPS: usize = 12;
/// A step that promises less than this share of the mean square ends the adjustment.
const ENOUGH: f64 = 1e-10;
/// The number of times that a step which does not lower the mean square is halved.
const HALVINGS: usize = 6;
/// The step of derivatives, as a share of the travel.
const DIFFERENCE: f64 = 1e-4;

/// A lens with errors of making whose compensators are adjusted.
pub(super) struct LensToAdjust<'a> {
    pub(super) lens: &'a NominalLens,
    pub(super) columns: &'a BeamColumns,
    /// The errors of making.
    pub(super) errors: &'a [(Perturbation, f64)],
    /// The compensators, focus first.
    pub(super) adjustments: &'a [Compensator],
}

/// A lens that is adjusted.
#[derive(Debug, Clone)]
pub(super) struct AdjustedLens {
    /// The adjustments in their order, in mm and radians.
    pub(super) positions: Vec<f64>,
    /// The mean square spot radius in mm².
    pub(super) mean_square: f64,
}

/// Distances from centroids in mm: x, y and z of each ray, one after the other, times the root of its
/// weight.
type Distances = DVector<f64>;

impl LensToAdjust<'_> {
    /// The systems with some adjustments.
    pub(super) fn systems(&self, positions: &[f64]) -> Result<Vec<System<f64>>, ToleranceError> {
        let moved = self.adjustments.iter().zip(positions);
        let moved = moved.filter_map(|(own, position)| Some((own.part.in_lens()?, *position)));
        let all: Vec<_> = self.errors.iter().copied().chain(moved).collect();
        perturb(self.lens, &all)
    }

    /// Adjusts the lens, whose rays arrive so before.
    ///
    /// # Errors
    /// A compensator that is not possible.
    pub(super) fn adjust(&self, landed: &[LandedField]) -> Result<AdjustedLens, ToleranceError> {
        if self.adjustments.len() == 1 {
            return Ok(refocused(landed, self.adjustments[0].travel));
        }
        let mut positions = vec![0.0; self.adjustments.len()];
        let mut fields = landed.to_vec();
        let mut distances = self.distances(&fields, &positions);
        for _ in 0..STEPS {
            let slopes = self.slopes(&fields, &positions, &distances)?;
            let Some(target) = self.target(&slopes, &distances, &positions) else { break };
            let Some(better) = self.step(landed, (&positions, &target), &distances)? else { break };
            (positions, fields, distances) = better;
        }
        Ok(AdjustedLens { positions, mean_square: distances.norm_squared() })
    }

    /// The rays in front of the sensor with some adjustments, from those without; `None` if one does not
    /// arrive.
    fn landings(
        &self,
        landed: &[LandedField],
        positions: &[f64],
    ) -> Result<Option<Vec<LandedField>>, ToleranceError> {
        if self.adjustments.iter().all(|own| own.part.in_lens().is_none()) {
            return Ok(Some(landed.to_vec()));
        }
        Ok(self.columns.landings(&self.systems(positions)?))
    }

    /// The rays where they meet the sensor with some adjustments, from those without; `None` if one does
    /// not arrive.
    pub(super) fn on_sensor(
        &self,
        landed: &[LandedField],
        positions: &[f64],
    ) -> Result<Option<Vec<LandedField>>, ToleranceError> {
        let sensor = Sensor::new(self.adjustments, positions);
        let ray = |(ray, weight): &(ImageRay<f64>, f64)| {
            let ([x, y, _], _) = sensor.meet(ray);
            ([x, y, ray[2], ray[3]], *weight)
        };
        let field = |field: LandedField| LandedField {
            rays: field.rays.iter().map(ray).collect(),
            ..field
        };
        let fields = self.landings(landed, positions)?;
        Ok(fields.map(|fields| fields.into_iter().map(field).collect()))
    }

    fn distances(&self, fields: &[LandedField], positions: &[f64]) -> Distances {
        let sensor = Sensor::new(self.adjustments, positions);
        centred(fields, |ray| sensor.meet(ray).0)
    }

    /// The derivatives of the distances by all adjustments.
    fn slopes(
        &self,
        fields: &[LandedField],
        positions: &[f64],
        distances: &Distances,
    ) -> Result<DMatrix<f64>, ToleranceError> {
        let mut columns = Vec::with_capacity(positions.len());
        let sensor = Sensor::new(self.adjustments, positions);
        for (i, Compensator { part, travel }) in self.adjustments.iter().enumerate() {
            columns.push(match part {
                AdjustedPart::Lens(_) if *travel > 0.0 => {
                    self.difference(positions, distances, i)?
                }
                AdjustedPart::Lens(_) => Distances::zeros(distances.len()),
                _ => centred(fields, |ray| sensor.motion(*part, ray)),
            });
        }
        Ok(DMatrix::from_columns(&columns))
    }

    /// The derivative by an adjustment in the lens: zero where rays are lost on both sides.
    fn difference(
        &self,
        positions: &[f64],
        distances: &Distances,
        number: usize,
    ) -> Result<Distances, ToleranceError> {
        let step = DIFFERENCE * self.adjustments[number].travel;
        for step in [step, -step] {
            let mut moved = positions.to_vec();
            moved[number] += step;
            if let Some(fields) = self.columns.landings(&self.systems(&moved)?) {
                return Ok((self.distances(&fields, &moved) - distances) / step);
            }
        }
        Ok(Distances::zeros(distances.len()))
    }

    /// The adjustments that are least by these derivatives; `None` if they promise nothing.
    fn target(
        &self,
        slopes: &DMatrix<f64>,
        distances: &Distances,
        positions: &[f64],
    ) -> Option<Vec<f64>> {
        let matrix = slopes.tr_mul(slopes);
        let step = -scaled_pseudoinverse(&matrix) * slopes.tr_mul(distances);
        let center: Vec<f64> = positions.iter().zip(step.iter()).map(|(y, s)| y + s).collect();
        let ranges = self.adjustments.iter().map(|own| [-own.travel, own.travel]).collect();
        let quadratic = BoxedQuadratic::new(matrix, ranges);
        let target = quadratic.minimum(&center);
        let gain = quadratic.value(positions, &center) - quadratic.value(&target, &center);
        (2.0 * gain > ENOUGH * distances.norm_squared()).then_some(target)
    }

    /// The first point on the way between two with a lesser mean square, its rays and distances.
    fn step(
        &self,
        landed: &[LandedField],
        (from, to): (&[f64], &[f64]),
        distances: &Distances,
    ) -> Result<Option<AdjustedRays>, ToleranceError> {
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            let next: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + share * (b - a)).collect();
            if let Some(fields) = self.landings(landed, &next)? {
                let found = self.distances(&fields, &next);
                if found.norm_squared() < distances.norm_squared() {
                    return Ok(Some((next, fields, found)));
                }
            }
            share *= 0.5;
        }
        Ok(None)
    }
}

/// Adjustments, the rays in front of the sensor, and their distances on it.
type AdjustedRays = (Vec<f64>, Vec<LandedField>, Distances);

/// The lens at its best focus within a travel: exact, as rays are straight.
fn refocused(landed: &[LandedField], travel: f64) -> AdjustedLens {
    let mean = mean_spot(landed);
    let focus = best_focus(&mean).clamp(-travel, travel);
    AdjustedLens { positions: vec![focus], mean_square: mean.at(focus) }
}

/// The mean spot of all fields.
pub(super) fn mean_spot(landed: &[LandedField]) -> SpotMoments<f64> {
    SpotMoments::sum(landed.iter().map(|f| SpotMoments::new(&f.rays).weighted(f.weight)))
}

/// The plane of a sensor: `z = shift + by_x x + by_y y`.
pub(super) struct Sensor {
    shift: f64,
    by_x: f64,
    by_y: f64,
    /// The derivatives of `by_x` and `by_y` by the tilts about x and about y.
    by_tilts: [[f64; 2]; 2],
}

impl Sensor {
    /// The sensor with its adjustments: tilted about x first, then about the y axis that this has turned.
    pub(super) fn new(adjustments: &[Compensator], positions: &[f64]) -> Self {
        let of = |part: AdjustedPart| {
            let mut own = adjustments.iter().zip(positions);
            own.find(|(own, _)| own.part == part).map_or(0.0, |(_, position)| *position)
        };
        let (a, b) = (of(AdjustedPart::SensorTiltX), of(AdjustedPart::SensorTiltY));
        let (cos_a, cos_b) = (a.cos(), b.cos());
        let by_x = -b.tan() / cos_a;
        Self {
            shift: of(AdjustedPart::Focus),
            by_x,
            by_y: a.tan(),
            by_tilts: [
                [by_x * a.tan(), -1.0 / (cos_a * cos_b * cos_b)],
                [1.0 / (cos_a * cos_a), 0.0],
            ],
        }
    }

    /// The point where a ray meets the sensor, and the displacement of that along the axis by a
    /// displacement of the plane.
    pub(super) fn meet(&self, [x, y, u, v]: &ImageRay<f64>) -> ([f64; 3], f64) {
        let advance = 1.0 / (1.0 - self.by_x * u - self.by_y * v);
        let z = (self.shift + self.by_x * x + self.by_y * y) * advance;
        ([x + z * u, y + z * v, z], advance)
    }

    /// The derivative of that point by an adjustment of the sensor.
    fn motion(&self, part: AdjustedPart, ray: &ImageRay<f64>) -> [f64; 3] {
        let ([x, y, _], advance) = self.meet(ray);
        let lever = |[by_x, by_y]: [f64; 2]| by_x * x + by_y * y;
        let tilts = &self.by_tilts;
        let displacement = match part {
            AdjustedPart::SensorTiltX => lever([tilts[0][0], tilts[1][0]]),
            AdjustedPart::SensorTiltY => lever([tilts[0][1], tilts[1][1]]),
            _ => 1.0,
        };
        let z = displacement * advance;
        [z * ray[2], z * ray[3], z]
    }
}

/// Vectors of each ray relative to their mean over the field.
fn centred(fields: &[LandedField], of: impl Fn(&ImageRay<f64>) -> [f64; 3]) -> Distances {
    let mut all = Vec::new();
    for LandedField { weight, rays } in fields {
        let mut mean = [0.0; 3];
        for (ray, share) in rays {
            mean.iter_mut().zip(of(ray)).for_each(|(sum, value)| *sum += share * value);
        }
        for (ray, share) in rays {
            let root = (weight * share).sqrt();
            all.extend(of(ray).iter().zip(mean).map(|(value, mean)| root * (value - mean)));
        }
    }
    DVector::from_vec(all)
}
