//! The clock of the benchmarks, and the timing of several methods in turn.

use serde::Serialize;
use std::hint::black_box;
use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

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

/// Times all cases in turn, up to `turns` times each for at least `seconds`, and at least once;
/// returns their rates in units of work per second, and the number of turns. Once `stop` is true,
/// no further turn begins.
pub(super) fn time_interleaved(
    cases: &mut [TimedCase<'_>],
    turns: usize,
    seconds: f64,
    stop: &AtomicBool,
) -> (Vec<RateStatistics>, usize) {
    let repeats: Vec<u32> =
        cases.iter_mut().map(|c| repetition_count(&mut c.repetition, seconds)).collect();
    let mut rates = vec![Vec::with_capacity(turns); cases.len()];
    let mut done = 0;
    while done == 0 || (done < turns && !stop.load(Ordering::Relaxed)) {
        done += 1;
        for ((case, repeats), rates) in cases.iter_mut().zip(&repeats).zip(&mut rates) {
            let watch = Stopwatch::start();
            (0..*repeats).for_each(|_| (case.repetition)());
            rates.push(f64::from(*repeats) * case.work / watch.seconds());
        }
    }
    (rates.into_iter().map(RateStatistics::of).collect(), done)
}

/// The number of repetitions that take `seconds`; the first one warms up.
fn repetition_count(turn: &mut dyn FnMut(), seconds: f64) -> u32 {
    turn();
    let watch = Stopwatch::start();
    turn();
    (seconds / watch.seconds().max(1e-9)).ceil().clamp(1.0, 1e9) as u32
}

/// A stopwatch that has been started.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch(Instant);

impl Stopwatch {
    /// Starts a stopwatch.
    #[expect(clippy::disallowed_methods, reason = "measuring is what this module is for")]
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// The seconds since the start.
    pub fn seconds(self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

/// Runs `work`; returns its result and the milliseconds that it took.
pub fn time_ms<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let watch = Stopwatch::start();
    let result = work();
    (result, 1e3 * watch.seconds())
}

/// A result is timed repeatedly up to this total time, in milliseconds.
const LONG_ENOUGH: f64 = 5.0;

/// Runs `work` repeatedly for a few milliseconds, but not less and not more often than `counts`
/// says; returns its last result and the median of its times, in milliseconds.
pub(super) fn time_median<T>(
    counts: RangeInclusive<usize>,
    mut work: impl FnMut() -> T,
) -> (T, f64) {
    let (mut result, first) = time_ms(&mut work);
    let mut times = vec![first];
    let is_short = |times: &[f64]| times.iter().sum::<f64>() < LONG_ENOUGH;
    while times.len() < *counts.start() || (times.len() < *counts.end() && is_short(&times)) {
        let (again, ms) = time_ms(|| black_box(work()));
        result = again;
        times.push(ms);
    }
    times.sort_by(f64::total_cmp);
    (result, times[times.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_repeated_as_often_as_counts_say() {
        let repetitions = |counts, ms| {
            let mut count = 0;
            time_median(counts, || {
                count += 1;
                std::thread::sleep(std::time::Duration::from_millis(ms));
            });
            count
        };
        // Long work as seldom as allowed, short work as often.
        assert_eq!(repetitions(1..=9, 6), 1);
        assert_eq!(repetitions(3..=9, 6), 3);
        assert!((2..=3).contains(&repetitions(2..=3, 0)));
    }
}
