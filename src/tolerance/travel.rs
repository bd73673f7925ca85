//! The travels of compensators, and the cost of those that end at their stops.

use super::analysis::{mean, mean_with_error};
use super::{QuadraticForm, RealLens};
use crate::lens::{AdjustedPart, Compensator};

/// The travel of a compensator in lenses that are made, in mm or radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdjustmentTravel {
    /// The part.
    pub part: AdjustedPart,
    /// The largest adjustment to either side; `None` for one without an end.
    pub travel: Option<f64>,
    /// The adjustment of the lens without errors, by the quadratic form.
    pub nominal: f64,
    /// In lenses by the quadratic form.
    pub form: TravelStatistics,
    /// In real lenses whose rays arrive; `None` without any.
    pub real: Option<TravelStatistics>,
}

/// The adjustments of a compensator in some lenses, in mm or radians.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct TravelStatistics {
    /// The mean.
    pub mean: f64,
    /// The standard deviation.
    pub deviation: f64,
    /// The largest to either side.
    pub largest: f64,
    /// The share of the lenses in which it ends at its stop.
    pub at_stop: f64,
}

/// Real lenses of which a compensator ends at its stop, where the quadratic form is none.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct StoppedLenses {
    /// Their share of the real lenses.
    pub share: f64,
    /// The mean of their rms minus that of the form on the same errors in mm, with its standard error.
    pub difference: [f64; 2],
}

/// An adjustment within this share of its travel is at its stop.
const AT_STOP: f64 = 1e-9;

fn is_stopped(position: f64, travel: f64) -> bool {
    position.abs() >= travel * (1.0 - AT_STOP)
}

impl TravelStatistics {
    /// `None` without positions.
    fn new(positions: &[f64], travel: f64) -> Option<Self> {
        let (count, middle) = (positions.len() as f64, mean(positions));
        let squares: f64 = positions.iter().map(|position| (position - middle).powi(2)).sum();
        let stopped = positions.iter().filter(|position| is_stopped(**position, travel)).count();
        (!positions.is_empty()).then(|| Self {
            mean: middle,
            deviation: (squares / count).sqrt(),
            largest: positions.iter().fold(0.0, |most: f64, position| most.max(position.abs())),
            at_stop: stopped as f64 / count,
        })
    }
}

/// The travels of compensators in lenses by a form, of which the adjustments are known, and in real ones.
pub(super) fn travels(
    adjustments: &[Compensator],
    form: &QuadraticForm,
    by_form: &[Vec<f64>],
    real: &[RealLens],
) -> Vec<AdjustmentTravel> {
    let Some(adjusted) = &form.adjusted else { return Vec::new() };
    let nominal = adjusted.as_designed();
    let travel = |(i, Compensator { part, travel }): (usize, &Compensator)| {
        let column = |lenses: &mut dyn Iterator<Item = &Vec<f64>>| -> Vec<f64> {
            lenses.filter_map(|positions| positions.get(i).copied()).collect()
        };
        let form = column(&mut by_form.iter());
        let real = column(&mut real.iter().map(|lens| &lens.adjustments));
        Some(AdjustmentTravel {
            part: *part,
            travel: travel.is_finite().then_some(*travel),
            nominal: nominal[i],
            form: TravelStatistics::new(&form, *travel)?,
            real: TravelStatistics::new(&real, *travel),
        })
    };
    adjustments.iter().enumerate().filter_map(travel).collect()
}

/// The real lenses of which a compensator ends at its stop.
pub(super) fn stopped_lenses(
    adjustments: &[Compensator],
    form: &QuadraticForm,
    real: &[RealLens],
) -> Option<StoppedLenses> {
    let stops = |lens: &&RealLens| {
        let mut pairs = adjustments.iter().zip(&lens.adjustments);
        pairs.any(|(own, position)| own.travel > 0.0 && is_stopped(*position, own.travel))
    };
    let difference =
        |lens: &RealLens| Some(lens.mean_square?[1].sqrt() - form.at(&lens.errors).sqrt());
    let differences: Vec<f64> = real.iter().filter(stops).filter_map(difference).collect();
    let share = differences.len() as f64 / real.len().max(1) as f64;
    let difference = mean_with_error(&differences);
    (!differences.is_empty()).then_some(StoppedLenses { share, difference })
}
