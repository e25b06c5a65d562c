//! C-STORE as SCU.

use std::collections::BTreeSet;
use std::io::Read;

use super::instance::{Instance, Sendable};
use super::session::Session;
use super::{Peer, ScuError};
use crate::dicom::uid::SopInstanceUid;
use crate::dimse::command::{CommandSet, element, field};

/// Command Data Set Type: anything but "none".
const DATA_SET_FOLLOWS: u16 = 0x0001;

/// Priority: medium.
const MEDIUM: u16 = 0x0000;

/// What became of one instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// Which.
    pub sop_instance_uid: SopInstanceUid,
    /// The peer's answer.
    pub answer: Answer,
}

/// The peer's answer to one instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer {
    /// A C-STORE-RSP.
    Status {
        /// Status (0000,0900).
        code: u16,
        /// Error Comment (0000,0902).
        comment: Option<String>,
    },
    /// The peer takes this SOP class in no transfer syntax that we have it in.
    ContextNotAccepted,
}

impl Answer {
    /// Whether the peer has the instance.
    #[must_use]
    pub fn is_success(&self) -> bool {
        matches!(self, Self::Status { code: 0, .. })
    }
}

/// Sends instances over one association, each in the transfer syntax that it has, and tells
/// `answered` of each as it is answered.
///
/// # Errors
/// An instance that can't be read (nothing is sent then), no association, or one that broke; what
/// was told to `answered` before that stands. A refused instance is no error: see [`Outcome`].
pub async fn store(
    peer: &Peer,
    instances: &[Instance],
    mut answered: impl FnMut(&Outcome),
) -> Result<Vec<Outcome>, ScuError> {
    let sendables = instances.iter().enumerate().map(|(index, instance)| Sendable::new(index, instance));
    let sendables = sendables.collect::<Result<Vec<_>, _>>()?;
    let proposals: BTreeSet<_> = sendables.iter().map(|sendable| sendable.proposal.clone()).collect();
    let mut session = Session::open(peer, &proposals.into_iter().collect::<Vec<_>>()).await?;
    let mut outcomes = Vec::with_capacity(sendables.len());
    for (sendable, message_id) in sendables.iter().zip((1..=u16::MAX).cycle()) {
        let answer = match session.context_of(&sendable.proposal) {
            Some(context_id) => send(&mut session, context_id, message_id, sendable).await?,
            None => Answer::ContextNotAccepted,
        };
        let outcome = Outcome { sop_instance_uid: sendable.sop_instance_uid.clone(), answer };
        answered(&outcome);
        outcomes.push(outcome);
    }
    session.release().await?;
    Ok(outcomes)
}

async fn send(
    session: &mut Session,
    context_id: u8,
    message_id: u16,
    sendable: &Sendable<'_>,
) -> Result<Answer, ScuError> {
    let request = CommandSet::default()
        .with_uid(element::AFFECTED_SOP_CLASS_UID, &sendable.proposal.abstract_syntax)
        .with_number(element::COMMAND_FIELD, field::C_STORE_RQ)
        .with_number(element::MESSAGE_ID, message_id)
        .with_number(element::PRIORITY, MEDIUM)
        .with_number(element::COMMAND_DATA_SET_TYPE, DATA_SET_FOLLOWS)
        .with_uid(element::AFFECTED_SOP_INSTANCE_UID, sendable.sop_instance_uid.as_str());
    session.send_command(context_id, &request).await?;
    let mut reader = sendable.data_set()?;
    let mut chunk = Vec::new();
    loop {
        chunk.clear();
        // Local files and memory: short enough for the runtime's thread.
        (&mut reader)
            .take(session.fragment_size() as u64)
            .read_to_end(&mut chunk)
            .map_err(|error| sendable.unreadable(&error))?;
        // A fragment that is not full ends the data set; an empty one may.
        let last = chunk.len() < session.fragment_size();
        session.send_data(context_id, last, &chunk).await?;
        if last {
            break;
        }
    }
    let response = session.response(context_id, field::C_STORE_RQ, message_id).await?;
    Ok(Answer::Status { code: response.status, comment: response.comment })
}
