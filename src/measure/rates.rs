//! Timing of several methods in turn.

use super::clock::Stopwatch;
use serde::Serialize;

/// The rate of a piece of work over many repetitions: the median, the slowest and the fastest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RateStatistics {
    /// The median rate.
    pub median: f64,
    /// The rate of the slowest repetition.
    pub min: f64,
    /// The rate of the fastest repetition.
    pub max: f64,
}

impl RateStatistics {
    pub(super) fn of(mut turns: Vec<f64>) -> Self {
        turns.sort_by(f64::total_cmp);
        let at = |i: usize| turns.get(i).copied().unwrap_or(f64::NAN);
        Self { median: at(turns.len() / 2), min: at(0), max: at(turns.len().saturating_sub(1)) }
    }

    /// The rates times a factor, in another unit.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self { median: self.median * factor, min: self.min * factor, max: self.max * factor }
    }
}

/// A piece of work to be timed, with the number of its units.
pub(super) struct TimedCase<'a> {
    pub(super) work: f64,
    pub(super) repetition: Box<dyn FnMut() + 'a>,
}

/// Times all cases in turn, `turns` times each for at least `seconds`; returns their rates in units
/// of work per second.
pub(super) fn time_interleaved(
    contestants: &mut [TimedCase<'_>],
    turns: usize,
    seconds: f64,
) -> Vec<RateStatistics> {
    let repeats: Vec<u32> =
        contestants.iter_mut().map(|c| repetition_count(&mut c.repetition, seconds)).collect();
    let mut rates = vec![Vec::with_capacity(turns); contestants.len()];
    for _ in 0..turns {
        for ((contestant, repeats), rates) in contestants.iter_mut().zip(&repeats).zip(&mut rates) {
            let watch = Stopwatch::start();
            (0..*repeats).for_each(|_| (contestant.repetition)());
            rates.push(f64::from(*repeats) * contestant.work / watch.seconds());
        }
    }
    rates.into_iter().map(RateStatistics::of).collect()
}

/// The number of repetitions that take `seconds`; the first one warms up.
fn repetition_count(turn: &mut dyn FnMut(), seconds: f64) -> u32 {
    turn();
    let watch = Stopwatch::start();
    turn();
    (seconds / watch.seconds().max(1e-9)).ceil().clamp(1.0, 1e9) as u32
}
