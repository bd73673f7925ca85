//! The best points, at most one of each topology, no point twice.

use aplanat::search::{OfferOutcome, Reservoir, ReservoirEntry};

fn entry(number: u64, loss: f64, topology: &str) -> ReservoirEntry<u64> {
    ReservoirEntry {
        number,
        loss,
        topology: topology.to_owned(),
        structure_violation: 0,
        point: number,
    }
}

fn numbers(reservoir: &Reservoir<u64>) -> Vec<u64> {
    let mut numbers: Vec<u64> = reservoir.entries().iter().map(|entry| entry.number).collect();
    numbers.sort_unstable();
    numbers
}

#[test]
fn a_full_reservoir_gives_up_its_worst() {
    let mut reservoir = Reservoir::new(3, true);
    for (i, topology) in ["a", "b", "c"].into_iter().enumerate() {
        assert_eq!(
            reservoir.offer(entry(i as u64, 3.0 - i as f64, topology)),
            OfferOutcome::Entered
        );
    }
    assert_eq!(reservoir.offer(entry(3, 3.0, "d")), OfferOutcome::RejectedWorse);
    assert_eq!(reservoir.offer(entry(4, 2.5, "e")), OfferOutcome::Replaced(0));
    assert_eq!(reservoir.offer(entry(5, 0.5, "f")), OfferOutcome::Replaced(4));
    assert_eq!(numbers(&reservoir), [1, 2, 5]);
    assert_eq!(reservoir.best().unwrap().number, 5);
}

#[test]
fn a_point_replaces_one_of_the_same_topology_only_if_better() {
    let mut reservoir = Reservoir::new(3, true);
    reservoir.offer(entry(0, 1.0, "a"));
    reservoir.offer(entry(1, 9.0, "b"));
    assert_eq!(reservoir.offer(entry(2, 1.0, "a")), OfferOutcome::RejectedSameTopology(0));
    assert_eq!(reservoir.offer(entry(3, 0.9, "a")), OfferOutcome::Replaced(0));
    assert_eq!(reservoir.offer(entry(4, 5.0, "a")), OfferOutcome::RejectedSameTopology(3));
    assert_eq!(numbers(&reservoir), [1, 3]);
}

#[test]
fn one_per_topology_can_be_switched_off() {
    let mut reservoir = Reservoir::new(2, false);
    assert_eq!(reservoir.offer(entry(0, 1.0, "a")), OfferOutcome::Entered);
    assert_eq!(reservoir.offer(entry(1, 2.0, "a")), OfferOutcome::Entered);
    assert_eq!(reservoir.offer(entry(2, 1.5, "a")), OfferOutcome::Replaced(1));
}

#[test]
fn the_same_point_is_never_in_twice() {
    for one_per_topology in [true, false] {
        let mut reservoir = Reservoir::new(4, one_per_topology);
        reservoir.offer(entry(0, 1.0, "a"));
        let same = ReservoirEntry { number: 7, loss: 0.5, ..entry(0, 1.0, "b") };
        assert_eq!(reservoir.offer(same), OfferOutcome::AlreadyPresent(0));
        assert_eq!(reservoir.entries().len(), 1);
    }
}

#[test]
fn a_reservoir_of_one_holds_the_best() {
    for size in [0, 1] {
        let mut reservoir = Reservoir::new(size, true);
        assert!(reservoir.best().is_none());
        reservoir.offer(entry(0, 2.0, "a"));
        assert_eq!(reservoir.offer(entry(1, 3.0, "b")), OfferOutcome::RejectedWorse);
        assert_eq!(reservoir.offer(entry(2, 1.0, "b")), OfferOutcome::Replaced(0));
        assert_eq!(numbers(&reservoir), [2]);
    }
}

#[test]
fn points_of_infinite_loss_are_not_retained() {
    let mut reservoir = Reservoir::new(2, true);
    for loss in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(reservoir.offer(entry(0, loss, "a")), OfferOutcome::RejectedNonFinite);
    }
    assert!(reservoir.entries().is_empty());
}

/// A structure that is asked for is better than one that is not, whatever the losses.
#[test]
fn the_nearer_structure_is_the_better_one() {
    let far = |structure_violation, entry| ReservoirEntry { structure_violation, ..entry };
    let mut reservoir = Reservoir::new(2, true);
    reservoir.offer(far(2, entry(0, 0.1, "a")));
    reservoir.offer(far(1, entry(1, 5.0, "b")));
    assert_eq!(reservoir.best().unwrap().number, 1);
    assert_eq!(reservoir.offer(far(3, entry(2, 0.0, "c"))), OfferOutcome::RejectedWorse);
    assert_eq!(reservoir.offer(far(0, entry(3, 9.0, "d"))), OfferOutcome::Replaced(0));
    assert_eq!(reservoir.best().unwrap().number, 3);
}
