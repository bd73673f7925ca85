//! Glasses of catalogues that a person has added: they last as long as the program.

use super::{Glass, index_names};
use std::collections::{BTreeSet, HashMap};
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

/// The added glasses and the glass of every name; `None` for a name that two manufacturers share.
#[derive(Debug)]
struct AddedGlasses {
    glasses: Vec<&'static Glass>,
    names: Option<HashMap<String, Option<&'static Glass>>>,
    /// The number of additions.
    additions: usize,
}

static ADDED: RwLock<AddedGlasses> =
    RwLock::new(AddedGlasses { glasses: Vec::new(), names: None, additions: 0 });

/// Adds glasses, which every lens finds by name from now on, in place of those that were added of the
/// same manufacturers. Of two with the same manufacturer and name the first one is found.
pub fn add(glasses: Vec<Glass>) {
    let glasses: &'static [Glass] = glasses.leak();
    let makers: BTreeSet<&str> = glasses.iter().map(|new| new.manufacturer.as_str()).collect();
    let mut added = ADDED.write().unwrap_or_else(PoisonError::into_inner);
    added.glasses.retain(|old| !makers.contains(old.manufacturer.as_str()));
    added.glasses.extend(glasses);
    added.names = Some(index_names(added.glasses.iter().copied()));
    added.additions += 1;
}

/// The number of times that glasses were added: lists of glasses with another one are out of date.
pub fn additions() -> usize {
    read().additions
}

/// Every added glass, in the order in which they were added.
pub fn added_glasses() -> Vec<&'static Glass> {
    read().glasses.clone()
}

/// The added glass of a normalized name.
pub(super) fn find(name: &str) -> Option<&'static Glass> {
    read().names.as_ref()?.get(name).copied().flatten()
}

fn read() -> RwLockReadGuard<'static, AddedGlasses> {
    ADDED.read().unwrap_or_else(PoisonError::into_inner)
}
