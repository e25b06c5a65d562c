//! Exit codes, and the one error of the command line.

use std::fmt::Display;

/// Stands below `triplanar --help`.
pub(super) const TABLE: &str = "Exit codes:
  0  done
  1  internal error, or the output can't be written
  2  the arguments or the configuration are not valid, or --series is needed
  3  the input can't be read, or holds no CT series, no cloud, no mesh
  4  the series can't be reconstructed: its geometry or its pixels (the message names the error)
  5  no skin was found (empty_cloud, no_head, …); the report has the reasons";

/// How a subcommand ended, as its process's exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Our own fault, or that of the place where the output goes.
    Internal = 1,
    /// Arguments or configuration.
    Usage = 2,
    /// The input can't be read or holds nothing to work on.
    Input = 3,
    /// The series can't be reconstructed.
    Series = 4,
    /// No skin was found; there is a report.
    EmptyCloud = 5,
}

/// A subcommand that did not do what it was asked to.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct Failed {
    /// The exit code.
    pub exit: Exit,
    /// What went wrong and what to do next.
    pub message: String,
}

impl Failed {
    /// With that exit code.
    pub fn new(exit: Exit, message: impl Display) -> Self {
        Self { exit, message: message.to_string() }
    }

    /// [`Exit::Internal`].
    pub fn internal(message: impl Display) -> Self {
        Self::new(Exit::Internal, message)
    }

    /// [`Exit::Usage`].
    pub fn usage(message: impl Display) -> Self {
        Self::new(Exit::Usage, message)
    }
}
