//! The heap keeps what it has once got from the system.
//!
//! Each evaluation of a merit takes several arrays of 0.1 to 1 MB and frees them together. The allocator of the
//! GNU C library then gives most of them back to the system, and gets new pages, which the system has to clear,
//! for the next evaluation: a fifth of the time of a descent, and an eighth of that of a search.

/// The bytes up to which an array is taken from the heap: the most that the allocator allows
/// on machines of 64 bits; it refuses more, and nothing changes.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGEST: i32 = 32 << 20;
/// The bytes at the end of the main heap that stay if they are free. Those of other threads are of 64 MB at most
/// and stay as they are.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const KEPT: i32 = 256 << 20;

/// Makes the heap keep free arrays, where the allocator of the system can be told so.
pub(super) fn keep_free_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        #[expect(
            unsafe_code,
            reason = "a fifth of the time of descents, see above; no other call sets it"
        )]
        // SAFETY: `mallopt` takes two numbers and sets two numbers of the allocator under its own lock; it is
        // defined for every value, and a refusal changes nothing.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, LARGEST);
            libc::mallopt(libc::M_TRIM_THRESHOLD, KEPT);
        }
    }
}

#[cfg(test)]
#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod tests {
    use super::*;

    /// The pages that this thread got from the system so far.
    fn page_faults() -> i64 {
        // The tenth field of the line, the eighth behind the name in brackets: minor faults.
        let status = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
        let fields = status.rsplit(')').next().unwrap();
        fields.split_whitespace().nth(7).unwrap().parse().unwrap()
    }

    #[test]
    fn arrays_are_taken_from_what_others_have_freed() {
        keep_free_memory();
        // 8 MB at once: one array alone would stay in the heap without being told to.
        let use_arrays = |seed: usize| {
            let arrays: Vec<Vec<usize>> = (0..8).map(|_| vec![seed; 1 << 17]).collect();
            std::hint::black_box(&arrays).iter().flatten().sum::<usize>()
        };
        let sum: usize = (0..4).map(use_arrays).sum();
        let before = page_faults();
        let more: usize = (0..100).map(use_arrays).sum();
        // 2048 pages each time.
        let faults = page_faults() - before;
        assert!(faults < 20_480, "{faults} pages of 204,800, {sum} {more}");
    }
}
