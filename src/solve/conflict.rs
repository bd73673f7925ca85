//! The smallest conflict among limits.

/// The smallest set of limits that contradict each other, from a set that does: each is left out in
/// turn, for good if the others still contradict each other (Chinneck and Dravnieks, ORSA J.
/// Computing 3 (1991) 157).
pub fn smallest_conflict(
    conflicting: &[usize],
    mut is_conflict: impl FnMut(&[usize]) -> bool,
) -> Vec<usize> {
    let mut remaining = conflicting.to_vec();
    for candidate in conflicting {
        let others: Vec<usize> = remaining.iter().copied().filter(|i| i != candidate).collect();
        if is_conflict(&others) {
            remaining = others;
        }
    }
    remaining
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_conflict_leaves_out_bystanders() {
        let conflict = |set: &[usize]| set.contains(&1) && set.contains(&3);
        assert_eq!(smallest_conflict(&[0, 1, 2, 3, 4], conflict), [1, 3]);
    }
}
