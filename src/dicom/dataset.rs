//! The attributes of one instance that reading a series needs, as a small tree, and its bytes.

use std::borrow::Cow;
use std::io::{Cursor, Read};

use dicom_core::Tag;
use dicom_dictionary_std::tags;
use flate2::read::DeflateDecoder;

use super::digest::PALETTE;
use super::identity::Identity;
use super::scan::values::{decoded, text, texts};
use super::scan::{Encoding, Event, Layout, Limits, ScanError, Seekable, Span, Walker, begin};
use super::sop_class;
use super::transfer_syntax::TransferSyntax;
use super::uid::SopClassUid;
use crate::memory::{Memory, Share};

/// What is kept of the walk. Everything else is passed over.
const WANTED: [Tag; 48] = [
    tags::SPECIFIC_CHARACTER_SET,
    tags::ACCESSION_NUMBER,
    tags::PATIENT_NAME,
    tags::PATIENT_ID,
    tags::ISSUER_OF_PATIENT_ID,
    tags::PATIENT_BIRTH_DATE,
    tags::PATIENT_SEX,
    tags::SOP_CLASS_UID,
    tags::SOP_INSTANCE_UID,
    tags::STUDY_INSTANCE_UID,
    tags::SERIES_INSTANCE_UID,
    tags::FRAME_OF_REFERENCE_UID,
    tags::MODALITY,
    tags::IMAGE_TYPE,
    tags::INSTANCE_NUMBER,
    tags::NUMBER_OF_FRAMES,
    tags::SAMPLES_PER_PIXEL,
    tags::PHOTOMETRIC_INTERPRETATION,
    tags::PLANAR_CONFIGURATION,
    tags::ROWS,
    tags::COLUMNS,
    tags::BITS_ALLOCATED,
    tags::BITS_STORED,
    tags::HIGH_BIT,
    tags::PIXEL_REPRESENTATION,
    tags::PIXEL_PADDING_VALUE,
    tags::PIXEL_PADDING_RANGE_LIMIT,
    tags::LOSSY_IMAGE_COMPRESSION,
    tags::IMAGE_POSITION_PATIENT,
    tags::IMAGE_ORIENTATION_PATIENT,
    tags::PIXEL_SPACING,
    tags::RESCALE_SLOPE,
    tags::RESCALE_INTERCEPT,
    tags::RESCALE_TYPE,
    tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE,
    tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE,
    tags::PIXEL_MEASURES_SEQUENCE,
    tags::PLANE_POSITION_SEQUENCE,
    tags::PLANE_ORIENTATION_SEQUENCE,
    tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE,
    tags::FRAME_CONTENT_SEQUENCE,
    tags::STACK_ID,
    tags::CT_IMAGE_FRAME_TYPE_SEQUENCE,
    tags::FRAME_TYPE,
    tags::EXTENDED_OFFSET_TABLE,
    tags::EXTENDED_OFFSET_TABLE_LENGTHS,
    tags::PIXEL_DATA,
    tags::ACQUISITION_NUMBER,
];

fn is_wanted(tag: Tag) -> bool {
    WANTED.contains(&tag)
        || PALETTE.contains(&tag)
        || OVERLAYS.contains(&tag.0) && [OVERLAY_BIT_POSITION, OVERLAY_DATA].contains(&tag.1)
}

/// The repeating groups of overlays (PS3.5 section 7.6).
const OVERLAYS: [u16; 16] = [
    0x6000, 0x6002, 0x6004, 0x6006, 0x6008, 0x600A, 0x600C, 0x600E, 0x6010, 0x6012, 0x6014, 0x6016, 0x6018,
    0x601A, 0x601C, 0x601E,
];
/// OverlayBitPosition (60xx,0102).
const OVERLAY_BIT_POSITION: u16 = 0x0102;
/// OverlayData (60xx,3000).
const OVERLAY_DATA: u16 = 0x3000;

/// One instance, walked over.
pub(crate) struct DataSet<'a> {
    /// The data set's bytes: those of the file, or inflated ones. Spans count from their beginning.
    bytes: Cow<'a, [u8]>,
    pub(crate) syntax: &'static TransferSyntax,
    /// Something that nobody reads is not written as it should.
    pub(crate) is_odd: bool,
    top: Item,
}

/// The wanted elements of the data set itself or of an item.
#[derive(Default)]
pub(crate) struct Item(Vec<(Tag, Value)>);

enum Value {
    Plain { vr: Option<[u8; 2]>, span: Span, layout: Layout },
    Items(Vec<Item>),
    Fragments(Vec<Span>),
}

/// The Pixel Data element as it stands in the bytes.
pub(crate) enum RawPixels<'a> {
    /// One value with all frames.
    Native { bytes: &'a [u8], vr: Option<[u8; 2]>, layout: Layout },
    /// The offset table and the fragments after it: offset (of the item's tag, counted from the
    /// first fragment's) and bytes of each.
    Encapsulated { offset_table: &'a [u8], fragments: Vec<(u64, &'a [u8])> },
}

impl<'a> DataSet<'a> {
    /// Walks over a Part 10 file.
    pub(crate) fn open(bytes: &'a [u8], limits: &Limits) -> Result<Self, ScanError> {
        Self::open_within(bytes, limits, &mut Memory::unlimited().share(), &|| false)
    }

    /// The same, with memory for what it inflates taken as it grows; ends early where `stop` says so.
    pub(crate) fn open_within(
        bytes: &'a [u8],
        limits: &Limits,
        memory: &mut Share,
        stop: &dyn Fn() -> bool,
    ) -> Result<Self, ScanError> {
        let (offset, syntax) = begin(&mut Cursor::new(bytes), &Encoding::Part10)?;
        let start = usize::try_from(offset).unwrap_or(usize::MAX);
        let data_set = bytes.get(start..).unwrap_or_default();
        let bytes = if syntax.deflated() {
            Cow::Owned(inflate(data_set, limits.max_inflated_bytes, memory, stop)?)
        } else {
            Cow::Borrowed(data_set)
        };
        let mut input = Seekable::new(Cursor::new(&*bytes), 0)?;
        let mut walker = Walker::new(&mut input, syntax.layout(), limits);
        let top = collect(&mut walker)?;
        let is_odd = walker.is_odd();
        Ok(Self { bytes, syntax, is_odd, top })
    }

    /// The data set itself.
    pub(crate) fn top(&self) -> View<'_> {
        View { bytes: &self.bytes, item: &self.top }
    }

    /// Bytes of it, as they are walked over.
    pub(crate) fn size(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// All that the walk meets, plain values with their bytes.
    pub(crate) fn walk(&self, limits: &Limits, visit: &mut dyn FnMut(Event, &[u8])) -> Result<(), ScanError> {
        let mut input = Seekable::new(Cursor::new(&*self.bytes), 0)?;
        let mut walker = Walker::new(&mut input, self.syntax.layout(), limits);
        while let Some(event) = walker.next()? {
            let value = match event {
                Event::Element { value, .. } => slice(&self.bytes, value),
                _ => &[],
            };
            visit(event, value);
        }
        Ok(())
    }

    /// Pixel Data, if there is any.
    pub(crate) fn pixels(&self) -> Option<RawPixels<'_>> {
        match self.top.get(tags::PIXEL_DATA)? {
            Value::Plain { vr, span, layout } => {
                let bytes = slice(&self.bytes, *span);
                (!bytes.is_empty()).then_some(RawPixels::Native { bytes, vr: *vr, layout: *layout })
            }
            Value::Fragments(spans) => {
                let (table, fragments) = spans.split_first()?;
                let base = fragments.first().map_or(0, |span| span.offset);
                let fragments =
                    fragments.iter().map(|span| (span.offset - base, slice(&self.bytes, *span))).collect();
                Some(RawPixels::Encapsulated { offset_table: slice(&self.bytes, *table), fragments })
            }
            Value::Items(_) => None,
        }
    }
}

/// The walk made sure that every span lies within the bytes.
fn slice(bytes: &[u8], span: Span) -> &[u8] {
    let start = usize::try_from(span.offset).unwrap_or(usize::MAX);
    let length = usize::try_from(span.length).unwrap_or(usize::MAX);
    bytes.get(start..start.saturating_add(length)).unwrap_or_default()
}

/// What is inflated before memory is asked for again, bytes.
const INFLATED_AT_A_TIME: usize = 4 << 20;

fn inflate(
    bytes: &[u8],
    limit: u64,
    memory: &mut Share,
    stop: &dyn Fn() -> bool,
) -> Result<Vec<u8>, ScanError> {
    let mut inflated = Vec::new();
    let mut decoder = DeflateDecoder::new(bytes).take(limit.saturating_add(1));
    loop {
        if stop() {
            return Err(ScanError::Stopped);
        }
        if inflated.capacity() - inflated.len() < INFLATED_AT_A_TIME {
            let more = INFLATED_AT_A_TIME.max(inflated.len() / 2);
            memory.grow(more as u64)?;
            inflated.reserve_exact(more);
        }
        let read = (&mut decoder)
            .take(INFLATED_AT_A_TIME as u64)
            .read_to_end(&mut inflated)
            .map_err(|_| ScanError::Malformed("its deflated data set can't be inflated".into()))?;
        if inflated.len() as u64 > limit {
            return Err(ScanError::InflatesTooMuch { limit_bytes: limit });
        }
        if read == 0 {
            return Ok(inflated);
        }
    }
}

/// A sequence that is open on the walk.
struct Open {
    tag: Tag,
    /// It and all around it are wanted.
    keep: bool,
    items: Vec<Item>,
}

fn collect<R: Read + std::io::Seek>(walker: &mut Walker<'_, Seekable<R>>) -> Result<Item, ScanError> {
    let mut top = Item::default();
    let mut open: Vec<Open> = Vec::new();
    let mut fragments: Option<(Tag, Vec<Span>)> = None;
    while let Some(event) = walker.next()? {
        let keep = open.last().is_none_or(|open| open.keep);
        match event {
            Event::Sequence(tag) => {
                open.push(Open { tag, keep: keep && is_wanted(tag), items: Vec::new() });
            }
            Event::Item => {
                if let Some(sequence) = open.last_mut().filter(|sequence| sequence.keep) {
                    sequence.items.push(Item::default());
                }
            }
            Event::EndOfItem => {}
            Event::EndOfSequence => {
                if let Some(Open { tag, keep: true, items }) = open.pop() {
                    current(&mut top, &mut open).put(tag, Value::Items(items));
                }
            }
            Event::Element { tag, vr, value: span, layout } => {
                if keep && is_wanted(tag) {
                    current(&mut top, &mut open).put(tag, Value::Plain { vr, span, layout });
                }
            }
            Event::Fragments(tag) => fragments = Some((tag, Vec::new())),
            Event::Fragment(span) => {
                if let Some((_, spans)) = &mut fragments {
                    spans.push(span);
                }
            }
            Event::EndOfFragments => {
                if let Some((tag, spans)) = fragments.take().filter(|(tag, _)| keep && is_wanted(*tag)) {
                    current(&mut top, &mut open).put(tag, Value::Fragments(spans));
                }
            }
        }
    }
    Ok(top)
}

/// The item that elements go to now.
fn current<'t>(top: &'t mut Item, open: &'t mut [Open]) -> &'t mut Item {
    match open.last_mut().and_then(|sequence| sequence.items.last_mut()) {
        Some(item) => item,
        None => top,
    }
}

impl Item {
    /// Of an element that stands twice, the first counts.
    fn put(&mut self, tag: Tag, value: Value) {
        if self.get(tag).is_none() {
            self.0.push((tag, value));
        }
    }

    fn get(&self, tag: Tag) -> Option<&Value> {
        self.0.iter().find(|(t, _)| *t == tag).map(|(_, value)| value)
    }
}

/// What a written number of frames means (PS3.3 section C.7.6.6: 0 is none).
pub(crate) fn number_of_frames(written: u32, class: Option<&SopClassUid>) -> Option<u32> {
    match written {
        0 => class.is_some_and(sop_class::is_single_frame).then_some(1),
        frames => Some(frames),
    }
}

/// An item together with the bytes that its values are in.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    bytes: &'a [u8],
    item: &'a Item,
}

impl<'a> View<'a> {
    /// The items of a sequence.
    pub(crate) fn items(self, tag: Tag) -> impl Iterator<Item = View<'a>> {
        let items = match self.item.get(tag) {
            Some(Value::Items(items)) => items.as_slice(),
            _ => &[],
        };
        items.iter().map(move |item| View { bytes: self.bytes, item })
    }

    fn raw(self, tag: Tag) -> Option<(&'a [u8], Layout)> {
        match self.item.get(tag)? {
            Value::Plain { span, layout, .. } => Some((slice(self.bytes, *span), *layout)),
            _ => None,
        }
    }

    /// The bytes of a value.
    pub(crate) fn bytes(self, tag: Tag) -> Option<&'a [u8]> {
        self.raw(tag).map(|(bytes, _)| bytes)
    }

    /// Text without padding, `None` where absent or empty.
    pub(crate) fn text(self, tag: Tag) -> Option<String> {
        self.bytes(tag).map(text).filter(|text| !text.is_empty())
    }

    /// Text of the data set itself in its character set, `None` where absent or empty.
    pub(crate) fn decoded(self, tag: Tag) -> Option<String> {
        let text = decoded(self.bytes(tag)?, self.bytes(tags::SPECIFIC_CHARACTER_SET));
        Some(text).filter(|text| !text.is_empty())
    }

    /// Whom the data set says that it shows.
    pub(crate) fn identity(self) -> Identity {
        Identity {
            patient_id: self.decoded(tags::PATIENT_ID),
            issuer_of_patient_id: self.decoded(tags::ISSUER_OF_PATIENT_ID),
            patient_name: self.decoded(tags::PATIENT_NAME),
            patient_birth_date: self.decoded(tags::PATIENT_BIRTH_DATE),
            patient_sex: self.decoded(tags::PATIENT_SEX),
            accession_number: self.decoded(tags::ACCESSION_NUMBER),
        }
    }

    /// The values of a text with several.
    pub(crate) fn texts(self, tag: Tag) -> Vec<String> {
        self.bytes(tag).map(texts).unwrap_or_default()
    }

    /// A UID.
    pub(crate) fn uid<T: std::str::FromStr>(self, tag: Tag) -> Option<T> {
        self.text(tag)?.parse().ok()
    }

    /// The first value of US or SS, its bits as they are.
    pub(crate) fn u16(self, tag: Tag) -> Option<u16> {
        let (bytes, layout) = self.raw(tag)?;
        Some(layout.u16(bytes.get(..2)?.try_into().ok()?))
    }

    /// The bits of Pixel Data that overlays are announced in: the planes without data of their own.
    pub(crate) fn overlay_bits(self) -> Vec<u16> {
        OVERLAYS
            .into_iter()
            .filter(|group| self.item.get(Tag(*group, OVERLAY_DATA)).is_none())
            .filter_map(|group| self.u16(Tag(group, OVERLAY_BIT_POSITION)))
            .collect()
    }

    /// Exactly `N` finite decimal numbers (VR DS).
    pub(crate) fn decimals<const N: usize>(self, tag: Tag) -> Option<[f64; N]> {
        let values = self.texts(tag);
        let numbers: Vec<f64> = values
            .iter()
            .map(|value| value.parse().ok().filter(|n: &f64| n.is_finite()))
            .collect::<Option<_>>()?;
        numbers.try_into().ok()
    }

    /// Number of Frames: 1 where it is absent, and where a class without frames says 0. `None` if it
    /// is no count.
    pub(crate) fn frames(self) -> Option<u32> {
        let Some(text) = self.text(tags::NUMBER_OF_FRAMES) else { return Some(1) };
        let frames = text.parse().ok()?;
        let class: Option<SopClassUid> = self.uid(tags::SOP_CLASS_UID);
        number_of_frames(frames, class.as_ref())
    }

    /// An integer (VR IS).
    pub(crate) fn integer(self, tag: Tag) -> Option<i64> {
        self.texts(tag).first()?.parse().ok()
    }
}
