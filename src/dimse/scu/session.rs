//! An association that we open.

use std::collections::BTreeMap;

use dicom_ul::pdu::{
    AssociationAC, AssociationRJResult, AssociationRQ, Pdu, PresentationContextProposed,
    PresentationContextResultReason, UserVariableItem,
};
use tokio::net::TcpStream;
use tokio::time::timeout;

use super::{Peer, ScuError};
use crate::dimse::channel::{Channel, Incoming};
use crate::dimse::command::{CommandSet, RESPONSE, element};
use crate::dimse::connection::{Connection, Received};
use crate::dimse::fault::Fault;
use crate::dimse::negotiation::{APPLICATION_CONTEXT, PROTOCOL_VERSION, own_user_variables};
use crate::dimse::stop::Stop;

/// Context IDs are odd and below 256.
const MAX_CONTEXTS: usize = 128;

/// Largest P-DATA-TF that we take; answers are small.
const MAX_PDU_LENGTH: u32 = 262_144;

/// A presentation context that we want: one transfer syntax each, so that the answer says of each
/// pair whether the peer takes it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Proposal {
    pub(super) abstract_syntax: String,
    pub(super) transfer_syntax: String,
}

/// A response's status and comment.
#[derive(Debug)]
pub(super) struct Response {
    pub(super) status: u16,
    pub(super) comment: Option<String>,
}

/// An open association.
pub(super) struct Session {
    channel: Channel,
    accepted: BTreeMap<Proposal, u8>,
}

impl Session {
    pub(super) async fn open(peer: &Peer, proposals: &[Proposal]) -> Result<Self, ScuError> {
        if proposals.len() > MAX_CONTEXTS {
            return Err(ScuError::TooManyContexts);
        }
        let no_connection = |cause| ScuError::Connect { address: peer.address.clone(), cause };
        let stream = timeout(peer.timeout, TcpStream::connect(&peer.address))
            .await
            .unwrap_or_else(|_| Err(std::io::ErrorKind::TimedOut.into()))
            .map_err(no_connection)?;
        let mut connection = Connection::new(stream, MAX_PDU_LENGTH, peer.timeout)?;
        let ids = (1_u8..=255).step_by(2);
        let contexts = ids.clone().zip(proposals).map(|(id, proposal)| PresentationContextProposed {
            id,
            abstract_syntax: proposal.abstract_syntax.clone(),
            transfer_syntaxes: vec![proposal.transfer_syntax.clone()],
        });
        let request = AssociationRQ {
            protocol_version: PROTOCOL_VERSION,
            calling_ae_title: peer.calling_ae_title.clone(),
            called_ae_title: peer.called_ae_title.clone(),
            application_context_name: APPLICATION_CONTEXT.to_owned(),
            presentation_contexts: contexts.collect(),
            user_variables: own_user_variables(MAX_PDU_LENGTH),
        };
        connection.send(&Pdu::AssociationRQ(request)).await?;
        let answer = accepted(connection.receive(peer.timeout).await?)?;
        let is_accepted = |id| {
            answer
                .presentation_contexts
                .iter()
                .any(|result| result.id == id && result.reason == PresentationContextResultReason::Acceptance)
        };
        let accepted = ids.zip(proposals).filter(|(id, _)| is_accepted(*id));
        let accepted = accepted.map(|(id, proposal)| (proposal.clone(), id)).collect();
        let max_pdu_length = answer
            .user_variables
            .iter()
            .find_map(|item| if let UserVariableItem::MaxLength(max) = item { Some(*max) } else { None })
            .unwrap_or(0);
        let channel = Channel::new(connection, max_pdu_length, peer.timeout, Stop::default());
        Ok(Self { channel, accepted })
    }

    /// The context on which the peer accepted this proposal.
    pub(super) fn context_of(&self, proposal: &Proposal) -> Option<u8> {
        self.accepted.get(proposal).copied()
    }

    pub(super) async fn send_command(
        &mut self,
        context_id: u8,
        command: &CommandSet,
    ) -> Result<(), ScuError> {
        Ok(self.channel.send_command(context_id, command).await?)
    }

    pub(super) async fn send_data(
        &mut self,
        context_id: u8,
        last: bool,
        data: &[u8],
    ) -> Result<(), ScuError> {
        Ok(self.channel.send_data(context_id, last, data).await?)
    }

    /// Bytes of a data set that one call of `send_data` may carry.
    pub(super) fn fragment_size(&self) -> usize {
        self.channel.fragment_size()
    }

    /// The response to the request with this field and message ID.
    pub(super) async fn response(
        &mut self,
        context_id: u8,
        field: u16,
        message_id: u16,
    ) -> Result<Response, ScuError> {
        let Incoming::Command(answered_on, command) = self.channel.message().await? else {
            return Err(Fault::Message("a release came where a response was due".to_owned()).into());
        };
        let number = |element| command.number(element).map_err(|error| Fault::Message(error.to_string()));
        let is_ours = answered_on == context_id
            && number(element::COMMAND_FIELD)? == field | RESPONSE
            && number(element::MESSAGE_ID_BEING_RESPONDED_TO)? == message_id;
        if !is_ours {
            return Err(Fault::Message("a response came to another request".to_owned()).into());
        }
        Ok(Response {
            status: number(element::STATUS)?,
            comment: command.text(element::ERROR_COMMENT).map(str::to_owned),
        })
    }

    /// Releases the association and closes the connection.
    pub(super) async fn release(mut self) -> Result<(), ScuError> {
        self.channel.send(&Pdu::ReleaseRQ).await?;
        match self.channel.message().await? {
            Incoming::ReleaseResponse => {
                self.channel.close().await;
                Ok(())
            }
            _ => Err(Fault::Message("something else came where a release was due".to_owned()).into()),
        }
    }
}

fn accepted(received: Received) -> Result<AssociationAC, ScuError> {
    let pdu = match received {
        Received::Pdu(pdu) => *pdu,
        Received::Data(_) => return Err(Fault::Message("data came before the association".to_owned()).into()),
    };
    match pdu {
        Pdu::AssociationAC(answer) => Ok(answer),
        Pdu::AssociationRJ(rejection) => Err(ScuError::Rejected {
            transient: rejection.result == AssociationRJResult::Transient,
            reason: rejection.source.to_string(),
        }),
        Pdu::AbortRQ { .. } => Err(Fault::Aborted.into()),
        other => Err(Fault::Message(format!("{} as answer", other.short_description())).into()),
    }
}
