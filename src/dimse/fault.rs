//! Why an association ends other than by release, and what the peer is told.

use std::io;
use std::time::Duration;

use dicom_ul::pdu::{AbortRQServiceProviderReason as Reason, AbortRQSource};

/// Why an association ended other than by release.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The peer closed the connection between two PDUs.
    #[error("the peer closed the connection without a release")]
    Closed,
    /// The connection broke.
    #[error("the connection was lost: {0}")]
    Lost(#[from] io::Error),
    /// The peer sent an A-ABORT.
    #[error("the peer aborted the association")]
    Aborted,
    /// Nothing (or not a whole PDU) arrived in time.
    #[error("no whole PDU arrived within {} s", .0.as_secs_f32())]
    Idle(Duration),
    /// The peer sends a message too slowly.
    #[error("the peer sent less than {0} bytes a second (dimse.min_bytes_per_second)")]
    Slow(u64),
    /// Others need the connection, on which no association request came yet.
    #[error("closed for others: too many connections wait without an association request")]
    Crowded,
    /// Another association needs the place of this one, whose peer asks for nothing or is slow.
    #[error(
        "closed for another association: all places are taken (dimse.max_associations, \
         dimse.max_associations_per_peer) and this one waited longest for a request, or its address has the most \
         and it is slow (dimse.crowded_bytes_per_second)"
    )]
    GaveWay,
    /// The peer did not take what we sent in time.
    #[error("the peer did not take a PDU of ours within {} s", .0.as_secs_f32())]
    Stalled(Duration),
    /// The peer broke the upper layer protocol (PS3.8).
    #[error("protocol error: {detail}")]
    Protocol {
        /// What the A-ABORT says (PS3.8 section 9.3.8).
        reason: Reason,
        /// For the log.
        detail: String,
    },
    /// The peer broke the message exchange (PS3.7): a command set that can't be read, a response
    /// to nothing.
    #[error("message error: {0}")]
    Message(String),
    /// We are shutting down.
    #[error("the service is shutting down")]
    ShuttingDown,
}

impl Fault {
    /// A PDU or an item of one that has no place here.
    pub(crate) fn protocol(reason: Reason, detail: impl Into<String>) -> Self {
        Self::Protocol { reason, detail: detail.into() }
    }

    /// What the A-ABORT to the peer says; nothing where there is nobody to tell.
    pub(crate) fn abort(&self) -> Option<AbortRQSource> {
        match self {
            Self::Closed | Self::Lost(_) | Self::Aborted | Self::Crowded => None,
            Self::Protocol { reason, .. } => Some(AbortRQSource::ServiceProvider(reason.clone())),
            Self::Idle(_)
            | Self::Slow(_)
            | Self::GaveWay
            | Self::Stalled(_)
            | Self::Message(_)
            | Self::ShuttingDown => Some(AbortRQSource::ServiceUser),
        }
    }

    /// How the association ended, in one word: `aborted` by either side, or `lost`.
    #[must_use]
    pub(crate) fn end(&self) -> &'static str {
        match self {
            Self::Closed | Self::Lost(_) => "lost",
            _ => "aborted",
        }
    }

    /// Stable name, for the log and the metrics.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::Lost(_) => "lost",
            Self::Aborted => "aborted_by_peer",
            Self::Idle(_) => "idle",
            Self::Slow(_) => "slow",
            Self::Crowded => "crowded",
            Self::GaveWay => "gave_way",
            Self::Stalled(_) => "stalled",
            Self::Protocol { .. } => "protocol_error",
            Self::Message(_) => "message_error",
            Self::ShuttingDown => "shutting_down",
        }
    }
}
