//! The heap keeps what it has once got from the system.
//!
//! Each evaluation of a merit takes some arrays of 0.1 to 1 MB and frees them again. The allocator of the GNU C
//! library gives those back to the system at once and gets new pages, which the system has to clear, for the
//! next evaluation: a fifth of the time of a descent, and an eighth of that of a search.

/// The bytes up to which an array is taken from the heap: the most that the allocator allows.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGEST: i32 = 32 << 20;
/// The bytes at the end of the heap that stay if they are free.
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
        // SAFETY: `mallopt` takes two numbers, and no other thread runs yet. A refusal changes nothing.
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

    /// The pages that this process got from the system so far.
    fn page_faults() -> i64 {
        // The tenth field behind the name, in brackets: minor faults.
        let status = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
        let fields = status.rsplit(')').next().unwrap();
        fields.split_whitespace().nth(7).unwrap().parse().unwrap()
    }

    #[test]
    fn arrays_are_taken_from_what_others_have_freed() {
        keep_free_memory();
        let use_array = |seed: usize| {
            let array = vec![seed; 1 << 17];
            std::hint::black_box(&array).iter().sum::<usize>()
        };
        let sum: usize = (0..4).map(use_array).sum();
        let before = page_faults();
        let more: usize = (0..100).map(use_array).sum();
        // 1 MB each: 256 pages, 25,600 of them all together.
        let faults = page_faults() - before;
        assert!(faults < 2560, "{faults} pages for 100 arrays, {sum} {more}");
    }
}
