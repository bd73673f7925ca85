//! The machine of a measurement, and the age, the processor time and the memory of this process.
//!
//! Linux reports those of the process, all threads together, in `/proc`; elsewhere they are unknown.

use crate::trace::SimdWidth;
use serde::Serialize;
use std::fmt;
use std::fs;

/// The properties of a machine that measurements depend on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// The name of the processor, as the system reports it.
    pub processor: String,
    /// The number of cores available to this process.
    pub cores: usize,
    /// The width of the SIMD registers used by batches, in bits.
    pub lane_bits: usize,
    /// True if the program was compiled with optimisation.
    pub optimised: bool,
}

impl Machine {
    /// The machine that the program runs on.
    pub fn detect() -> Self {
        Self {
            processor: processor().unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            lane_bits: match SimdWidth::detect() {
                SimdWidth::Baseline => 128,
                SimdWidth::Bits256 => 256,
                SimdWidth::Bits512 => 512,
            },
            optimised: !cfg!(debug_assertions),
        }
    }
}

fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { processor, cores, lane_bits, optimised } = self;
        let build = if *optimised { "" } else { "; NOT OPTIMISED, build with --release" };
        write!(f, "{processor}, {cores} cores, lanes of {lane_bits} bits{build}")
    }
}

/// Clock ticks per second in `/proc`, the same for all Linux processors.
const TICKS: f64 = 100.0;

/// The milliseconds since the process started, to a hundredth of a second; `None` if unknown.
pub fn age_ms() -> Option<f64> {
    let [begun] = process_ticks([19])?;
    let uptime = fs::read_to_string("/proc/uptime").ok()?;
    let now: f64 = uptime.split_whitespace().next()?.parse().ok()?;
    Some(1e3 * (now - begun / TICKS))
}

/// The processor time of the process in milliseconds, threads that have ended included, to a
/// hundredth of a second; `None` if unknown.
pub fn processor_ms() -> Option<f64> {
    let [user, system] = process_ticks([11, 12])?;
    Some(1e3 * (user + system) / TICKS)
}

/// Numbers of this process by their places behind its name, in clock ticks.
fn process_ticks<const N: usize>(places: [usize; N]) -> Option<[f64; N]> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    // The name in brackets may contain blanks.
    let (_, numbers) = stat.rsplit_once(')')?;
    let numbers: Vec<&str> = numbers.split_whitespace().collect();
    let mut found = [0.0; N];
    for (value, place) in found.iter_mut().zip(places) {
        *value = numbers.get(place)?.parse().ok()?;
    }
    Some(found)
}

/// The memory of a piece of work, in megabytes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MemoryUse {
    /// The memory of the process before, in MB.
    pub before_mb: f64,
    /// The peak during the work, in MB; an earlier peak of the process if that was higher and the
    /// system does not allow resetting it.
    pub peak_mb: f64,
}

/// Measures the peak memory of `work`; `None` if the system does not report it.
pub fn peak_megabytes(work: impl FnOnce()) -> Option<MemoryUse> {
    // Without permission the peak remains that of the whole process.
    drop(fs::write("/proc/self/clear_refs", "5"));
    let before_mb = status_megabytes("VmRSS:")?;
    work();
    Some(MemoryUse { before_mb, peak_mb: status_megabytes("VmHWM:")? })
}

/// The value of a line of the status of this process, in MB.
fn status_megabytes(key: &str) -> Option<f64> {
    let text = fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let kilobytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_only_grows() {
        let (Some(age), Some(work)) = (age_ms(), processor_ms()) else { return };
        let sum: f64 = (0..100_000).map(f64::from).map(f64::sqrt).sum();
        assert!(sum > 0.0 && age >= 0.0);
        assert!(age_ms().is_some_and(|later| later >= age));
        assert!(processor_ms().is_some_and(|later| later >= work));
    }

    #[test]
    fn a_machine_is_described_with_its_cores_and_its_build() {
        let slow = Machine {
            processor: "Abacus 9".to_owned(),
            cores: 12,
            lane_bits: 256,
            optimised: false,
        };
        let text = slow.to_string();
        for word in ["Abacus 9", "12 cores", "256 bits", "NOT OPTIMISED"] {
            assert!(text.contains(word), "{text}");
        }
        assert!(!Machine { optimised: true, ..slow }.to_string().contains("OPTIMISED"));
    }
}
