//! How the steps of the profile are stopped where they are.
//!
//! They are loops within loops in plain functions; a result for "stopped" in each would hide what they
//! compute. A step that is to stop unwinds instead, and the door of the profile catches it (as salsa
//! cancels its queries: `salsa::Cancelled`). Nothing that was half done is looked at again.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use super::skin::NoSkin;
use crate::pipeline::Observer;

/// What a step that stops unwinds with.
struct Stopped;

/// Whom to ask whether to stop: nobody unless it is told.
#[derive(Clone, Copy, Default)]
pub(super) struct Asked<'a>(Option<&'a dyn Observer>);

impl<'a> Asked<'a> {
    /// Asks this observer.
    pub(super) fn of(observer: &'a dyn Observer) -> Self {
        Self(Some(observer))
    }

    /// Goes on, or unwinds to [`unless_stopped`] without a word on standard error.
    pub(super) fn ask(self) {
        if self.0.is_some_and(Observer::cancelled) {
            resume_unwind(Box::new(Stopped));
        }
    }
}

impl fmt::Debug for Asked<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Asked").field(&self.0.is_some()).finish()
    }
}

/// Does the work; [`NoSkin::Cancelled`] if one of its steps was stopped.
pub(super) fn unless_stopped<T>(work: impl FnOnce() -> Result<T, NoSkin>) -> Result<T, NoSkin> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|cause| {
        if cause.is::<Stopped>() { Err(NoSkin::Cancelled) } else { resume_unwind(cause) }
    })
}
