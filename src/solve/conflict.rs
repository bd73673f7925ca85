//! The smallest conflict among limits.

/// The smallest set of limits that contradict each other, from a set that does: each is left out in
/// turn, for good if the others still contradict each other (Chinneck and Dravnieks, ORSA J.
/// Computing 3 (1991) 157). Before single ones whole blocks are left out, from a half of them down: of
/// many limits few are in conflict.
pub fn smallest_conflict(
    conflicting: &[usize],
    mut is_conflict: impl FnMut(&[usize]) -> bool,
) -> Vec<usize> {
    let mut remaining = conflicting.to_vec();
    let mut size = (remaining.len() / 2).max(1);
    loop {
        let mut start = 0;
        while start < remaining.len() {
            let end = (start + size).min(remaining.len());
            let others = [&remaining[..start], &remaining[end..]].concat();
            if is_conflict(&others) {
                remaining = others;
            } else {
                start = end;
            }
        }
        if size == 1 {
            return remaining;
        }
        size /= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_conflict_leaves_out_bystanders() {
        let conflict = |set: &[usize]| set.contains(&1) && set.contains(&3);
        assert_eq!(smallest_conflict(&[0, 1, 2, 3, 4], conflict), [1, 3]);
    }

    #[test]
    fn few_of_many_limits_are_found_with_few_trials() {
        let all: Vec<usize> = (0..1000).collect();
        let mut trials = 0;
        let found = smallest_conflict(&all, |set| {
            trials += 1;
            set.contains(&17) && set.contains(&18) && set.contains(&900)
        });
        assert_eq!(found, [17, 18, 900]);
        assert!(trials < 80, "{trials}");
    }
}
