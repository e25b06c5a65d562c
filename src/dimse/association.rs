//! One association that a peer opened: request, answer, messages, end.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use dicom_ul::pdu::{AbortRQServiceProviderReason as Reason, AbortRQSource, AssociationRQ, Pdu};
use futures_util::FutureExt;
use tokio::net::TcpStream;
use uuid::Uuid;

use super::channel::{Channel, Incoming};
use super::command::{CommandSet, NO_DATA_SET, RESPONSE, element};
use super::connection::{Connection, Received};
use super::fault::Fault;
use super::missing::Missing;
use super::negotiation::{self, Accepted, Context};
use super::rejection::Rejection;
use super::server::Shared;
use super::services::{self, Request};
use super::status::{Refusal, SUCCESS};
use super::stop::Stop;
use super::tally::{RefusedContexts, Tally, reason_name};
use crate::crowd::{Peer, Place};
use crate::intake::{Intake, Receipt, Sender};
use crate::store::SenderEnd;
use crate::telemetry::Metrics;

/// Bytes of refused data sets that one message may still send; a sender of more is cut off.
const MAX_DISCARDED: u64 = 4_294_967_296;

/// Serves one connection to its end.
pub(crate) async fn serve(
    stream: TcpStream,
    peer: SocketAddr,
    place: Place,
    shared: Arc<Shared>,
    stop: Stop,
) {
    let begun = tokio::select! {
        biased;
        begun = begin(stream, peer, place.patience(), &shared, &stop) => begun,
        // Nothing was promised to a peer that said nothing: the connection is closed without a word
        // (PS3.8 table 9-10, action AA-2).
        () = place.closed() => {
            let fault = Fault::Crowded;
            shared.metrics.association_failed(fault.code());
            tracing::debug!(%peer, code = fault.code(), %fault, "no association request");
            return;
        }
    };
    // From here on the association's own place counts.
    drop(place);
    if let Some((connection, accepted, seat)) = begun {
        established(connection, peer, accepted, seat, shared, stop).await;
    }
}

/// From the connection to an accepted association; `None` if it was rejected and closed.
async fn begin(
    stream: TcpStream,
    peer: SocketAddr,
    patience: Duration,
    shared: &Shared,
    stop: &Stop,
) -> Option<(Connection, Accepted, Place)> {
    let config = &shared.config;
    let mut connection = match Connection::new(stream, config.max_pdu_length, config.write_timeout) {
        Ok(connection) => connection.paced(config.min_bytes_per_second, config.rate_grace),
        Err(fault) => {
            tracing::debug!(%peer, %fault, "no connection");
            return None;
        }
    };
    let request = match request(&mut connection, patience, stop).await {
        Ok(request) => request,
        Err(fault) => {
            shared.metrics.association_failed(fault.code());
            tracing::info!(%peer, code = fault.code(), %fault, "no association request");
            // Before there is an association every abort is the service user's (PS3.8 table
            // 9-10, action AA-1); a connection on which nothing came is closed without a word
            // (AA-2).
            if matches!(fault, Fault::Protocol { .. }) {
                // The peer may be gone: nothing more to do for it.
                let _ = connection.send(&Pdu::AbortRQ { source: AbortRQSource::ServiceUser }).await;
            }
            connection.close().await;
            return None;
        }
    };
    let (calling, called) = (request.calling_ae_title.clone(), request.called_ae_title.clone());
    let answer = negotiation::negotiate(request, config).and_then(|accepted| {
        let seat = shared.associations.admit(Peer::from(peer.ip()), false).map_err(|limit| {
            tracing::warn!(%peer, limit = limit.0, "too many associations");
            Rejection::Limit
        })?;
        Ok((accepted, seat))
    });
    match answer {
        Ok((accepted, seat)) => Some((connection, accepted, seat)),
        Err(rejection) => {
            shared.metrics.association_rejected(rejection.code());
            tracing::warn!(%peer, calling, called, code = rejection.code(), "association rejected");
            // The peer may be gone: nothing more to do for it.
            let _ = connection.send(&Pdu::AssociationRJ(rejection.pdu())).await;
            connection.close().await;
            None
        }
    }
}

/// The association request, whatever else comes first.
async fn request(
    connection: &mut Connection,
    patience: Duration,
    stop: &Stop,
) -> Result<AssociationRQ, Fault> {
    let received = tokio::select! {
        biased;
        () = stop.soon.cancelled() => return Err(Fault::ShuttingDown),
        received = connection.receive(patience) => received?,
    };
    let Received::Pdu(pdu) = received else {
        return Err(Fault::protocol(Reason::UnexpectedPdu, "data without an association"));
    };
    match *pdu {
        Pdu::AssociationRQ(request) => Ok(request),
        Pdu::AbortRQ { .. } => Err(Fault::Aborted),
        other => {
            let detail = format!("{} without an association", other.short_description());
            Err(Fault::protocol(Reason::UnexpectedPdu, detail))
        }
    }
}

async fn established(
    mut connection: Connection,
    peer: SocketAddr,
    accepted: Accepted,
    seat: Place,
    shared: Arc<Shared>,
    stop: Stop,
) {
    let id = Uuid::now_v7();
    let calling = accepted.calling_ae_title.clone();
    shared.intake.sender_begins(id);
    told_contexts(id, peer, &accepted, &shared.metrics);
    shared.metrics.association_opened();
    let sent = connection.send(&Pdu::AssociationAC(accepted.answer)).await;
    let idle_timeout = shared.config.idle_timeout;
    let channel = Channel::new(connection, accepted.peer_max_pdu_length, idle_timeout, stop).seated(seat);
    let mut association = Association {
        id,
        calling_ae_title: accepted.calling_ae_title,
        contexts: accepted.contexts,
        channel,
        discarded: 0,
        tally: Tally::default(),
        missing: Missing::default(),
        shared: Arc::clone(&shared),
    };
    let messages = async {
        sent?;
        association.messages().await
    };
    // A defect of ours must not keep the association's end from the intake.
    let outcome = AssertUnwindSafe(messages).catch_unwind().await;
    if !matches!(outcome, Ok(Ok(()))) {
        shared.intake.sender_breaks(id);
    }
    let word = match &outcome {
        Ok(Ok(())) => "released",
        Ok(Err(fault)) => {
            shared.metrics.association_failed(fault.code());
            tracing::warn!(association = %id, calling, code = fault.code(), %fault, "not released");
            association.channel.abort(fault).await;
            fault.end()
        }
        Err(_panic) => {
            shared.metrics.association_failed("internal");
            tracing::error!(association = %id, calling, "association ended by a defect; please report it");
            association.channel.abort(&Fault::Message("defect".to_owned())).await;
            "aborted"
        }
    };
    shared.metrics.association_ended(word);
    let Tally { stored, duplicate, .. } = association.tally;
    let (refused, by_status) = (association.tally.refusals(), association.tally.by_status());
    tracing::info!(association = %id, calling, end = word, stored, duplicate, refused, by_status, "association ended");
    let end = association.end(outcome.as_ref().ok());
    for instance in association.missing.instances() {
        shared.intake.lacks(id, Some(instance));
    }
    if let Err(error) = shared.intake.sender_ended(id, end).await {
        // The quiet time completes its series all the same.
        tracing::error!(association = %id, %error, "the association's end was not recorded");
    }
    shared.metrics.association_closed();
    association.channel.close().await;
}

/// Tells and counts what was offered: a sender whose contexts are refused sends nothing, and says no
/// word of it.
fn told_contexts(id: Uuid, peer: SocketAddr, accepted: &Accepted, metrics: &Metrics) {
    let calling = accepted.calling_ae_title.as_str();
    for result in &accepted.answer.presentation_contexts {
        metrics.presentation_context(reason_name(&result.reason));
    }
    let (taken, refused) = (accepted.contexts.len(), accepted.refused.len());
    tracing::info!(association = %id, %peer, calling, offered = taken + refused, accepted = taken, "association");
    if refused == 0 {
        return;
    }
    let contexts = RefusedContexts(&accepted.refused);
    if taken == 0 {
        tracing::warn!(association = %id, calling, refused, %contexts, "every presentation context is refused");
    } else {
        tracing::info!(association = %id, calling, refused, %contexts, "presentation contexts are refused");
    }
}

/// An open association, as the services see it.
pub(crate) struct Association {
    id: Uuid,
    calling_ae_title: String,
    contexts: BTreeMap<u8, Context>,
    channel: Channel,
    /// Bytes that were thrown away of the message at hand.
    discarded: u64,
    tally: Tally,
    /// Instances that were refused for want of room and have not come again.
    missing: Missing,
    shared: Arc<Shared>,
}

impl Association {
    /// Request by request until the release.
    async fn messages(&mut self) -> Result<(), Fault> {
        loop {
            let (context_id, command) = match self.channel.message().await? {
                Incoming::Command(context_id, command) => (context_id, command),
                Incoming::ReleaseRequest => return self.channel.send(&Pdu::ReleaseRP).await,
                Incoming::ReleaseResponse => {
                    let detail = "a release was confirmed that nobody asked for";
                    return Err(Fault::protocol(Reason::UnexpectedPdu, detail));
                }
            };
            let Some(context) = self.contexts.get(&context_id) else {
                let detail = format!("presentation context {context_id} was not accepted");
                return Err(Fault::protocol(Reason::InvalidPduParameter, detail));
            };
            let request = Request::new(context.clone(), command)?;
            if request.field & RESPONSE != 0 {
                return Err(Fault::Message(format!("response {:04X} to nothing", request.field)));
            }
            self.discarded = 0;
            services::perform(&request, self).await?;
        }
    }

    /// How it ended, for the intake; `None` if by a defect of ours.
    fn end(&self, outcome: Option<&Result<(), Fault>>) -> SenderEnd {
        match outcome {
            Some(Ok(())) if self.missing.any() => SenderEnd::InstancesRefused,
            Some(Ok(())) => SenderEnd::AssociationReleased,
            Some(Err(Fault::ShuttingDown)) => SenderEnd::ServiceStopped,
            Some(Err(Fault::Closed | Fault::Lost(_))) => SenderEnd::AssociationLost,
            Some(Err(_)) | None => SenderEnd::AssociationAborted,
        }
    }

    /// Its id, for the log and the intake.
    pub(crate) fn id(&self) -> Uuid {
        self.id
    }

    /// Who sends, for the intake.
    pub(crate) fn sender(&self) -> Sender {
        Sender::Association { id: self.id, calling_ae_title: self.calling_ae_title.clone() }
    }

    /// Where instances go.
    pub(crate) fn intake(&self) -> &Intake {
        &self.shared.intake
    }

    /// What is counted.
    pub(crate) fn metrics(&self) -> &Metrics {
        &self.shared.metrics
    }

    /// Counts an instance that was taken.
    pub(crate) fn count_taken(&mut self, receipt: &Receipt) {
        if receipt.duplicate {
            self.tally.duplicate += 1;
        } else {
            self.tally.stored += 1;
        }
    }

    /// The next piece of the request's data set; whether it was the last.
    pub(crate) async fn data(&mut self, request: &Request) -> Result<(Bytes, bool), Fault> {
        self.channel.data(request.context.id).await
    }

    /// Receives the request's data set, if there is one, and forgets it.
    pub(crate) async fn discard_data_set(&mut self, request: &Request) -> Result<(), Fault> {
        let mut last = !request.has_data_set;
        while !last {
            let data;
            (data, last) = self.data(request).await?;
            self.count_discarded(data.len())?;
        }
        Ok(())
    }

    /// Counts bytes of a data set that is refused anyway, and ends the association of a peer that
    /// does not come to an end.
    pub(crate) fn count_discarded(&mut self, bytes: usize) -> Result<(), Fault> {
        self.discarded += bytes as u64;
        if self.discarded > MAX_DISCARDED {
            return Err(Fault::Message(format!("more than {MAX_DISCARDED} bytes of a refused data set")));
        }
        Ok(())
    }

    /// Answers the request: success, or the refusal with its status and comment.
    pub(crate) async fn answer(
        &mut self,
        request: &Request,
        outcome: Result<(), &Refusal>,
    ) -> Result<(), Fault> {
        let status = outcome.map_or_else(|refusal| refusal.status, |()| SUCCESS);
        if outcome.is_err() {
            self.tally.refused(status);
        }
        if let Some(instance) = request.command.text(element::AFFECTED_SOP_INSTANCE_UID) {
            self.missing.note(instance, status);
        }
        let mut response = CommandSet::default()
            .with_number(element::COMMAND_FIELD, request.field | RESPONSE)
            .with_number(element::MESSAGE_ID_BEING_RESPONDED_TO, request.message_id)
            .with_number(element::COMMAND_DATA_SET_TYPE, NO_DATA_SET)
            .with_number(element::STATUS, status);
        for uid in [element::AFFECTED_SOP_CLASS_UID, element::AFFECTED_SOP_INSTANCE_UID] {
            if let Some(text) = request.command.text(uid) {
                response = response.with_uid(uid, text);
            }
        }
        if let Err(refusal) = outcome {
            response = response.with_text(element::ERROR_COMMENT, &refusal.comment);
        }
        self.channel.send_command(request.context.id, &response).await
    }
}
