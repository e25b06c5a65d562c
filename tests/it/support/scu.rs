//! A scripted SCU: says over real TCP exactly what a test wants said, right or wrong, and reads the
//! answers byte by byte. Written from PS3.7 and PS3.8 alone; it shares no code with the service.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

pub(crate) const VERIFICATION: &str = "1.2.840.10008.1.1";
pub(crate) const CT: &str = "1.2.840.10008.5.1.4.1.1.2";
pub(crate) const MR: &str = "1.2.840.10008.5.1.4.1.1.4";
pub(crate) const IMPLICIT: &str = "1.2.840.10008.1.2";
pub(crate) const EXPLICIT: &str = "1.2.840.10008.1.2.1";

/// Of a command, last fragment.
pub(crate) const COMMAND: u8 = 3;
/// Of a data set, last fragment.
pub(crate) const DATA: u8 = 2;
/// Of a command, more follows.
pub(crate) const COMMAND_PART: u8 = 1;
/// Of a data set, more follows.
pub(crate) const DATA_PART: u8 = 0;

/// What an association request says.
#[derive(Clone)]
pub(crate) struct Request {
    pub(crate) protocol_version: u16,
    pub(crate) called: String,
    pub(crate) calling: String,
    pub(crate) application_context: String,
    /// ID, abstract syntax, transfer syntaxes.
    pub(crate) contexts: Vec<(u8, String, Vec<String>)>,
    pub(crate) max_pdu_length: u32,
    /// Further sub-items of the user information, whole.
    pub(crate) user_items: Vec<u8>,
}

impl Request {
    pub(crate) fn new(contexts: &[(u8, &str, &[&str])]) -> Self {
        Self {
            protocol_version: 1,
            called: "TRIPLANAR".to_owned(),
            calling: "TESTER".to_owned(),
            application_context: "1.2.840.10008.3.1.1.1".to_owned(),
            contexts: contexts
                .iter()
                .map(|(id, class, syntaxes)| {
                    (*id, (*class).to_owned(), syntaxes.iter().map(|s| (*s).to_owned()).collect())
                })
                .collect(),
            max_pdu_length: 16_384,
            user_items: Vec::new(),
        }
    }

    /// The A-ASSOCIATE-RQ (PS3.8 section 9.3.2).
    pub(crate) fn pdu(&self) -> Vec<u8> {
        let mut body = self.protocol_version.to_be_bytes().to_vec();
        body.extend([0; 2]);
        body.extend(format!("{:<16}{:<16}", self.called, self.calling).bytes());
        body.extend([0; 32]);
        body.extend(item(0x10, self.application_context.as_bytes()));
        for (id, class, syntaxes) in &self.contexts {
            let mut context = vec![*id, 0, 0, 0];
            context.extend(item(0x30, class.as_bytes()));
            for syntax in syntaxes {
                context.extend(item(0x40, syntax.as_bytes()));
            }
            body.extend(item(0x20, &context));
        }
        let mut user = item(0x51, &self.max_pdu_length.to_be_bytes());
        user.extend(item(0x52, b"1.2.3.4"));
        user.extend(&self.user_items);
        body.extend(item(0x50, &user));
        pdu(0x01, &body)
    }
}

/// An item or sub-item of an association PDU.
pub(crate) fn item(item_type: u8, value: &[u8]) -> Vec<u8> {
    let mut bytes = vec![item_type, 0];
    bytes.extend(u16::try_from(value.len()).unwrap().to_be_bytes());
    bytes.extend(value);
    bytes
}

/// A PDU.
pub(crate) fn pdu(pdu_type: u8, body: &[u8]) -> Vec<u8> {
    let mut bytes = vec![pdu_type, 0];
    bytes.extend(u32::try_from(body.len()).unwrap().to_be_bytes());
    bytes.extend(body);
    bytes
}

/// A presentation data value.
pub(crate) fn pdv(context_id: u8, control: u8, data: &[u8]) -> Vec<u8> {
    let mut bytes = u32::try_from(data.len() + 2).unwrap().to_be_bytes().to_vec();
    bytes.extend([context_id, control]);
    bytes.extend(data);
    bytes
}

/// A command set (PS3.7 annex E) of elements of group 0000, with its group length.
pub(crate) fn command(elements: &[(u16, &[u8])]) -> Vec<u8> {
    let element = |number: u16, value: &[u8]| {
        let mut bytes = vec![0, 0];
        bytes.extend(number.to_le_bytes());
        bytes.extend(u32::try_from(value.len()).unwrap().to_le_bytes());
        bytes.extend(value);
        bytes
    };
    let rest: Vec<u8> = elements.iter().flat_map(|(number, value)| element(*number, value)).collect();
    let mut bytes = element(0, &u32::try_from(rest.len()).unwrap().to_le_bytes());
    bytes.extend(rest);
    bytes
}

/// A UID's value, padded.
pub(crate) fn uid(text: &str) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    if bytes.len() % 2 == 1 {
        bytes.push(0);
    }
    bytes
}

/// A C-ECHO-RQ.
pub(crate) fn c_echo(message_id: u16) -> Vec<u8> {
    command(&[
        (0x0002, &uid(VERIFICATION)),
        (0x0100, &[0x30, 0]),
        (0x0110, &message_id.to_le_bytes()),
        (0x0800, &[1, 1]),
    ])
}

/// A C-STORE-RQ.
pub(crate) fn c_store(message_id: u16, class: &str, instance: &str) -> Vec<u8> {
    command(&[
        (0x0002, &uid(class)),
        (0x0100, &[1, 0]),
        (0x0110, &message_id.to_le_bytes()),
        (0x0700, &[0, 0]),
        (0x0800, &[0, 0]),
        (0x1000, &uid(instance)),
    ])
}

/// A response's command set.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Response {
    pub(crate) context_id: u8,
    elements: BTreeMap<u16, Vec<u8>>,
    /// P-DATA-TF PDUs that it took.
    pub(crate) pdus: usize,
}

impl Response {
    pub(crate) fn number(&self, element: u16) -> u16 {
        let value = self.elements.get(&element).unwrap_or_else(|| panic!("no (0000,{element:04X})"));
        u16::from_le_bytes(value.as_slice().try_into().unwrap())
    }

    pub(crate) fn text(&self, element: u16) -> Option<String> {
        let value = self.elements.get(&element)?;
        assert_eq!(value.len() % 2, 0, "(0000,{element:04X}) has an odd length");
        Some(String::from_utf8(value.clone()).unwrap().trim_end_matches(['\0', ' ']).to_owned())
    }

    pub(crate) fn status(&self) -> u16 {
        self.number(0x0900)
    }

    pub(crate) fn comment(&self) -> String {
        self.text(0x0902).unwrap_or_default()
    }
}

/// One connection.
pub(crate) struct Scu {
    pub(crate) stream: TcpStream,
}

impl Scu {
    pub(crate) fn connect(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_nodelay(true).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        Self { stream }
    }

    /// Connects and associates; all must go well.
    pub(crate) fn associate(address: SocketAddr, request: &Request) -> Self {
        let mut scu = Self::connect(address);
        scu.send(&request.pdu());
        let (pdu_type, _) = scu.receive().expect("an answer to the association request");
        assert_eq!(pdu_type, 0x02, "the association is accepted");
        scu
    }

    pub(crate) fn send(&mut self, bytes: &[u8]) {
        self.stream.write_all(bytes).unwrap();
    }

    /// One P-DATA-TF with these presentation data values.
    pub(crate) fn send_pdvs(&mut self, pdvs: &[Vec<u8>]) {
        self.send(&pdu(0x04, &pdvs.concat()));
    }

    /// The next PDU, type and body; nothing at the connection's end.
    pub(crate) fn receive(&mut self) -> Option<(u8, Vec<u8>)> {
        let mut header = [0; 6];
        match self.stream.read_exact(&mut header) {
            Ok(()) => {}
            Err(e) if matches!(e.kind(), ErrorKind::UnexpectedEof | ErrorKind::ConnectionReset) => {
                return None;
            }
            Err(e) => panic!("no PDU came: {e}"),
        }
        let [pdu_type, reserved, a, b, c, d] = header;
        assert_eq!(reserved, 0);
        let mut body = vec![0; u32::from_be_bytes([a, b, c, d]) as usize];
        self.stream.read_exact(&mut body).unwrap();
        Some((pdu_type, body))
    }

    /// The next response, put together from its fragments.
    pub(crate) fn response(&mut self) -> Response {
        let (mut bytes, mut pdus) = (Vec::new(), 0);
        loop {
            let (pdu_type, body) = self.receive().expect("a response");
            assert_eq!(pdu_type, 0x04, "a response is P-DATA-TF, this is {body:02X?}");
            pdus += 1;
            let length = u32::from_be_bytes(body[..4].try_into().unwrap()) as usize;
            assert_eq!(length + 4, body.len(), "one presentation data value a PDU");
            bytes.extend(&body[6..]);
            assert_eq!(body[5] & 1, 1, "a response has no data set here");
            if body[5] & 2 != 0 {
                return Response { context_id: body[4], elements: parse(&bytes), pdus };
            }
        }
    }

    /// Asserts that the connection ends with A-ABORT of this source and reason (PS3.8 9.3.8).
    pub(crate) fn expect_abort(&mut self, source: u8, reason: u8) {
        assert_eq!(self.receive(), Some((0x07, vec![0, 0, source, reason])), "A-ABORT");
        assert_eq!(self.receive(), None, "the connection is closed after an abort");
    }

    /// Asserts A-ASSOCIATE-RJ (PS3.8 section 9.3.4).
    pub(crate) fn expect_rejection(&mut self, result: u8, source: u8, reason: u8) {
        assert_eq!(self.receive(), Some((0x03, vec![0, result, source, reason])), "A-ASSOCIATE-RJ");
        assert_eq!(self.receive(), None, "the connection is closed after a rejection");
    }

    /// C-ECHO on this context must go through: the association is alive and in step.
    pub(crate) fn expect_echo(&mut self, context_id: u8, message_id: u16) {
        self.send_pdvs(&[pdv(context_id, COMMAND, &c_echo(message_id))]);
        let response = self.response();
        assert_eq!(
            (response.context_id, response.number(0x0100), response.number(0x0120), response.status()),
            (context_id, 0x8030, message_id, 0)
        );
    }

    /// Sends an instance, its data set in fragments of `fragment` bytes, a PDU each.
    pub(crate) fn store(
        &mut self,
        context_id: u8,
        message_id: u16,
        instance: &str,
        data: &[u8],
        fragment: usize,
    ) {
        self.send_pdvs(&[pdv(context_id, COMMAND, &c_store(message_id, CT, instance))]);
        let mut chunks = data.chunks(fragment).peekable();
        while let Some(chunk) = chunks.next() {
            let control = if chunks.peek().is_none() { DATA } else { DATA_PART };
            self.send_pdvs(&[pdv(context_id, control, chunk)]);
        }
    }

    /// Releases; all must go well.
    pub(crate) fn release(mut self) {
        self.send(&pdu(0x05, &[0; 4]));
        assert_eq!(self.receive(), Some((0x06, vec![0; 4])), "A-RELEASE-RP");
    }
}

fn parse(mut bytes: &[u8]) -> BTreeMap<u16, Vec<u8>> {
    let whole = bytes.len();
    let mut elements = BTreeMap::new();
    let mut last = None;
    while !bytes.is_empty() {
        assert_eq!(bytes[..2], [0, 0], "group 0000");
        let number = u16::from_le_bytes([bytes[2], bytes[3]]);
        let length = u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
        assert!(last < Some(number), "elements stand in ascending order");
        last = Some(number);
        elements.insert(number, bytes[8..8 + length].to_vec());
        bytes = &bytes[8 + length..];
    }
    let group_length = u32::from_le_bytes(elements[&0].as_slice().try_into().unwrap()) as usize;
    assert_eq!(group_length + 12, whole, "the group length is right");
    elements
}

/// A CT slice as a data set in explicit VR little endian, 16 × 16 pixels of the given value.
pub(crate) fn ct_slice(series: &str, instance: &str, index: u16, value: i16) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut put = |group: u16, element: u16, vr: &[u8; 2], value: &[u8]| {
        bytes.extend(group.to_le_bytes());
        bytes.extend(element.to_le_bytes());
        bytes.extend(vr);
        let odd = value.len() % 2;
        let length = value.len() + odd;
        if vr == b"OW" {
            bytes.extend([0, 0]);
            bytes.extend(u32::try_from(length).unwrap().to_le_bytes());
        } else {
            bytes.extend(u16::try_from(length).unwrap().to_le_bytes());
        }
        bytes.extend(value);
        bytes.resize(bytes.len() + odd, if vr == b"UI" { 0 } else { b' ' });
    };
    put(0x0008, 0x0008, b"CS", br"ORIGINAL\PRIMARY\AXIAL");
    put(0x0008, 0x0016, b"UI", CT.as_bytes());
    put(0x0008, 0x0018, b"UI", instance.as_bytes());
    put(0x0008, 0x0060, b"CS", b"CT");
    put(0x0010, 0x0010, b"PN", b"SECRET^NAME");
    put(0x0010, 0x0020, b"LO", b"SECRET-ID");
    put(0x0020, 0x000D, b"UI", b"1.2.826.0.1.3680043.10.9999.1");
    put(0x0020, 0x000E, b"UI", series.as_bytes());
    put(0x0020, 0x0032, b"DS", format!(r"0\0\{index}").as_bytes());
    put(0x0020, 0x0037, b"DS", br"1\0\0\0\1\0");
    put(0x0020, 0x0052, b"UI", b"1.2.826.0.1.3680043.10.9999.2");
    put(0x0028, 0x0002, b"US", &1_u16.to_le_bytes());
    put(0x0028, 0x0004, b"CS", b"MONOCHROME2");
    put(0x0028, 0x0010, b"US", &16_u16.to_le_bytes());
    put(0x0028, 0x0011, b"US", &16_u16.to_le_bytes());
    put(0x0028, 0x0030, b"DS", br"1\1");
    put(0x0028, 0x0100, b"US", &16_u16.to_le_bytes());
    put(0x0028, 0x0101, b"US", &16_u16.to_le_bytes());
    put(0x0028, 0x0102, b"US", &15_u16.to_le_bytes());
    put(0x0028, 0x0103, b"US", &1_u16.to_le_bytes());
    put(0x0028, 0x1052, b"DS", b"0");
    put(0x0028, 0x1053, b"DS", b"1");
    put(0x7FE0, 0x0010, b"OW", &value.to_le_bytes().repeat(256));
    bytes
}
