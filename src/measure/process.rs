//! The age, the processor time and the memory of this process, all threads together.
//!
//! Linux reports them in `/proc`; elsewhere they are unknown.

use serde::Serialize;
use std::fs;

/// Clock ticks per second in `/proc`, the same for all Linux processors.
const TICKS: f64 = 100.0;

/// The milliseconds since the process started, to a hundredth of a second; `None` if unknown.
pub fn age_ms() -> Option<f64> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    // The name in brackets may contain blanks; the start is the 20th number behind it.
    let (_, numbers) = stat.rsplit_once(')')?;
    let begun: f64 = numbers.split_whitespace().nth(19)?.parse().ok()?;
    let uptime = fs::read_to_string("/proc/uptime").ok()?;
    let now: f64 = uptime.split_whitespace().next()?.parse().ok()?;
    Some(1e3 * (now - begun / TICKS))
}

/// The processor time of all threads that exist now, in milliseconds; `None` if unknown.
pub fn processor_ms() -> Option<f64> {
    let mut sum = 0.0;
    for thread in fs::read_dir("/proc/self/task").ok()? {
        let path = thread.ok()?.path().join("schedstat");
        // A thread may have ended since it was listed.
        let Ok(text) = fs::read_to_string(path) else { continue };
        let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
        sum += 1e-6 * nanoseconds;
    }
    Some(sum)
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
}
