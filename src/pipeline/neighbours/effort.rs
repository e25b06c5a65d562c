//! What a filter may cost, and whether it is to stop: asked as it goes over its points.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::observer::stop::Asked;
use crate::observer::{Observer, Silent};
use crate::pipeline::result::PipelineError;

/// The observer is asked once for so many tests of a distance: some 0.1 to 10 ms of one thread.
const TESTS_BETWEEN_ASKS: u64 = 1 << 16;

/// Distances that one filter may test. With the default parameters the largest head in the test data
/// needs 2·10⁸; 2·10¹¹ take some minutes on one core.
pub(crate) const MOST_TESTS: u64 = 200_000_000_000;

/// The effort of one filter, shared by its threads.
pub(crate) struct Effort<'a> {
    observer: &'a dyn Observer,
    /// The parameters that decide how much there is to do.
    parameters: &'static str,
    most: u64,
    tests: AtomicU64,
}

impl<'a> Effort<'a> {
    /// Of a filter whose cost lies in these parameters.
    pub(crate) fn of(observer: &'a dyn Observer, parameters: &'static str) -> Self {
        Self { observer, parameters, most: MOST_TESTS, tests: AtomicU64::new(0) }
    }

    /// Of one that nothing stops.
    pub(crate) fn unbounded() -> Effort<'static> {
        Effort { most: u64::MAX, ..Effort::of(&Silent, "") }
    }

    /// Whom what has no tests to count asks.
    pub(crate) fn asked(&self) -> Asked<'a> {
        Asked::of(self.observer)
    }

    /// Refuses before it begins what needs at least so many tests.
    ///
    /// # Errors
    /// [`PipelineError::TooCostly`].
    pub(crate) fn foresee(&self, tests: u64) -> Result<(), PipelineError> {
        if tests > self.most { Err(self.too_costly(tests)) } else { Ok(()) }
    }

    /// Counts tests that were made.
    ///
    /// # Errors
    /// [`PipelineError::TooCostly`] beyond the limit, [`PipelineError::Cancelled`] if the observer
    /// asks for it. Whether the limit is reached depends on the points alone, not on the threads.
    pub(crate) fn spend(&self, tests: u64) -> Result<(), PipelineError> {
        let before = self.tests.fetch_add(tests, Ordering::Relaxed);
        let after = before.saturating_add(tests);
        if before / TESTS_BETWEEN_ASKS != after / TESTS_BETWEEN_ASKS && self.observer.cancelled() {
            return Err(PipelineError::Cancelled);
        }
        self.foresee(after)
    }

    fn too_costly(&self, tests: u64) -> PipelineError {
        PipelineError::TooCostly { parameters: self.parameters, tests, limit: self.most }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_told_before_and_while_it_is_reached() {
        let effort = Effort { most: 1000, ..Effort::of(&Silent, "leaf_mm") };
        assert!(effort.foresee(1000).is_ok());
        assert!(matches!(
            effort.foresee(1001),
            Err(PipelineError::TooCostly { tests: 1001, limit: 1000, .. })
        ));
        assert!(effort.spend(1000).is_ok());
        let error = effort.spend(1).unwrap_err();
        assert_eq!(error.code(), "too_costly");
        assert!(error.to_string().contains("leaf_mm"), "{error}");
    }
}
