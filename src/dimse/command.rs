//! Command sets (PS3.7 section 6.3.1 and annex E): implicit VR little endian, group 0000 alone.

use std::collections::BTreeMap;

/// Largest command set that is read; real ones have some 200 bytes.
pub(crate) const MAX_LENGTH: usize = 65_536;

/// Command Data Set Type that says "no data set follows".
pub(crate) const NO_DATA_SET: u16 = 0x0101;

/// Bit of the Command Field that tells a response.
pub(crate) const RESPONSE: u16 = 0x8000;

/// Element numbers within group 0000.
pub(crate) mod element {
    pub(crate) const AFFECTED_SOP_CLASS_UID: u16 = 0x0002;
    pub(crate) const COMMAND_FIELD: u16 = 0x0100;
    pub(crate) const MESSAGE_ID: u16 = 0x0110;
    pub(crate) const MESSAGE_ID_BEING_RESPONDED_TO: u16 = 0x0120;
    pub(crate) const PRIORITY: u16 = 0x0700;
    pub(crate) const COMMAND_DATA_SET_TYPE: u16 = 0x0800;
    pub(crate) const STATUS: u16 = 0x0900;
    pub(crate) const ERROR_COMMENT: u16 = 0x0902;
    pub(crate) const AFFECTED_SOP_INSTANCE_UID: u16 = 0x1000;
}

/// Values of the Command Field.
pub(crate) mod field {
    pub(crate) const C_STORE_RQ: u16 = 0x0001;
    pub(crate) const C_ECHO_RQ: u16 = 0x0030;
    pub(crate) const C_CANCEL_RQ: u16 = 0x0FFF;
}

/// Bytes that are no command set.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum CommandError {
    #[error("the command set ends within an element")]
    Truncated,
    #[error("the command set holds an element of group {0:04X}")]
    ForeignGroup(u16),
    #[error("the command set holds element (0000,{0:04X}) twice")]
    Repeated(u16),
    #[error("element (0000,{0:04X}) is missing or not a number of two bytes")]
    NotANumber(u16),
}

/// The elements of a command set by element number.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct CommandSet(BTreeMap<u16, Vec<u8>>);

impl CommandSet {
    /// Reads a whole command set.
    pub(crate) fn decode(mut bytes: &[u8]) -> Result<Self, CommandError> {
        let mut elements = BTreeMap::new();
        while !bytes.is_empty() {
            let ([g0, g1, e0, e1, l0, l1, l2, l3], rest) =
                bytes.split_first_chunk().ok_or(CommandError::Truncated)?;
            let group = u16::from_le_bytes([*g0, *g1]);
            if group != 0 {
                return Err(CommandError::ForeignGroup(group));
            }
            let element = u16::from_le_bytes([*e0, *e1]);
            let length = u32::from_le_bytes([*l0, *l1, *l2, *l3]) as usize;
            let (value, rest) = rest.split_at_checked(length).ok_or(CommandError::Truncated)?;
            if elements.insert(element, value.to_vec()).is_some() {
                return Err(CommandError::Repeated(element));
            }
            bytes = rest;
        }
        Ok(Self(elements))
    }

    /// Its bytes, with Command Group Length in front.
    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut elements = Vec::new();
        for (element, value) in &self.0 {
            put(&mut elements, *element, value);
        }
        // Command sets of ours have some hundred bytes.
        let group_length = elements.len() as u32;
        let mut bytes = Vec::with_capacity(12 + elements.len());
        put(&mut bytes, 0, &group_length.to_le_bytes());
        bytes.extend(elements);
        bytes
    }

    /// A number (US).
    pub(crate) fn number(&self, element: u16) -> Result<u16, CommandError> {
        let value = self.0.get(&element).and_then(|value| <[u8; 2]>::try_from(value.as_slice()).ok());
        value.map(u16::from_le_bytes).ok_or(CommandError::NotANumber(element))
    }

    /// A text without its padding; nothing where it is absent, empty or not ASCII.
    pub(crate) fn text(&self, element: u16) -> Option<&str> {
        let text = std::str::from_utf8(self.0.get(&element)?).ok()?.trim_matches(['\0', ' ']);
        (text.is_ascii() && !text.is_empty()).then_some(text)
    }

    /// With a number.
    #[must_use]
    pub(crate) fn with_number(mut self, element: u16, value: u16) -> Self {
        self.0.insert(element, value.to_le_bytes().to_vec());
        self
    }

    /// With a UID.
    #[must_use]
    pub(crate) fn with_uid(self, element: u16, uid: &str) -> Self {
        self.with_padded(element, uid, b'\0')
    }

    /// With a text.
    #[must_use]
    pub(crate) fn with_text(self, element: u16, text: &str) -> Self {
        self.with_padded(element, text, b' ')
    }

    fn with_padded(mut self, element: u16, text: &str, padding: u8) -> Self {
        let mut value = text.as_bytes().to_vec();
        if value.len() % 2 == 1 {
            value.push(padding);
        }
        self.0.insert(element, value);
        self
    }
}

fn put(bytes: &mut Vec<u8>, element: u16, value: &[u8]) {
    bytes.extend([0, 0]);
    bytes.extend(element.to_le_bytes());
    bytes.extend((value.len() as u32).to_le_bytes());
    bytes.extend(value);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A C-ECHO-RQ as DCMTK's echoscu sends it.
    const ECHO: &[u8] = b"\0\0\0\0\x04\0\0\0\x38\0\0\0\
        \0\0\x02\0\x12\0\0\x001.2.840.10008.1.1\0\
        \0\0\0\x01\x02\0\0\0\x30\0\
        \0\0\x10\x01\x02\0\0\0\x01\0\
        \0\0\0\x08\x02\0\0\0\x01\x01";

    #[test]
    fn an_echo_request_reads_and_writes_the_same_bytes() {
        let mut set = CommandSet::decode(ECHO).unwrap();
        assert_eq!(set.number(element::COMMAND_FIELD), Ok(field::C_ECHO_RQ));
        assert_eq!(set.number(element::MESSAGE_ID), Ok(1));
        assert_eq!(set.text(element::AFFECTED_SOP_CLASS_UID), Some("1.2.840.10008.1.1"));
        set.0.remove(&0);
        assert_eq!(set.encode(), ECHO);
    }

    #[test]
    fn lengths_beyond_the_end_foreign_groups_and_repetitions_are_errors() {
        let claims_4_gib = b"\0\0\0\x01\xFF\xFF\xFF\xFF\x30\0";
        assert_eq!(CommandSet::decode(claims_4_gib), Err(CommandError::Truncated));
        assert_eq!(CommandSet::decode(&ECHO[..ECHO.len() - 1]), Err(CommandError::Truncated));
        assert_eq!(CommandSet::decode(b"\x08\0\x18\0\0\0\0\0"), Err(CommandError::ForeignGroup(8)));
        let twice = b"\0\0\0\x01\x02\0\0\0\x30\0\0\0\0\x01\x02\0\0\0\x30\0";
        assert_eq!(CommandSet::decode(twice), Err(CommandError::Repeated(0x0100)));
        let wide = CommandSet::decode(b"\0\0\0\x01\x04\0\0\0\x30\0\0\0").unwrap();
        assert_eq!(wide.number(0x0100), Err(CommandError::NotANumber(0x0100)));
    }
}
