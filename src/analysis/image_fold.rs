//! Fields that share their image points: where the image height falls again within the field.
//!
//! Beyond the turn light of a second field arrives at the same points from other directions. These are no part of
//! the set of directions about the first field's chief ray, which is followed from the image, so that a number that
//! rests on that set alone would miss the half of the light without a sign of it.

use super::{AnalysisError, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::RayModel;

/// The fields from the axis to the farthest one that are compared, and one just before the last.
const STEPS: usize = 24;
const LAST: f64 = 0.999;
/// The fall of a height, as a share of the largest, that is no rounding.
const FALL: f64 = 1e-9;
/// The steps by which the largest height is approached; each leaves 0.62 of the interval.
const NARROWINGS: usize = 40;

/// The distances from the axis in mm between which light of two fields arrives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageFold {
    /// The least and the largest of them.
    pub radii: [f64; 2],
}

/// The chief rays of a lens over its field, at a wavelength.
struct FieldHeights<'a> {
    model: &'a RayModel,
    wavelength: usize,
    /// The farthest field, in the unit of the lens.
    reach: f64,
}

impl ImageFold {
    /// The fold of a lens at a wavelength within the fields of its beam; `None` without one, and for a lens that is
    /// not symmetric about its axis.
    pub fn find(model: &RayModel, wavelength: usize) -> Option<Self> {
        if !model.channels[wavelength].system.has_rotational_symmetry() {
            return None;
        }
        let sizes = model.fields.iter().map(|field| field.x.hypot(field.y));
        let reach = sizes.fold(model.beam.edge.abs(), f64::max);
        let fields = FieldHeights { model, wavelength, reach };
        let mut parts: Vec<f64> = (0..=STEPS).map(|i| i as f64 / STEPS as f64).collect();
        parts.insert(STEPS, LAST);
        let heights: Vec<f64> = parts.iter().map_while(|part| fields.chief(*part)).collect();
        let largest = heights.iter().fold(0.0, |most: f64, height| most.max(height.abs()));
        let rounding = FALL * largest;
        let facing = heights.iter().find(|height| height.abs() > rounding)?.signum();
        let known: Vec<f64> = heights.iter().map(|height| facing * height).collect();
        let turn = known.windows(2).position(|pair| pair[1] < pair[0] - rounding)?;
        let is_lit = |part: &&f64| lit_region(model, fields.field(**part), wavelength).is_ok();
        let lit = parts[turn + 1..known.len()].iter().take_while(is_lit).count();
        if lit == 0 {
            return None;
        }
        // The light ends between two fields: the fold reaches to the second of them, with its blur, or anywhere if
        // where that one lands is not known.
        let next = (turn + lit + 1).min(parts.len() - 1);
        let least = known.get(turn + 1..=next).and_then(|heights| {
            let edge = |p| fields.landing(parts[next], [0.0, p]).map(|height| facing * height);
            let [low, high] = [edge(-1.0)?, edge(1.0)?];
            Some(heights.iter().copied().fold(low.min(high), f64::min))
        });
        let around = [parts[turn.saturating_sub(1)], parts[turn + 1]];
        let most = known[turn].max(fields.highest(around, facing));
        Some(Self { radii: [least.unwrap_or(0.0).max(0.0), most] })
    }

    /// Refuses a point of the image at which light of two fields arrives.
    ///
    /// # Errors
    /// [`AnalysisError::FoldedImage`].
    pub fn refuse(fold: Option<Self>, [x, y]: [f64; 2]) -> Result<(), AnalysisError> {
        match fold {
            Some(Self { radii: [least, most] }) if (least..=most).contains(&x.hypot(y)) => {
                Err(AnalysisError::FoldedImage)
            }
            _ => Ok(()),
        }
    }
}

impl FieldHeights<'_> {
    /// The field at a part of the farthest one.
    fn field(&self, part: f64) -> FieldPoint {
        FieldPoint { x: 0.0, y: part * self.reach, weight: 1.0 }
    }

    /// The height in mm at which the ray through a point of the pupil lands; `None` for a lost one.
    fn landing(&self, part: f64, pupil: [f64; 2]) -> Option<f64> {
        let launch = self.model.launch(self.field(part), self.wavelength).ok()?;
        Some(launch.unclipped_landing(pupil)?.ray.point.value().y)
    }

    fn chief(&self, part: f64) -> Option<f64> {
        self.landing(part, [0.0; 2])
    }

    /// The largest height of a chief ray, counted to one side, between two parts of the field around it (golden
    /// section).
    fn highest(&self, [mut low, mut high]: [f64; 2], facing: f64) -> f64 {
        let golden = 0.5 * (5_f64.sqrt() - 1.0);
        let height = |part: f64| self.chief(part).map_or(f64::NEG_INFINITY, |h| facing * h);
        let mut most = f64::NEG_INFINITY;
        for _ in 0..NARROWINGS {
            let [a, b] = [high - golden * (high - low), low + golden * (high - low)];
            let (at_a, at_b) = (height(a), height(b));
            most = most.max(at_a).max(at_b);
            if at_a < at_b { low = a } else { high = b }
        }
        most
    }
}
