//! Short inline lists, so that a schedule is one allocation.

use std::fmt;
use std::ops::Deref;

/// Up to `N` items.
#[derive(Clone, Copy)]
pub struct ShortList<T, const N: usize> {
    /// Items from `count` on are unused.
    all: [T; N],
    count: usize,
}

impl<T: Copy, const N: usize> ShortList<T, N> {
    /// An empty list; `filler` is never read.
    pub(super) const fn empty(filler: T) -> ShortList<T, N> {
        ShortList { all: [filler; N], count: 0 }
    }

    /// # Panics
    /// The list is full.
    pub(super) fn add(&mut self, item: T) {
        self.all[self.count] = item;
        self.count += 1;
    }
}

impl<T, const N: usize> Deref for ShortList<T, N> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.all[..self.count]
    }
}

impl<T: PartialEq, const N: usize> PartialEq for ShortList<T, N> {
    fn eq(&self, other: &ShortList<T, N>) -> bool {
        **self == **other
    }
}

impl<T: Eq, const N: usize> Eq for ShortList<T, N> {}

impl<T: fmt::Debug, const N: usize> fmt::Debug for ShortList<T, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}
