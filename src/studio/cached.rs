//! Values that are computed again only when their key changes.

use std::ops::Deref;
use std::sync::Arc;

/// A shared value that is compared by address: while it is held, no other value has its address.
#[derive(Debug)]
pub(super) struct ByAddress<T>(Arc<T>);

impl<T> Clone for ByAddress<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> PartialEq for ByAddress<T> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl<T> Deref for ByAddress<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T> From<&Arc<T>> for ByAddress<T> {
    fn from(value: &Arc<T>) -> Self {
        Self(Arc::clone(value))
    }
}

/// A value with the key from which it was computed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cached<K, V>(Option<(K, V)>);

impl<K: PartialEq, V> Cached<K, V> {
    /// An empty cache.
    pub(super) const fn new() -> Self {
        Self(None)
    }

    /// The value of a key, computed if the key has changed.
    pub(super) fn get(&mut self, key: K, compute: impl FnOnce(&K) -> V) -> &V {
        let known = self.0.take().filter(|(old, _)| *old == key);
        let entry = known.unwrap_or_else(|| {
            let value = compute(&key);
            (key, value)
        });
        &self.0.insert(entry).1
    }

    /// The value that was computed last.
    pub(super) fn last(&self) -> Option<&V> {
        self.0.as_ref().map(|(_, value)| value)
    }

    /// Removes the value.
    pub(super) fn clear(&mut self) {
        self.0 = None;
    }
}

impl<K: PartialEq, V> Default for Cached<K, V> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_computed_again_only_for_another_key() {
        let mut cached = Cached::new();
        let first = Arc::new(1);
        assert_eq!(*cached.get(ByAddress::from(&first), |key| **key + 1), 2);
        assert_eq!(*cached.get(ByAddress::from(&first), |_| 9), 2);
        assert_eq!(*cached.get(ByAddress::from(&Arc::new(1)), |_| 9), 9);
        assert_eq!(cached.last(), Some(&9));
    }
}
