//! PDUs over TCP (PS3.8 section 9.3), bounded in size and time.
//!
//! A PDU's claimed length is checked before a byte of its body is read, and memory grows with the
//! bytes that came, never by the claim. The bodies are parsed by dicom-ul; P-DATA-TF, which carries
//! the pixels, is handed on as it is, so that nothing is copied.

use std::sync::Arc;
use std::time::Duration;

use bytes::{Bytes, BytesMut};
use dicom_ul::pdu::{AbortRQServiceProviderReason as Reason, Pdu, read_pdu, write_pdu};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::{Instant, timeout};

use super::fault::Fault;
use crate::crowd::{Member, Pace};

/// Type, reserved byte, length.
const HEADER_LENGTH: usize = 6;

/// Largest A-ASSOCIATE-RQ and -AC: 128 contexts with a hundred transfer syntaxes each.
const MAX_ASSOCIATE_LENGTH: u32 = 1_048_576;

/// Body of A-ASSOCIATE-RJ, A-RELEASE-RQ, A-RELEASE-RP and A-ABORT.
const SHORT_LENGTH: u32 = 4;

/// Bytes asked of the socket at a time.
const READ_CHUNK: usize = 65_536;

/// After the last PDU, the time in which the peer may close first, so that our PDU is not lost to
/// a TCP reset (the ARTIM timer of PS3.8).
const LINGER: Duration = Duration::from_secs(2);

/// What came.
pub(crate) enum Received {
    /// The body of a P-DATA-TF.
    Data(Bytes),
    /// Anything else.
    Pdu(Box<Pdu>),
}

/// A TCP connection that speaks PDUs.
pub(crate) struct Connection {
    stream: TcpStream,
    buffer: BytesMut,
    max_pdu_length: u32,
    write_timeout: Duration,
    /// The least rate of a message, and of a PDU that has begun.
    pace: Pace,
    min_bytes_per_second: u64,
    within_message: bool,
    /// Is told how fast the peer sends.
    member: Option<Arc<Member>>,
}

impl Connection {
    /// `max_pdu_length`: the largest P-DATA-TF body that is received.
    pub(crate) fn new(
        stream: TcpStream,
        max_pdu_length: u32,
        write_timeout: Duration,
    ) -> Result<Self, Fault> {
        // A C-STORE-RSP is one small segment; with Nagle's algorithm it waits for the peer's
        // delayed acknowledgement, some 45 ms a slice.
        stream.set_nodelay(true)?;
        Ok(Self {
            stream,
            buffer: BytesMut::new(),
            max_pdu_length,
            write_timeout,
            pace: Pace::new(0, Duration::ZERO),
            min_bytes_per_second: 0,
            within_message: false,
            member: None,
        })
    }

    /// The same, whose peer must send messages at no less than a rate; `grace` is the time that it may
    /// fall behind.
    pub(crate) fn paced(mut self, min_bytes_per_second: u64, grace: Duration) -> Self {
        self.min_bytes_per_second = min_bytes_per_second;
        self.pace = Pace::new(min_bytes_per_second, grace);
        self
    }

    /// From now on `member` is told how fast the peer sends.
    pub(crate) fn watch(&mut self, member: Arc<Member>) {
        self.member = Some(member);
    }

    /// A message may begin, after any pause, or one has begun and must keep its pace.
    pub(crate) fn set_within_message(&mut self, within: bool) {
        if !within {
            self.pace.restart();
        }
        self.within_message = within;
    }

    /// The next PDU, whole within `limit`. Cancelling it loses nothing.
    pub(crate) async fn receive(&mut self, limit: Duration) -> Result<Received, Fault> {
        timeout(limit, self.receive_untimed()).await.unwrap_or(Err(Fault::Idle(limit)))
    }

    /// Waits until a byte is there. Cancelling it loses nothing.
    pub(crate) async fn wait(&mut self, limit: Duration) -> Result<(), Fault> {
        timeout(limit, self.fill(1)).await.unwrap_or(Err(Fault::Idle(limit)))
    }

    async fn receive_untimed(&mut self) -> Result<Received, Fault> {
        self.fill(HEADER_LENGTH).await?;
        let mut header = [0; HEADER_LENGTH];
        header.copy_from_slice(&self.buffer[..HEADER_LENGTH]);
        let [pdu_type, _, length @ ..] = header;
        let length = u32::from_be_bytes(length);
        self.check_length(pdu_type, length)?;
        let whole = HEADER_LENGTH + length as usize;
        self.fill(whole).await?;
        let mut pdu = self.buffer.split_to(whole);
        let titles = if pdu_type == ASSOCIATE_RQ { take_titles(&mut pdu) } else { None };
        let pdu = pdu.freeze();
        if pdu_type == PDATA {
            return Ok(Received::Data(pdu.slice(HEADER_LENGTH..)));
        }
        match read_pdu(pdu, MAX_ASSOCIATE_LENGTH, true) {
            Ok(Some(Pdu::AssociationRQ(mut request))) => {
                if let Some((called, calling)) = titles {
                    (request.called_ae_title, request.calling_ae_title) = (called, calling);
                }
                Ok(Received::Pdu(Box::new(Pdu::AssociationRQ(request))))
            }
            Ok(Some(pdu)) => Ok(Received::Pdu(Box::new(pdu))),
            Ok(None) => Err(Fault::protocol(Reason::InvalidPduParameter, "a PDU ends within an item")),
            Err(error) => Err(Fault::protocol(Reason::InvalidPduParameter, error.to_string())),
        }
    }

    fn check_length(&self, pdu_type: u8, length: u32) -> Result<(), Fault> {
        let acceptable = match pdu_type {
            ASSOCIATE_RQ | ASSOCIATE_AC => length <= MAX_ASSOCIATE_LENGTH,
            PDATA => length <= self.max_pdu_length,
            ASSOCIATE_RJ | RELEASE_RQ | RELEASE_RP | ABORT => length == SHORT_LENGTH,
            _ => {
                let detail = format!("there is no PDU of type {pdu_type:#04x}");
                return Err(Fault::protocol(Reason::UnrecognizedPdu, detail));
            }
        };
        if acceptable {
            Ok(())
        } else {
            let detail = format!("a PDU of type {pdu_type:#04x} claims {length} bytes");
            Err(Fault::protocol(Reason::InvalidPduParameter, detail))
        }
    }

    /// Reads until the buffer holds at least `wanted` bytes.
    async fn fill(&mut self, wanted: usize) -> Result<(), Fault> {
        while self.buffer.len() < wanted {
            self.buffer.reserve((wanted - self.buffer.len()).min(READ_CHUNK));
            if self.read().await? == 0 {
                return Err(if self.buffer.is_empty() {
                    Fault::Closed
                } else {
                    Fault::Lost(std::io::ErrorKind::UnexpectedEof.into())
                });
            }
        }
        Ok(())
    }

    /// Reads what is there, and tells how fast that came.
    async fn read(&mut self) -> Result<usize, Fault> {
        if let Some(member) = &self.member {
            member.waits_for_bytes();
        }
        let bytes = self.read_paced().await?;
        if let Some(member) = &self.member {
            member.bytes_came(bytes);
        }
        Ok(bytes)
    }

    /// Reads what is there. Before a message begins the peer may pause; then it must keep its pace.
    async fn read_paced(&mut self) -> Result<usize, Fault> {
        if !self.within_message && self.buffer.is_empty() {
            return Ok(self.stream.read_buf(&mut self.buffer).await?);
        }
        let begun = Instant::now();
        let read = timeout(self.pace.left(), self.stream.read_buf(&mut self.buffer)).await;
        let bytes = read.map_err(|_| Fault::Slow(self.min_bytes_per_second))??;
        self.pace.moved(begun.elapsed(), bytes);
        Ok(bytes)
    }

    /// Sends one PDU.
    pub(crate) async fn send(&mut self, pdu: &Pdu) -> Result<(), Fault> {
        let mut bytes = Vec::new();
        write_pdu(&mut bytes, pdu).map_err(|error| Fault::Lost(std::io::Error::other(error)))?;
        self.send_bytes(&bytes).await
    }

    /// Sends one PDU that is encoded already.
    pub(crate) async fn send_bytes(&mut self, bytes: &[u8]) -> Result<(), Fault> {
        match timeout(self.write_timeout, self.stream.write_all(bytes)).await {
            Ok(written) => Ok(written?),
            Err(_) => Err(Fault::Stalled(self.write_timeout)),
        }
    }

    /// Sends the A-ABORT that the fault calls for, if any; the connection is at its end anyway.
    pub(crate) async fn abort(&mut self, fault: &Fault) {
        if let Some(source) = fault.abort() {
            // The peer may be gone: nothing more to do for it.
            let _ = self.send(&Pdu::AbortRQ { source }).await;
        }
    }

    /// Lets the peer close first, for a moment; what it still sends is thrown away.
    pub(crate) async fn close(mut self) {
        let drained = async {
            self.stream.shutdown().await?;
            let mut sink = [0; 4_096];
            while self.stream.read(&mut sink).await? > 0 {}
            std::io::Result::Ok(())
        };
        // Either way the stream is dropped now.
        let _ = timeout(LINGER, drained).await;
    }
}

/// Takes called and calling AE title out of an A-ASSOCIATE-RQ, character by character as they came:
/// dicom-ul trims every kind of white space, of which only spaces are padding (PS3.5 section 6.2).
fn take_titles(pdu: &mut BytesMut) -> Option<(String, String)> {
    let mut title = |at: usize| {
        let bytes = pdu.get_mut(at..at + 16)?;
        let text = bytes.iter().map(|byte| char::from(*byte)).collect();
        bytes.fill(b' ');
        Some(text)
    };
    // After the header, the protocol version and two reserved bytes.
    Some((title(HEADER_LENGTH + 4)?, title(HEADER_LENGTH + 20)?))
}

const ASSOCIATE_RQ: u8 = 0x01;
const ASSOCIATE_AC: u8 = 0x02;
const ASSOCIATE_RJ: u8 = 0x03;
/// PDU type of P-DATA-TF.
pub(crate) const PDATA: u8 = 0x04;
const RELEASE_RQ: u8 = 0x05;
const RELEASE_RP: u8 = 0x06;
const ABORT: u8 = 0x07;
