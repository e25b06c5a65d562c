//! A small CT slice as bytes, element by element (PS3.5 section 7.1).

use sha2::{Digest, Sha256};
use triplanar::dicom::part10;
use triplanar::dicom::uid::{SeriesInstanceUid, SopInstanceUid};

/// A root for test UIDs.
const ROOT: &str = "1.2.826.0.1.3680043.10.9999.7";

/// Explicit VR Little Endian.
pub(crate) const EXPLICIT: &str = "1.2.840.10008.1.2.1";
/// Implicit VR Little Endian.
pub(crate) const IMPLICIT: &str = "1.2.840.10008.1.2";
/// CT Image Storage.
pub(crate) const CT: &str = "1.2.840.10008.5.1.4.1.1.2";

/// What a slice is like; `..Slice::default()` for what doesn't matter.
#[derive(Debug, Clone)]
pub(crate) struct Slice {
    pub(crate) study: u32,
    pub(crate) series: u32,
    pub(crate) number: u32,
    pub(crate) sop_class: &'static str,
    pub(crate) modality: &'static str,
    pub(crate) syntax: &'static str,
    /// All pixels.
    pub(crate) value: i16,
    pub(crate) edge: u16,
    pub(crate) patient_id: &'static str,
    /// Patient Comments, if there are any.
    pub(crate) comments: &'static str,
    /// Samples per pixel; 3 are in colour.
    pub(crate) samples: u16,
}

impl Default for Slice {
    fn default() -> Self {
        Self {
            study: 1,
            series: 1,
            number: 1,
            sop_class: CT,
            modality: "CT",
            syntax: EXPLICIT,
            value: 40,
            edge: 8,
            patient_id: "PATIENT-4711",
            comments: "",
            samples: 1,
        }
    }
}

impl Slice {
    /// Slice `number` of series `series`.
    pub(crate) fn of(series: u32, number: u32) -> Self {
        Self { series, number, ..Self::default() }
    }

    pub(crate) fn series_uid(&self) -> SeriesInstanceUid {
        format!("{ROOT}.{}.{}", self.study, self.series).parse().unwrap()
    }

    /// The UID does not depend on the study: so another one can claim it.
    pub(crate) fn sop_uid(&self) -> SopInstanceUid {
        format!("{ROOT}.9.{}", self.number).parse().unwrap()
    }

    /// The bare data set.
    pub(crate) fn data_set(&self) -> Vec<u8> {
        let mut set = DataSet { implicit: self.syntax == IMPLICIT, bytes: Vec::new() };
        set.text(0x0008_0008, b"CS", r"ORIGINAL\PRIMARY\AXIAL");
        set.text(0x0008_0016, b"UI", self.sop_class);
        set.text(0x0008_0018, b"UI", self.sop_uid().as_str());
        set.text(0x0008_0060, b"CS", self.modality);
        set.text(0x0010_0010, b"PN", "Sauerbruch^Ferdinand");
        set.text(0x0010_0020, b"LO", self.patient_id);
        if !self.comments.is_empty() {
            set.text(0x0010_4000, b"LT", self.comments);
        }
        set.text(0x0020_000D, b"UI", &format!("{ROOT}.{}", self.study));
        set.text(0x0020_000E, b"UI", self.series_uid().as_str());
        set.text(0x0020_0013, b"IS", &self.number.to_string());
        set.text(0x0020_0032, b"DS", &format!(r"0\0\{}", self.number * 2));
        set.text(0x0020_0037, b"DS", r"1\0\0\0\1\0");
        set.text(0x0020_0052, b"UI", &format!("{ROOT}.{}.0", self.study));
        set.short(0x0028_0002, self.samples);
        set.text(0x0028_0004, b"CS", if self.samples == 1 { "MONOCHROME2" } else { "RGB" });
        set.short(0x0028_0010, self.edge);
        set.short(0x0028_0011, self.edge);
        set.text(0x0028_0030, b"DS", r"1\1");
        set.short(0x0028_0100, 16);
        set.short(0x0028_0101, 16);
        set.short(0x0028_0102, 15);
        set.short(0x0028_0103, 1);
        set.text(0x0028_1052, b"DS", "0");
        set.text(0x0028_1053, b"DS", "1");
        let values = usize::from(self.edge) * usize::from(self.edge) * usize::from(self.samples);
        let pixels = self.value.to_le_bytes().repeat(values);
        set.element(0x7FE0_0010, b"OW", &pixels);
        set.bytes
    }

    /// The whole file.
    pub(crate) fn part10(&self) -> Vec<u8> {
        let class = self.sop_class.parse().unwrap();
        let mut file = part10::file_meta(&class, &self.sop_uid(), &self.syntax.parse().unwrap());
        file.extend(self.data_set());
        file
    }

    /// The file that is stored of it: our header with its seal, and the untouched data set.
    pub(crate) fn stored(&self) -> Vec<u8> {
        let class = self.sop_class.parse().unwrap();
        let data_set = self.data_set();
        let content =
            part10::Content { data_set_sha256: Sha256::digest(&data_set).into(), image_sha256: None };
        let syntax = self.syntax.parse().unwrap();
        let mut file = part10::sealed_file_meta(&class, &self.sop_uid(), &syntax, &content);
        file.extend(data_set);
        file
    }
}

struct DataSet {
    implicit: bool,
    bytes: Vec<u8>,
}

impl DataSet {
    fn element(&mut self, tag: u32, vr: &[u8; 2], value: &[u8]) {
        let (group, element) = ((tag >> 16) as u16, tag as u16);
        self.bytes.extend(group.to_le_bytes());
        self.bytes.extend(element.to_le_bytes());
        let length = u32::try_from(value.len()).unwrap();
        match (self.implicit, vr) {
            (true, _) => self.bytes.extend(length.to_le_bytes()),
            (false, b"OW") => {
                self.bytes.extend(*b"OW\0\0");
                self.bytes.extend(length.to_le_bytes());
            }
            (false, vr) => {
                self.bytes.extend(vr);
                self.bytes.extend(u16::try_from(length).unwrap().to_le_bytes());
            }
        }
        self.bytes.extend(value);
    }

    fn text(&mut self, tag: u32, vr: &[u8; 2], text: &str) {
        let mut value = text.as_bytes().to_vec();
        if value.len() % 2 == 1 {
            value.push(if vr == b"UI" { 0 } else { b' ' });
        }
        self.element(tag, vr, &value);
    }

    fn short(&mut self, tag: u32, value: u16) {
        self.element(tag, b"US", &value.to_le_bytes());
    }
}
