//! How much memory a piece of work takes at its peak, as Linux counts it.

use serde::Serialize;

/// The memory of a piece of work, in megabytes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MemoryUse {
    /// What the process had before.
    pub before_mb: f64,
    /// The most that it had while working; what the process had at its peak before, if that was
    /// more and the system does not forget it.
    pub peak_mb: f64,
}

/// The peak of what `work` takes; `None` where the system does not tell.
pub fn peak_megabytes(work: impl FnOnce()) -> Option<MemoryUse> {
    // Without the right to do so the peak stays that of the whole process.
    drop(std::fs::write("/proc/self/clear_refs", "5"));
    let before_mb = status_megabytes("VmRSS:")?;
    work();
    Some(MemoryUse { before_mb, peak_mb: status_megabytes("VmHWM:")? })
}

/// A line of the status of this process, in megabytes.
fn status_megabytes(key: &str) -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let kilobytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes / 1024.0)
}
