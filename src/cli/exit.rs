//! Exit codes, and the one error of the command line.

use std::fmt::{Display, Write as _};

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
    /// The cloud that was asked for has no point; there is a report.
    EmptyCloud = 5,
    /// Files of the data directory are missing or damaged.
    Damaged = 6,
}

impl Exit {
    /// All of them, by code.
    const ALL: [Self; 6] =
        [Self::Internal, Self::Usage, Self::Input, Self::Series, Self::EmptyCloud, Self::Damaged];

    /// What it means, in the table below `triplanar --help`.
    fn meaning(self) -> &'static str {
        match self {
            Self::Internal => "internal error, or an output can't be written",
            Self::Usage => "the arguments or the configuration are not valid, or --series is needed",
            Self::Input => "the input can't be read, or holds no CT series, no cloud, no mesh",
            Self::Series => {
                "the CT series can't be reconstructed: too few slices, geometry or pixels (the message names \
                 the error)"
            }
            Self::EmptyCloud => {
                "no skin was found (empty_cloud, no_head, …), or no point is of --plane or within \
                 --max-error-mm; the report has the reasons"
            }
            Self::Damaged => "files of the data directory are missing or damaged (check)",
        }
    }
}

/// The codes and their meanings, as they stand below `triplanar --help`.
pub(super) fn table() -> String {
    let mut table = "Exit codes:\n  0  done".to_owned();
    for exit in Exit::ALL {
        write!(table, "\n  {}  {}", exit as u8, exit.meaning()).expect("writing to a string");
    }
    table
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
