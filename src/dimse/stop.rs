//! How a shutdown reaches the associations: first those that wait for a message, then all.

use tokio_util::sync::CancellationToken;

/// The two words of a shutdown.
#[derive(Debug, Clone, Default)]
pub(crate) struct Stop {
    /// Finish the message that is on its way, begin no other.
    pub(crate) soon: CancellationToken,
    /// End at once.
    pub(crate) now: CancellationToken,
}
