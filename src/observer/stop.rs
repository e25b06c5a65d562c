//! How the steps of a reconstruction are stopped where they are.
//!
//! They are loops within loops in plain functions; a result for "stopped" in each would hide what they
//! compute. A step that is to stop unwinds instead, and the door of the profile catches it (as salsa
//! cancels its queries: `salsa::Cancelled`). Nothing that was half done is looked at again.
//!
//! A parallel loop whose items ask is fused ([`rayon::iter::ParallelIterator::panic_fuse`]): without that
//! rayon goes on to hand out pieces of it, each of which asks and unwinds.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use super::Observer;

/// What a step that stops unwinds with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stopped;

/// Whom to ask whether to stop: nobody unless it is told.
#[derive(Clone, Copy, Default)]
pub(crate) struct Asked<'a>(Option<&'a dyn Observer>);

/// Items of a loop, of some microseconds each at most.
const ITEMS_BETWEEN_ASKS: usize = 512;
/// Bytes that are copied or given back to the system at a time: 64 MiB take 10 to 20 ms.
const BYTES_BETWEEN_ASKS: usize = 1 << 26;

impl<'a> Asked<'a> {
    /// Asks this observer.
    pub(crate) fn of(observer: &'a dyn Observer) -> Self {
        Self(Some(observer))
    }

    /// Goes on, or unwinds to [`unless_stopped`] without a word on standard error.
    #[inline]
    pub(crate) fn ask(self) {
        if self.0.is_some_and(Observer::cancelled) {
            resume_unwind(Box::new(Stopped));
        }
    }

    /// The same once for so many items of a loop, by the number of the item: what an item costs is far
    /// less than to ask.
    #[inline]
    pub(crate) fn ask_at(self, item: usize) {
        if item.is_multiple_of(ITEMS_BETWEEN_ASKS) {
            self.ask();
        }
    }

    /// Drops a list: a large one piece by piece, the last one first. The system takes back a GB of pages in
    /// some 0.2 s.
    pub(crate) fn free<T: Copy>(self, mut list: Vec<T>) {
        let piece = at_once::<T>();
        while list.len() > piece {
            list.truncate(list.len() - piece);
            list.shrink_to_fit();
            self.ask();
        }
    }

    /// Appends to a list: much piece by piece.
    pub(crate) fn extend<T: Copy>(self, list: &mut Vec<T>, more: &[T]) {
        list.reserve(more.len());
        for piece in more.chunks(at_once::<T>()) {
            self.ask();
            list.extend_from_slice(piece);
        }
    }
}

/// Items of [`BYTES_BETWEEN_ASKS`].
fn at_once<T>() -> usize {
    (BYTES_BETWEEN_ASKS / size_of::<T>().max(1)).max(1)
}

impl fmt::Debug for Asked<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Asked").field(&self.0.is_some()).finish()
    }
}

/// Does the work; [`Stopped`] if one of its steps was stopped.
pub(crate) fn unless_stopped<T>(work: impl FnOnce() -> T) -> Result<T, Stopped> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|cause| {
        if !cause.is::<Stopped>() {
            resume_unwind(cause);
        }
        Stopped
    })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::super::Stage;
    use super::*;

    /// Counts the asks, and says stop at the second.
    #[derive(Default)]
    struct Second(AtomicUsize);

    impl Observer for Second {
        fn progress(&self, _: Stage, _: f64) {}
        fn cancelled(&self) -> bool {
            self.0.fetch_add(1, Ordering::Relaxed) == 1
        }
    }

    #[test]
    fn a_large_list_is_copied_and_dropped_with_asks() {
        let list = vec![[7_u8; 64]; 2 * at_once::<[u8; 64]>() + 5];
        let mut copy = vec![[1; 64]];
        Asked::default().extend(&mut copy, &list);
        assert!(copy[1..] == list && copy[0] == [1; 64]);
        let second = Second::default();
        let asked = Asked::of(&second);
        assert_eq!(unless_stopped(|| asked.extend(&mut Vec::new(), &list)), Err(Stopped));
        let second = Second::default();
        let asked = Asked::of(&second);
        assert_eq!(unless_stopped(|| asked.free(list)), Err(Stopped));
        asked.free(vec![0_u8; 1000]);
        assert_eq!(second.0.into_inner(), 2, "a small one is dropped at once");
    }
}
