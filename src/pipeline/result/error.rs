//! Why a reconstruction gave no cloud.

use super::reconstruction::Reconstruction;
use crate::observer::stop::Stopped;
use crate::pipeline::precise::NoSkin;

/// Why the pipeline gave no cloud.
#[derive(Debug, Clone, thiserror::Error)]
pub enum PipelineError {
    /// Not one point is left. The rows tell which tests rejected the slices.
    #[error("no point of skin is left after {stage}: see the report for the reason of every slice")]
    EmptyCloud {
        /// The step after which nothing was left.
        stage: &'static str,
        /// What was found up to there.
        partial: Box<Reconstruction>,
    },
    /// The profile `precise` found no skin.
    #[error("{cause}")]
    NoSkin {
        /// Why.
        cause: NoSkin,
        /// A row for every slice, all of them rejected.
        partial: Box<Reconstruction>,
    },
    /// The points and the parameters together ask for more than may be computed.
    #[error(
        "with these points {parameters} ask for {tests} tests of distances; {limit} are allowed: choose a larger \
         leaf_mm, or a smaller radius or fewer neighbours"
    )]
    TooCostly {
        /// The parameters that decide how much there is to do.
        parameters: &'static str,
        /// Tests of distances, at least.
        tests: u64,
        /// The limit.
        limit: u64,
    },
    /// The observer asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl From<Stopped> for PipelineError {
    fn from(Stopped: Stopped) -> Self {
        Self::Cancelled
    }
}

impl PipelineError {
    /// The stable code of a reconstruction that failed for it.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::EmptyCloud { .. } => "empty_cloud",
            Self::NoSkin { cause, .. } => cause.code(),
            Self::TooCostly { .. } => "too_costly",
            Self::Cancelled => "cancelled",
        }
    }
}

impl Reconstruction {
    /// The reconstruction unless its cloud is empty after this stage.
    ///
    /// # Errors
    /// [`PipelineError::EmptyCloud`].
    pub(crate) fn unless_empty(self, stage: &'static str) -> Result<Self, PipelineError> {
        if self.triplanar.is_empty() {
            return Err(PipelineError::EmptyCloud { stage, partial: Box::new(self) });
        }
        Ok(self)
    }
}
