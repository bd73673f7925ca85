//! Peak memory of a piece of work, as Linux counts it.

use serde::Serialize;

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
    drop(std::fs::write("/proc/self/clear_refs", "5"));
    let before_mb = status_megabytes("VmRSS:")?;
    work();
    Some(MemoryUse { before_mb, peak_mb: status_megabytes("VmHWM:")? })
}

/// The value of a line of the status of this process, in MB.
fn status_megabytes(key: &str) -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let kilobytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes / 1024.0)
}
