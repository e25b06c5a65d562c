//! The walk over a data set's structure, element by element, with a stack of its own.

use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::StandardDataDictionary;

use super::element::{Layout, head};
use super::input::Input;
use super::{Limits, ScanError};

const ITEM: Tag = Tag(0xFFFE, 0xE000);
const ITEM_DELIMITER: Tag = Tag(0xFFFE, 0xE00D);
const SEQUENCE_DELIMITER: Tag = Tag(0xFFFE, 0xE0DD);
const PIXEL_DATA: Tag = Tag(0x7FE0, 0x0010);

/// What the walk meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Event {
    /// An element with a plain value, not read yet: [`Walker::value`] reads it.
    Element { tag: Tag, vr: Option<[u8; 2]>, value: Span, layout: Layout },
    /// A sequence begins.
    Sequence(Tag),
    /// An item of a sequence begins.
    Item,
    /// The item is over.
    EndOfItem,
    /// The sequence is over.
    EndOfSequence,
    /// Encapsulated fragments of this element begin (PS3.5 section A.4); the first is the offset table.
    Fragments(Tag),
    /// One fragment.
    Fragment(Span),
    /// The fragments are over.
    EndOfFragments,
}

/// Where a value is: counted from the beginning of the file, or of the inflated data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Span {
    pub(crate) offset: u64,
    pub(crate) length: u64,
}

/// What is open around the position.
#[derive(Clone, Copy)]
struct Open {
    kind: Kind,
    /// Where it ends, if its length was given.
    end: Option<u64>,
    layout: Layout,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Sequence,
    Item,
    Fragments,
}

/// Goes from event to event; memory does not grow with what it walks over.
pub(crate) struct Walker<'a, I> {
    input: &'a mut I,
    layout: Layout,
    limits: &'a Limits,
    open: Vec<Open>,
    /// Bytes of the last event's value that nobody read.
    unread: u64,
    events: u64,
}

impl<'a, I: Input> Walker<'a, I> {
    /// Walks the data set that begins where `input` stands.
    pub(crate) fn new(input: &'a mut I, layout: Layout, limits: &'a Limits) -> Self {
        Self { input, layout, limits, open: Vec::new(), unread: 0, events: 0 }
    }

    /// Whether the position is in the data set itself, or just inside its fragments.
    pub(crate) fn at_top(&self) -> bool {
        self.depth() == 0
    }

    /// Sequences open around the position.
    fn depth(&self) -> usize {
        self.open.iter().filter(|open| open.kind == Kind::Sequence).count()
    }

    /// The value of the element that came last, if it has at most `max` bytes.
    pub(crate) fn value(&mut self, tag: Tag, max: usize) -> Result<Vec<u8>, ScanError> {
        let length = usize::try_from(self.unread).ok().filter(|length| *length <= max).ok_or_else(|| {
            ScanError::Malformed(format!("element {tag} holds {} bytes, more than {max}", self.unread))
        })?;
        let mut value = vec![0; length];
        self.input.fill(&mut value)?;
        self.unread = 0;
        Ok(value)
    }

    /// The next event, or `None` at the end of the data set.
    pub(crate) fn next(&mut self) -> Result<Option<Event>, ScanError> {
        let unread = std::mem::take(&mut self.unread);
        self.input.skip(unread)?;
        self.events += 1;
        if self.events > self.limits.max_elements {
            return Err(ScanError::Malformed(format!(
                "it has more than {} elements",
                self.limits.max_elements
            )));
        }
        if let Some(event) = self.close_what_ends_here()? {
            return Ok(Some(event));
        }
        let Some(&Open { kind, end, layout }) = self.open.last() else {
            return if self.input.at_end()? { Ok(None) } else { self.top_element() };
        };
        match kind {
            Kind::Item => self.element(layout).map(Some),
            Kind::Sequence => self.item(layout, end.is_some()).map(Some),
            Kind::Fragments => self.fragment(layout).map(Some),
        }
    }

    /// An element of the data set itself. Zeros up to the end of the bytes, which some archives
    /// pad files with, are no elements.
    fn top_element(&mut self) -> Result<Option<Event>, ScanError> {
        let mut start = [0; 8];
        let ready = self.input.peek(&mut start)?;
        if start[..ready].iter().all(|byte| *byte == 0) {
            self.only_zeros_follow()?;
            return Ok(None);
        }
        self.element(self.layout).map(Some)
    }

    fn only_zeros_follow(&mut self) -> Result<(), ScanError> {
        let mut chunk = [0; 512];
        while !self.input.at_end()? {
            let ready = self.input.peek(&mut chunk)?;
            if chunk[..ready].iter().any(|byte| *byte != 0) {
                return Err(ScanError::Malformed(format!(
                    "something follows the zeros at byte {} that should end it",
                    self.input.position()
                )));
            }
            self.input.skip(ready as u64)?;
        }
        Ok(())
    }

    fn close_what_ends_here(&mut self) -> Result<Option<Event>, ScanError> {
        let Some(Open { end: Some(end), .. }) = self.open.last() else { return Ok(None) };
        let position = self.input.position();
        if position < *end {
            return Ok(None);
        }
        if position > *end {
            return Err(ScanError::Malformed(format!(
                "the element that ends at byte {position} reaches beyond its sequence or item, which ends at {end}"
            )));
        }
        Ok(self.close())
    }

    fn close(&mut self) -> Option<Event> {
        self.open.pop().map(|open| match open.kind {
            Kind::Sequence => Event::EndOfSequence,
            Kind::Item => Event::EndOfItem,
            Kind::Fragments => Event::EndOfFragments,
        })
    }

    /// An element of the data set itself or of an item.
    fn element(&mut self, layout: Layout) -> Result<Event, ScanError> {
        let head = head(self.input, layout)?;
        let tag = head.tag;
        if tag == ITEM_DELIMITER && matches!(self.open.last(), Some(Open { end: None, .. })) {
            self.open.pop();
            return Ok(Event::EndOfItem);
        }
        if tag.0 == 0xFFFE {
            return Err(ScanError::Malformed(format!(
                "a delimiter {tag} stands where an element must, before byte {}",
                self.input.position()
            )));
        }
        let is_sequence = match head.vr {
            Some(vr) => &vr == b"SQ" || (&vr == b"UN" && head.length.is_none()),
            None => (head.length.is_none() && tag != PIXEL_DATA) || is_sequence(tag),
        };
        if is_sequence {
            // A UN sequence is implicit VR little endian inside (PS3.5 section 6.2.2 note 4).
            let inside = if head.vr == Some(*b"UN") { Layout::IMPLICIT } else { layout };
            self.enter(Kind::Sequence, head.length, inside)?;
            return Ok(Event::Sequence(tag));
        }
        let Some(length) = head.length else {
            let may_be_fragments = matches!(head.vr.as_ref(), Some(b"OB" | b"OW"));
            if !may_be_fragments {
                return Err(ScanError::Malformed(format!("element {tag} has no length and is no sequence")));
            }
            self.enter(Kind::Fragments, None, layout)?;
            return Ok(Event::Fragments(tag));
        };
        let value = self.span(length)?;
        Ok(Event::Element { tag, vr: head.vr, value, layout })
    }

    fn item(&mut self, layout: Layout, length_is_given: bool) -> Result<Event, ScanError> {
        let head = head(self.input, layout)?;
        match head.tag {
            ITEM => {
                self.enter(Kind::Item, head.length, layout)?;
                Ok(Event::Item)
            }
            SEQUENCE_DELIMITER if !length_is_given => {
                self.open.pop();
                Ok(Event::EndOfSequence)
            }
            tag => Err(ScanError::Malformed(format!(
                "{tag} stands in a sequence where an item must, before byte {}",
                self.input.position()
            ))),
        }
    }

    fn fragment(&mut self, layout: Layout) -> Result<Event, ScanError> {
        let head = head(self.input, layout)?;
        match (head.tag, head.length) {
            (ITEM, Some(length)) => Ok(Event::Fragment(self.span(length)?)),
            (SEQUENCE_DELIMITER, _) => {
                self.open.pop();
                Ok(Event::EndOfFragments)
            }
            (tag, _) => Err(ScanError::Malformed(format!(
                "{tag} stands among the fragments of the pixel data, before byte {}",
                self.input.position()
            ))),
        }
    }

    fn enter(&mut self, kind: Kind, length: Option<u32>, layout: Layout) -> Result<(), ScanError> {
        if kind == Kind::Sequence && self.depth() >= self.limits.max_depth {
            return Err(ScanError::Malformed(format!(
                "its sequences are nested more than {} deep",
                self.limits.max_depth
            )));
        }
        let end = match length {
            Some(length) => {
                self.check_fits(length)?;
                Some(self.input.position() + u64::from(length))
            }
            None => None,
        };
        self.open.push(Open { kind, end, layout });
        Ok(())
    }

    /// The value of `length` bytes that begins here; the next event comes after it.
    fn span(&mut self, length: u32) -> Result<Span, ScanError> {
        self.check_fits(length)?;
        self.unread = length.into();
        Ok(Span { offset: self.input.position(), length: length.into() })
    }

    /// A claimed length must fit into what is left of the file and of what is open.
    fn check_fits(&self, length: u32) -> Result<(), ScanError> {
        let position = self.input.position();
        let room = self
            .open
            .iter()
            .filter_map(|open| open.end)
            .map(|end| end.saturating_sub(position))
            .chain(self.input.left())
            .min();
        match room {
            Some(room) if u64::from(length) > room => Err(ScanError::Malformed(format!(
                "an element at byte {position} claims {length} bytes where {room} are left"
            ))),
            _ => Ok(()),
        }
    }
}

/// Whether the standard's dictionary says that this element is a sequence.
fn is_sequence(tag: Tag) -> bool {
    StandardDataDictionary.by_tag(tag).is_some_and(|entry| entry.vr().exact() == Some(VR::SQ))
}
