//! Our own SCU: Verification and Storage towards another AE. `demo` pushes its phantom with it,
//! as a PACS would, and so do the tests.

mod instance;
mod session;
mod store;

use std::io;
use std::time::Duration;

use dicom_dictionary_std::uids;
pub use instance::Instance;
pub use store::{Answer, Outcome, store};

use super::command::{CommandSet, NO_DATA_SET, element, field};
use super::fault::Fault;
use super::services::VERIFICATION;
use session::{Proposal, Session};

/// The AE that is called, and how.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Peer {
    /// Host and port, as `127.0.0.1:11112`.
    pub address: String,
    /// Called AE title.
    pub called_ae_title: String,
    /// Calling AE title: ours.
    pub calling_ae_title: String,
    /// Time for the connection and for each answer.
    pub timeout: Duration,
}

/// Why nothing (more) could be sent.
#[derive(Debug, thiserror::Error)]
pub enum ScuError {
    /// No TCP connection.
    #[error("no connection to {address}: {cause}")]
    Connect {
        /// Host and port.
        address: String,
        /// Why.
        cause: io::Error,
    },
    /// A-ASSOCIATE-RJ.
    #[error("the peer rejected the association: {reason} ({})", if *.transient { "transient" } else { "permanent" })]
    Rejected {
        /// The peer may accept it later.
        transient: bool,
        /// PS3.8 section 9.3.4.
        reason: String,
    },
    /// The peer accepted the association but not the presentation context.
    #[error("the peer does not accept {0}")]
    NotAccepted(&'static str),
    /// A status other than success.
    #[error("the peer answered status {0:04X}")]
    Status(u16),
    /// An instance that can't be read.
    #[error("{name} can't be sent: {detail}")]
    Unreadable {
        /// Its path, or its place in the list.
        name: String,
        /// Why.
        detail: String,
    },
    /// More pairs of SOP class and transfer syntax than an association can propose.
    #[error("the instances need more than 128 presentation contexts; send them in several calls")]
    TooManyContexts,
    /// The association broke.
    #[error(transparent)]
    Fault(#[from] Fault),
}

/// C-ECHO.
///
/// # Errors
/// Anything but a success status.
pub async fn echo(peer: &Peer) -> Result<(), ScuError> {
    let proposal = Proposal {
        abstract_syntax: VERIFICATION.to_owned(),
        transfer_syntax: uids::IMPLICIT_VR_LITTLE_ENDIAN.to_owned(),
    };
    let mut session = Session::open(peer, std::slice::from_ref(&proposal)).await?;
    let status = match session.context_of(&proposal) {
        None => None,
        Some(context_id) => {
            let request = CommandSet::default()
                .with_uid(element::AFFECTED_SOP_CLASS_UID, VERIFICATION)
                .with_number(element::COMMAND_FIELD, field::C_ECHO_RQ)
                .with_number(element::MESSAGE_ID, 1)
                .with_number(element::COMMAND_DATA_SET_TYPE, NO_DATA_SET);
            session.send_command(context_id, &request).await?;
            Some(session.response(context_id, field::C_ECHO_RQ, 1).await?.status)
        }
    };
    session.release().await?;
    match status {
        Some(0) => Ok(()),
        Some(status) => Err(ScuError::Status(status)),
        None => Err(ScuError::NotAccepted("Verification")),
    }
}
