//! The DIMSE services that we provide, one file each.
//!
//! A new one: its abstract syntaxes in [`Service::of_abstract_syntax`], its command in
//! [`perform`], its file beside the others, its chapter in `api/dicom-conformance.md`.

mod c_echo;
mod c_store;

use super::association::Association;
use super::command::{CommandSet, NO_DATA_SET, element, field};
use super::fault::Fault;
use super::negotiation::Context;
use super::status::{Refusal, UNRECOGNIZED_OPERATION};
use crate::dicom::sop_class;

/// Verification SOP class (PS3.4 annex A).
pub(crate) const VERIFICATION: &str = "1.2.840.10008.1.1";

/// What a presentation context is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Service {
    /// C-ECHO.
    Verification,
    /// C-STORE.
    Storage,
}

impl Service {
    /// The service that this abstract syntax asks for, if it is one of ours.
    pub(crate) fn of_abstract_syntax(uid: &str) -> Option<Self> {
        if uid == VERIFICATION {
            Some(Self::Verification)
        } else if sop_class::ACCEPTED.iter().any(|class| class.uid == uid) {
            Some(Self::Storage)
        } else {
            None
        }
    }
}

/// A request as it came.
#[derive(Debug)]
pub(crate) struct Request {
    /// The accepted context it came on.
    pub(crate) context: Context,
    /// Command Field.
    pub(crate) field: u16,
    /// Message ID: the answer repeats it.
    pub(crate) message_id: u16,
    /// Whether a data set follows.
    pub(crate) has_data_set: bool,
    /// All of it.
    pub(crate) command: CommandSet,
}

impl Request {
    /// Reads what every request has.
    pub(crate) fn new(context: Context, command: CommandSet) -> Result<Self, Fault> {
        let malformed = |error: super::command::CommandError| Fault::Message(error.to_string());
        let field = command.number(element::COMMAND_FIELD).map_err(malformed)?;
        // A cancel names the message that it cancels and has no ID of its own (PS3.7 9.3.2.3).
        let message_id = if field == field::C_CANCEL_RQ {
            element::MESSAGE_ID_BEING_RESPONDED_TO
        } else {
            element::MESSAGE_ID
        };
        let message_id = command.number(message_id).map_err(malformed)?;
        let data_set_type = command.number(element::COMMAND_DATA_SET_TYPE).map_err(malformed)?;
        Ok(Self { context, field, message_id, has_data_set: data_set_type != NO_DATA_SET, command })
    }
}

/// Carries out one request and answers it.
pub(crate) async fn perform(request: &Request, association: &mut Association) -> Result<(), Fault> {
    match (request.context.service, request.field) {
        (Service::Verification, field::C_ECHO_RQ) => c_echo::perform(request, association).await,
        (Service::Storage, field::C_STORE_RQ) => c_store::perform(request, association).await,
        // Nothing of ours takes long enough to be cancelled, and a cancel has no answer.
        (_, field::C_CANCEL_RQ) => association.discard_data_set(request).await,
        (_, field) => {
            association.discard_data_set(request).await?;
            let comment = format!("operation {field:04X} is not provided on this context");
            let refusal = Refusal::new(UNRECOGNIZED_OPERATION, "unrecognized-operation", &comment);
            association.answer(request, Err(&refusal)).await
        }
    }
}
