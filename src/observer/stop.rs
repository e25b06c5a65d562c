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
