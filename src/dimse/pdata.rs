//! Presentation data values (PS3.8 section 9.3.5.1 and annex E): fragments of commands and data
//! sets within P-DATA-TF PDUs.

use bytes::{Buf, BufMut, Bytes};
use dicom_ul::pdu::AbortRQServiceProviderReason as Reason;

use super::connection::PDATA;
use super::fault::Fault;

/// Item length, presentation context ID, message control header.
const PDV_HEADER: u32 = 6;

/// Message control header: the fragment is of a command, not of a data set.
const COMMAND: u8 = 0x01;
/// Message control header: the last fragment.
const LAST: u8 = 0x02;

/// What a fragment is part of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// A command set.
    Command,
    /// A data set.
    DataSet,
}

/// One presentation data value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Fragment {
    /// Presentation context ID.
    pub(crate) context_id: u8,
    /// Of what.
    pub(crate) part: Part,
    /// Whether it ends its command or data set.
    pub(crate) last: bool,
    /// The bytes.
    pub(crate) data: Bytes,
}

/// Takes the first fragment off `body`, the (rest of the) body of a P-DATA-TF.
pub(crate) fn take(body: &mut Bytes) -> Result<Fragment, Fault> {
    let malformed = |detail| Fault::protocol(Reason::InvalidPduParameter, detail);
    let length =
        body.try_get_u32().map_err(|_| malformed("a P-DATA-TF ends within an item length"))? as usize;
    if length < 2 {
        return Err(malformed("a presentation data value is shorter than its header"));
    }
    if length > body.len() {
        return Err(malformed("a presentation data value is longer than its P-DATA-TF"));
    }
    let mut item = body.split_to(length);
    let context_id = item.get_u8();
    let control = item.get_u8();
    let part = if control & COMMAND == 0 { Part::DataSet } else { Part::Command };
    Ok(Fragment { context_id, part, last: control & LAST != 0, data: item })
}

/// Bytes of data that one fragment may have so that its P-DATA-TF keeps to the peer's maximum
/// length, of which 0 means none (PS3.8 section D.1).
pub(crate) fn fragment_size(peer_max_pdu_length: u32) -> usize {
    const OURS: u32 = 131_072;
    let pdu_length = if peer_max_pdu_length == 0 { OURS } else { peer_max_pdu_length.min(OURS) };
    // Even, as PS3.8 annex E.2 wants it, and never nothing, however small the peer's maximum.
    let size = pdu_length.saturating_sub(PDV_HEADER) & !1;
    size.max(2) as usize
}

/// A whole P-DATA-TF with one fragment.
pub(crate) fn encode(context_id: u8, part: Part, last: bool, data: &[u8]) -> Vec<u8> {
    // Fragments are made with `fragment_size`, far below 4 GiB.
    let item_length = 2 + data.len() as u32;
    let mut pdu = Vec::with_capacity(12 + data.len());
    pdu.put_u8(PDATA);
    pdu.put_u8(0);
    pdu.put_u32(item_length + 4);
    pdu.put_u32(item_length);
    pdu.put_u8(context_id);
    pdu.put_u8(if part == Part::Command { COMMAND } else { 0 } | if last { LAST } else { 0 });
    pdu.put_slice(data);
    pdu
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_values_of_one_pdu_come_in_order() {
        let mut body = Bytes::from_static(&[0, 0, 0, 4, 1, 3, 7, 8, 0, 0, 0, 2, 5, 0]);
        let first = take(&mut body).unwrap();
        assert_eq!((first.context_id, first.part, first.last), (1, Part::Command, true));
        assert_eq!(&first.data[..], [7, 8]);
        let second = take(&mut body).unwrap();
        assert_eq!((second.context_id, second.part, second.last), (5, Part::DataSet, false));
        assert!(second.data.is_empty() && body.is_empty());
    }

    #[test]
    fn a_value_that_claims_more_than_its_pdu_is_a_protocol_error() {
        for body in [&[0, 0, 0, 9, 1, 3][..], &[0, 0, 0, 1, 1], &[0, 0, 0], &[0xFF, 0xFF, 0xFF, 0xFF, 1, 3]] {
            let fault = take(&mut Bytes::copy_from_slice(body)).unwrap_err();
            assert!(matches!(fault, Fault::Protocol { reason: Reason::InvalidPduParameter, .. }), "{fault}");
        }
    }

    #[test]
    fn a_pdu_of_ours_keeps_to_the_peers_maximum_length() {
        for (peer, size) in [(16_384, 16_378), (0, 131_066), (128, 122), (7, 2)] {
            assert_eq!(fragment_size(peer), size);
        }
        // Type, reserved, length 6 + 3; item length 3 + 2, context, last of a command.
        assert_eq!(encode(3, Part::Command, true, &[9, 9, 9]), [4, 0, 0, 0, 0, 9, 0, 0, 0, 5, 3, 3, 9, 9, 9]);
    }
}
