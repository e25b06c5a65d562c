//! The walk over a data set's structure, element by element, with a stack of its own.

use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::{Tag, VR};
use dicom_dictionary_std::{StandardDataDictionary, tags};

use super::element::{Around, Head, Layout, head};
use super::input::Input;
use super::{Limits, ScanError};

const ITEM: Tag = Tag(0xFFFE, 0xE000);
const ITEM_DELIMITER: Tag = Tag(0xFFFE, 0xE00D);
const SEQUENCE_DELIMITER: Tag = Tag(0xFFFE, 0xE0DD);
const PIXEL_DATA: Tag = Tag(0x7FE0, 0x0010);

/// The sequences that somebody reads, each inside of one that is read: the functional groups of a CT.
/// All others are passed over.
pub(crate) const READ: [Tag; 8] = [
    tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE,
    tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE,
    tags::PIXEL_MEASURES_SEQUENCE,
    tags::PLANE_POSITION_SEQUENCE,
    tags::PLANE_ORIENTATION_SEQUENCE,
    tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE,
    tags::FRAME_CONTENT_SEQUENCE,
    tags::CT_IMAGE_FRAME_TYPE_SEQUENCE,
];

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
    /// Somebody reads what is in it.
    is_read: bool,
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
    /// What the last event closed had a length of its own.
    closed_by_length: bool,
    /// A limit was passed: that is never passed over.
    is_beyond_limit: bool,
    is_odd: bool,
}

impl<'a, I: Input> Walker<'a, I> {
    /// Walks the data set that begins where `input` stands.
    pub(crate) fn new(input: &'a mut I, layout: Layout, limits: &'a Limits) -> Self {
        Self {
            input,
            layout,
            limits,
            open: Vec::new(),
            unread: 0,
            events: 0,
            closed_by_length: false,
            is_beyond_limit: false,
            is_odd: false,
        }
    }

    /// Whether something that nobody reads was passed over although it is not written as it should.
    pub(crate) fn is_odd(&self) -> bool {
        self.is_odd
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

    /// Whether the last `count` bytes of the value that came last are zeros.
    pub(crate) fn value_ends_in_zeros(&mut self, count: u64) -> Result<bool, ScanError> {
        let unread = std::mem::take(&mut self.unread);
        let mut left = count.min(unread);
        self.input.skip(unread - left)?;
        let mut chunk = [0; 512];
        while left > 0 {
            let part = &mut chunk[..usize::try_from(left).map_or(512, |left| left.min(512))];
            self.input.fill(part)?;
            left -= part.len() as u64;
            if part.iter().any(|byte| *byte != 0) {
                self.unread = left;
                return Ok(false);
            }
        }
        Ok(true)
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
        match self.step() {
            Err(ScanError::Malformed(detail)) => {
                let Some(end) = self.way_out() else { return Err(ScanError::Malformed(detail)) };
                self.leave(end)?;
                self.close_what_ends_here()
            }
            step => step,
        }
    }

    fn step(&mut self) -> Result<Option<Event>, ScanError> {
        if let Some(event) = self.close_what_ends_here()? {
            return Ok(Some(event));
        }
        let Some(&Open { kind, end, layout, .. }) = self.open.last() else {
            return if self.input.at_end()? { Ok(None) } else { self.top_element() };
        };
        match kind {
            Kind::Item => self.element(layout),
            Kind::Sequence => self.item(layout, end.is_some()),
            Kind::Fragments => self.fragment(layout).map(Some),
        }
    }

    /// The end of the outermost thing around the position that nobody reads and whose length was
    /// given: whatever is wrong inside of it, the walk can go on behind it.
    fn way_out(&self) -> Option<u64> {
        let passage = self.open.iter().find(|open| !open.is_read && open.end.is_some())?;
        passage.end.filter(|end| !self.is_beyond_limit && self.input.position() <= *end)
    }

    /// Goes to that end; all that ends there is closed by the events to come.
    fn leave(&mut self, end: u64) -> Result<(), ScanError> {
        self.is_odd = true;
        self.unread = 0;
        self.input.skip(end - self.input.position())?;
        let passage = self.open.iter().position(|open| !open.is_read && open.end == Some(end));
        for open in self.open.iter_mut().skip(passage.unwrap_or_default()) {
            open.end = Some(end);
        }
        Ok(())
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
        self.element(self.layout)
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
        let open = self.open.pop()?;
        self.closed_by_length = open.end.is_some();
        Some(match open.kind {
            Kind::Sequence => Event::EndOfSequence,
            Kind::Item => Event::EndOfItem,
            Kind::Fragments => Event::EndOfFragments,
        })
    }

    /// The head that stands next. A delimiter behind something whose length was given (it needs none,
    /// some writers add one) is passed over. `None` if the data set ends with such a one.
    fn head(&mut self, layout: Layout) -> Result<Option<Head>, ScanError> {
        let mut closed_by_length = std::mem::take(&mut self.closed_by_length);
        loop {
            let last = self.open.last();
            let around = Around {
                open: self.room_in_open(),
                room: self.room(),
                is_inside: last.is_some(),
                is_passage: last.is_some_and(|open| !open.is_read),
            };
            let head = head(self.input, layout, around)?;
            self.is_odd |= head.is_odd;
            let ends_what_is_open = match last.map(|open| (open.kind, open.end)) {
                Some((Kind::Item, None)) => head.tag == ITEM_DELIMITER,
                Some((Kind::Sequence, None)) => head.tag == SEQUENCE_DELIMITER,
                _ => false,
            };
            let is_delimiter = [ITEM_DELIMITER, SEQUENCE_DELIMITER].contains(&head.tag);
            let is_stray = closed_by_length && is_delimiter && head.length == Some(0) && !ends_what_is_open;
            let is_at_end = self.open.last().is_some_and(|open| open.end == Some(self.input.position()));
            if !is_stray || is_at_end {
                return Ok(Some(head));
            }
            self.is_odd = true;
            closed_by_length = false;
            if self.open.is_empty() && self.input.at_end()? {
                return Ok(None);
            }
        }
    }

    /// Whether that delimiter stands at the end of what is open and has a length: it is passed over.
    fn is_end_by_length(&self, head: Head) -> bool {
        [ITEM_DELIMITER, SEQUENCE_DELIMITER].contains(&head.tag)
            && head.length == Some(0)
            && self.open.last().is_some_and(|open| open.end == Some(self.input.position()))
    }

    /// An element of the data set itself or of an item.
    fn element(&mut self, around: Layout) -> Result<Option<Event>, ScanError> {
        let Some(head) = self.head(around)? else { return Ok(None) };
        let (tag, layout) = (head.tag, head.layout);
        if self.is_end_by_length(head) {
            self.is_odd = true;
            return Ok(self.close());
        }
        if tag == ITEM_DELIMITER && matches!(self.open.last(), Some(Open { end: None, .. })) {
            return Ok(self.close());
        }
        if tag.0 == 0xFFFE {
            return Err(ScanError::Malformed(format!(
                "a delimiter {tag} stands where an element must, before byte {}",
                self.input.position()
            )));
        }
        let is_un = head.vr == Some(*b"UN");
        let is_sequence = match head.vr {
            // What is read of UN is what the dictionary knows as a sequence (PS3.5 section 6.2.2).
            Some(_) if is_un && tag != PIXEL_DATA => head.length.is_none() || self.reads(tag),
            Some(vr) => &vr == b"SQ",
            None => (head.length.is_none() && tag != PIXEL_DATA) || is_sequence(tag),
        };
        if is_sequence {
            // A UN sequence is implicit VR little endian inside (PS3.5 section 6.2.2 note 4).
            let inside = if is_un { Layout::IMPLICIT } else { layout };
            let is_read = self.reads(tag);
            self.enter(Kind::Sequence, head.length, inside, is_read)?;
            return Ok(Some(Event::Sequence(tag)));
        }
        let Some(length) = head.length else {
            let may_be_fragments = matches!(head.vr.as_ref(), Some(b"OB" | b"OW" | b"UN"));
            if !may_be_fragments {
                return Err(ScanError::Malformed(format!("element {tag} has no length and is no sequence")));
            }
            let is_read = self.open.last().is_none_or(|open| open.is_read);
            self.enter(Kind::Fragments, None, layout, is_read)?;
            return Ok(Some(Event::Fragments(tag)));
        };
        let value = self.span(length)?;
        // The value of a UN is little endian wherever it stands (PS3.5 section 6.2.2).
        let layout = if is_un { Layout { big_endian: false, ..layout } } else { layout };
        Ok(Some(Event::Element { tag, vr: head.vr, value, layout }))
    }

    /// Whether somebody reads a sequence of that tag that stands here.
    fn reads(&self, tag: Tag) -> bool {
        READ.contains(&tag) && self.open.last().is_none_or(|open| open.is_read)
    }

    fn item(&mut self, layout: Layout, length_is_given: bool) -> Result<Option<Event>, ScanError> {
        let Some(head) = self.head(layout)? else { return Ok(None) };
        if self.is_end_by_length(head) {
            self.is_odd = true;
            return Ok(self.close());
        }
        match head.tag {
            ITEM => {
                let is_read = self.open.last().is_none_or(|open| open.is_read);
                self.enter(Kind::Item, head.length, layout, is_read)?;
                Ok(Some(Event::Item))
            }
            SEQUENCE_DELIMITER if !length_is_given => Ok(self.close()),
            tag => Err(ScanError::Malformed(format!(
                "{tag} stands in a sequence where an item must, before byte {}",
                self.input.position()
            ))),
        }
    }

    fn fragment(&mut self, layout: Layout) -> Result<Event, ScanError> {
        let Some(head) = self.head(layout)? else {
            return Err(ScanError::Malformed("the fragments of its pixel data do not end".into()));
        };
        match (head.tag, head.length) {
            (ITEM, Some(length)) => Ok(Event::Fragment(self.span(length)?)),
            (SEQUENCE_DELIMITER, _) => {
                self.open.pop();
                self.closed_by_length = false;
                Ok(Event::EndOfFragments)
            }
            (tag, _) => Err(ScanError::Malformed(format!(
                "{tag} stands among the fragments of the pixel data, before byte {}",
                self.input.position()
            ))),
        }
    }

    fn enter(
        &mut self,
        kind: Kind,
        length: Option<u32>,
        layout: Layout,
        is_read: bool,
    ) -> Result<(), ScanError> {
        if kind == Kind::Sequence && self.depth() >= self.limits.max_depth {
            self.is_beyond_limit = true;
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
        self.open.push(Open { kind, end, layout, is_read });
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
        match self.room() {
            Some(room) if u64::from(length) > room => Err(ScanError::Malformed(format!(
                "an element at byte {} claims {length} bytes where {room} are left",
                self.input.position()
            ))),
            _ => Ok(()),
        }
    }

    /// Bytes left of what is open and of the file, where that is known.
    fn room(&self) -> Option<u64> {
        self.room_in_open().into_iter().chain(self.input.left()).min()
    }

    fn room_in_open(&self) -> Option<u64> {
        let position = self.input.position();
        let ends = self.open.iter().filter_map(|open| open.end);
        ends.map(|end| end.saturating_sub(position)).min()
    }
}

/// Whether the standard's dictionary says that this element is a sequence.
fn is_sequence(tag: Tag) -> bool {
    StandardDataDictionary.by_tag(tag).is_some_and(|entry| entry.vr().exact() == Some(VR::SQ))
}
