//! Messages (PS3.7) over a connection: command sets and data sets, whole again from their
//! fragments; and the way back. Both our SCP and our SCU speak through it.

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use dicom_ul::pdu::{AbortRQServiceProviderReason as Reason, Pdu};

use super::command::{self, CommandSet};
use super::connection::{Connection, Received};
use super::fault::Fault;
use super::pdata::{self, Fragment, Part};
use super::stop::Stop;
use crate::crowd::{Busy, Place};

/// What can come where a message may begin.
pub(crate) enum Incoming {
    /// A command set, on this presentation context.
    Command(u8, CommandSet),
    /// A-RELEASE-RQ.
    ReleaseRequest,
    /// A-RELEASE-RP.
    ReleaseResponse,
}

/// Where in the exchange we wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Waiting {
    ForMessage,
    WithinMessage,
}

enum Next {
    Fragment(Fragment),
    ReleaseRequest,
    ReleaseResponse,
}

/// An established association's flow of messages.
pub(crate) struct Channel {
    connection: Connection,
    /// What is left of the P-DATA-TF that came last.
    rest: Bytes,
    /// Bytes of one fragment to the peer.
    fragment_size: usize,
    idle_timeout: Duration,
    stop: Stop,
    /// Our SCP's place among the associations.
    seat: Option<Seat>,
}

/// A place that others may need while nothing is asked for.
struct Seat {
    place: Place,
    /// While a message is on its way or being answered.
    busy: Option<Busy>,
}

impl Channel {
    pub(crate) fn new(
        connection: Connection,
        peer_max_pdu_length: u32,
        idle_timeout: Duration,
        stop: Stop,
    ) -> Self {
        let fragment_size = pdata::fragment_size(peer_max_pdu_length);
        Self { connection, rest: Bytes::new(), fragment_size, idle_timeout, stop, seat: None }
    }

    /// The same, with a place that it gives up for others while it waits for a message.
    pub(crate) fn seated(mut self, place: Place) -> Self {
        let busy = Some(place.member().work());
        self.connection.watch(Arc::clone(place.member()));
        self.seat = Some(Seat { place, busy });
        self
    }

    /// The next command set, or the word that there is none.
    pub(crate) async fn message(&mut self) -> Result<Incoming, Fault> {
        let mut bytes = Vec::new();
        let mut context_id = None;
        let mut waiting = Waiting::ForMessage;
        loop {
            let fragment = match self.next(waiting).await? {
                Next::Fragment(fragment) => fragment,
                Next::ReleaseRequest if waiting == Waiting::ForMessage => {
                    return Ok(Incoming::ReleaseRequest);
                }
                Next::ReleaseResponse if waiting == Waiting::ForMessage => {
                    return Ok(Incoming::ReleaseResponse);
                }
                Next::ReleaseRequest | Next::ReleaseResponse => return Err(release_within_message()),
            };
            if fragment.part != Part::Command {
                return Err(unexpected("a data set fragment came where a command was due"));
            }
            if *context_id.get_or_insert(fragment.context_id) != fragment.context_id {
                return Err(unexpected("a command changed its presentation context"));
            }
            if bytes.len() + fragment.data.len() > command::MAX_LENGTH {
                return Err(Fault::Message(format!(
                    "the command set is longer than {} bytes",
                    command::MAX_LENGTH
                )));
            }
            bytes.extend_from_slice(&fragment.data);
            if fragment.last {
                let command =
                    CommandSet::decode(&bytes).map_err(|error| Fault::Message(error.to_string()))?;
                return Ok(Incoming::Command(fragment.context_id, command));
            }
            waiting = Waiting::WithinMessage;
        }
    }

    /// The next piece of the data set that follows a command; whether it was the last.
    pub(crate) async fn data(&mut self, context_id: u8) -> Result<(Bytes, bool), Fault> {
        let Next::Fragment(fragment) = self.next(Waiting::WithinMessage).await? else {
            return Err(release_within_message());
        };
        if fragment.part != Part::DataSet {
            return Err(unexpected("a command fragment came within a data set"));
        }
        if fragment.context_id != context_id {
            return Err(unexpected("a data set changed its presentation context"));
        }
        Ok((fragment.data, fragment.last))
    }

    async fn next(&mut self, waiting: Waiting) -> Result<Next, Fault> {
        self.connection.set_within_message(waiting == Waiting::WithinMessage);
        while self.rest.is_empty() {
            if waiting == Waiting::ForMessage {
                self.wait().await?;
            }
            let stopped = match waiting {
                Waiting::ForMessage => &self.stop.soon,
                Waiting::WithinMessage => &self.stop.now,
            };
            let received = tokio::select! {
                biased;
                () = stopped.cancelled() => return Err(Fault::ShuttingDown),
                () = given_away(self.seat.as_ref()) => return Err(Fault::GaveWay),
                received = self.connection.receive(self.idle_timeout) => received?,
            };
            match received {
                Received::Data(body) => self.rest = body,
                Received::Pdu(pdu) => match *pdu {
                    Pdu::ReleaseRQ => return Ok(Next::ReleaseRequest),
                    Pdu::ReleaseRP => return Ok(Next::ReleaseResponse),
                    Pdu::AbortRQ { .. } => return Err(Fault::Aborted),
                    other => {
                        let detail = format!("{} within an association", other.short_description());
                        return Err(Fault::protocol(Reason::UnexpectedPdu, detail));
                    }
                },
            }
        }
        pdata::take(&mut self.rest).map(Next::Fragment)
    }

    /// Waits for the first byte of a message. Meanwhile the association does nothing for its peer.
    async fn wait(&mut self) -> Result<(), Fault> {
        if let Some(seat) = &mut self.seat {
            seat.busy = None;
        }
        let Self { connection, idle_timeout, stop, seat, .. } = self;
        tokio::select! {
            biased;
            () = stop.soon.cancelled() => return Err(Fault::ShuttingDown),
            () = given_away(seat.as_ref()) => return Err(Fault::GaveWay),
            begun = connection.wait(*idle_timeout) => begun?,
        }
        if let Some(seat) = &mut self.seat {
            seat.busy = Some(seat.place.member().work());
        }
        Ok(())
    }

    /// Sends a command set.
    pub(crate) async fn send_command(&mut self, context_id: u8, command: &CommandSet) -> Result<(), Fault> {
        let bytes = command.encode();
        let mut chunks = bytes.chunks(self.fragment_size).peekable();
        while let Some(chunk) = chunks.next() {
            let last = chunks.peek().is_none();
            self.connection.send_bytes(&pdata::encode(context_id, Part::Command, last, chunk)).await?;
        }
        Ok(())
    }

    /// Sends a piece of a data set, no longer than [`Channel::fragment_size`].
    pub(crate) async fn send_data(&mut self, context_id: u8, last: bool, data: &[u8]) -> Result<(), Fault> {
        self.connection.send_bytes(&pdata::encode(context_id, Part::DataSet, last, data)).await
    }

    /// The most bytes that the peer takes in one fragment.
    pub(crate) fn fragment_size(&self) -> usize {
        self.fragment_size
    }

    /// Sends a PDU that is no P-DATA-TF.
    pub(crate) async fn send(&mut self, pdu: &Pdu) -> Result<(), Fault> {
        self.connection.send(pdu).await
    }

    /// Sends the A-ABORT that the fault calls for, if any.
    pub(crate) async fn abort(&mut self, fault: &Fault) {
        self.connection.abort(fault).await;
    }

    /// Closes the connection.
    pub(crate) async fn close(self) {
        self.connection.close().await;
    }
}

/// Returns when others need the place.
async fn given_away(seat: Option<&Seat>) {
    match seat {
        Some(seat) => seat.place.closed().await,
        None => std::future::pending().await,
    }
}

fn unexpected(detail: &str) -> Fault {
    Fault::protocol(Reason::UnexpectedPduParameter, detail)
}

fn release_within_message() -> Fault {
    Fault::protocol(Reason::UnexpectedPdu, "a release came within a message")
}
