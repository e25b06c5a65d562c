//! Writes DICOM instances byte by byte: valid ones, and ones that should be refused.

use triplanar::dicom::part10;
use triplanar::dicom::source::InstanceSource;

/// Explicit VR little endian.
pub(crate) const EXPLICIT: &str = "1.2.840.10008.1.2.1";
/// CT Image Storage.
pub(crate) const CT: &str = "1.2.840.10008.5.1.4.1.1.2";
/// Enhanced CT Image Storage.
pub(crate) const ENHANCED_CT: &str = "1.2.840.10008.5.1.4.1.1.2.1";

/// A data set in explicit VR little endian. Elements stand in the order in which they are put.
#[derive(Clone, Default)]
pub(crate) struct DataSet(pub(crate) Vec<u8>);

impl DataSet {
    /// An element with the bytes of its value.
    pub(crate) fn put(mut self, tag: (u16, u16), vr: &str, value: &[u8]) -> Self {
        self.0.extend(tag.0.to_le_bytes());
        self.0.extend(tag.1.to_le_bytes());
        self.0.extend(vr.as_bytes());
        let length = value.len().next_multiple_of(2);
        if ["OB", "OW", "OV", "SQ", "UN", "UT"].contains(&vr) {
            self.0.extend([0, 0]);
            self.0.extend(u32::try_from(length).expect("a short value").to_le_bytes());
        } else {
            self.0.extend(u16::try_from(length).expect("a short value").to_le_bytes());
        }
        self.0.extend(value);
        if value.len() % 2 == 1 {
            self.0.push(if vr == "UI" || vr == "OB" { 0 } else { b' ' });
        }
        self
    }
    pub(crate) fn text(self, tag: (u16, u16), vr: &str, value: &str) -> Self {
        self.put(tag, vr, value.as_bytes())
    }
    pub(crate) fn number(self, tag: (u16, u16), value: u16) -> Self {
        self.put(tag, "US", &value.to_le_bytes())
    }
    pub(crate) fn decimals(self, tag: (u16, u16), values: &[f64]) -> Self {
        let texts: Vec<String> = values.iter().map(|value| format!("{value:.9}")).collect();
        self.put(tag, "DS", texts.join("\\").as_bytes())
    }
    /// A sequence of defined length.
    pub(crate) fn sequence(self, tag: (u16, u16), items: &[Self]) -> Self {
        let mut value = Vec::new();
        for item in items {
            value.extend([0xFE, 0xFF, 0x00, 0xE0]);
            value.extend(u32::try_from(item.0.len()).expect("a short item").to_le_bytes());
            value.extend(&item.0);
        }
        self.put(tag, "SQ", &value)
    }
    /// Encapsulated pixel data: the offset table, then the fragments.
    pub(crate) fn fragments(mut self, offset_table: &[u8], fragments: &[&[u8]]) -> Self {
        self.0.extend([0xE0, 0x7F, 0x10, 0x00, b'O', b'B', 0, 0, 0xFF, 0xFF, 0xFF, 0xFF]);
        for fragment in [offset_table].iter().chain(fragments) {
            self.0.extend([0xFE, 0xFF, 0x00, 0xE0]);
            let length = fragment.len().next_multiple_of(2);
            self.0.extend(u32::try_from(length).expect("a short fragment").to_le_bytes());
            self.0.extend(*fragment);
            if fragment.len() % 2 == 1 {
                self.0.push(0);
            }
        }
        self.0.extend([0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0]);
        self
    }
    /// With our file header in front.
    pub(crate) fn part10(&self, sop_class: &str, sop_instance: &str, transfer_syntax: &str) -> Vec<u8> {
        let uid = "a valid UID";
        let mut file = part10::file_meta(
            &sop_class.parse().expect(uid),
            &sop_instance.parse().expect(uid),
            &transfer_syntax.parse().expect(uid),
        );
        file.extend(&self.0);
        file
    }
}

/// The identity of an instance of a CT series: everything before its geometry.
pub(crate) fn identity(sop_class: &str, sop_instance: &str) -> DataSet {
    DataSet::default()
        .text((0x0008, 0x0008), "CS", "ORIGINAL\\PRIMARY\\AXIAL")
        .text((0x0008, 0x0016), "UI", sop_class)
        .text((0x0008, 0x0018), "UI", sop_instance)
        .text((0x0008, 0x0060), "CS", "CT")
        .text((0x0020, 0x000D), "UI", "1.2.3.1")
        .text((0x0020, 0x000E), "UI", "1.2.3.2")
        .text((0x0020, 0x0052), "UI", "1.2.3.3")
}

/// One slice of a CT series.
#[derive(Clone)]
pub(crate) struct Slice {
    pub(crate) uid: String,
    pub(crate) position: [f64; 3],
    /// Along the row, down the column.
    pub(crate) orientation: [f64; 6],
    /// Between rows, between columns.
    pub(crate) spacing: [f64; 2],
    pub(crate) rows: u16,
    pub(crate) columns: u16,
    /// Stored values, signed; HU = value - 24.
    pub(crate) values: Vec<i16>,
}

impl Slice {
    /// Intercept of what is written.
    pub(crate) const INTERCEPT: i16 = -24;

    /// Slice `index` of a small series: 4 rows of 6 pixels with these values, slices 2 mm apart.
    pub(crate) fn small(index: usize, values: Vec<i16>) -> Self {
        Self {
            uid: format!("1.2.3.4.{}", index + 10),
            position: [-10.0, -20.0, 2.0 * index as f64],
            orientation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            spacing: [1.0, 1.0],
            rows: 4,
            columns: 6,
            values,
        }
    }

    /// The elements from the geometry to the rescale.
    pub(crate) fn described(&self, data_set: DataSet) -> DataSet {
        data_set
            .decimals((0x0020, 0x0032), &self.position)
            .decimals((0x0020, 0x0037), &self.orientation)
            .number((0x0028, 0x0002), 1)
            .text((0x0028, 0x0004), "CS", "MONOCHROME2")
            .number((0x0028, 0x0010), self.rows)
            .number((0x0028, 0x0011), self.columns)
            .decimals((0x0028, 0x0030), &self.spacing)
            .number((0x0028, 0x0100), 16)
            .number((0x0028, 0x0101), 16)
            .number((0x0028, 0x0102), 15)
            .number((0x0028, 0x0103), 1)
            .decimals((0x0028, 0x1052), &[f64::from(Self::INTERCEPT)])
            .decimals((0x0028, 0x1053), &[1.0])
    }

    /// The whole instance, uncompressed.
    pub(crate) fn part10(&self) -> Vec<u8> {
        let pixels: Vec<u8> = self.values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.described(identity(CT, &self.uid))
            .put((0x7FE0, 0x0010), "OW", &pixels)
            .part10(CT, &self.uid, EXPLICIT)
    }
}

/// Instances in memory.
pub(crate) struct Memory(pub(crate) Vec<Vec<u8>>);

impl InstanceSource for Memory {
    fn len(&self) -> usize {
        self.0.len()
    }
    fn read(&self, index: usize) -> std::io::Result<Vec<u8>> {
        Ok(self.0[index].clone())
    }
}
