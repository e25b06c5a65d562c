//! The published program's results on the shared series.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use triplanar::geometry::Plane;
use triplanar::pipeline::slices::Pixel;

/// The series on which the published program was run.
pub(crate) const SERIES: [&str; 4] =
    ["phantom_4", "imagex_siemens_phantom_2mm", "ge_hispeed_tilt_variable", "philips_phantom_tilt_p16"];

/// Its results on one series.
pub(crate) struct Published {
    folder: PathBuf,
}

/// Its decision on one slice.
#[derive(Debug, Deserialize)]
pub(crate) struct Slice {
    pub(crate) plane: Plane,
    pub(crate) index: usize,
    pub(crate) accepted: bool,
    pub(crate) reason: String,
    pub(crate) contour_points: usize,
    pub(crate) contour_area: Option<f64>,
    pub(crate) solidity: Option<f64>,
    pub(crate) carried_area_before: Option<f64>,
    pub(crate) carried_area_after: Option<f64>,
}

impl Published {
    pub(crate) fn of(data: &Path, series: &str) -> Self {
        Self { folder: data.join("published_program").join(series) }
    }

    /// A line a slice.
    pub(crate) fn slices(&self) -> Vec<Slice> {
        let text = std::fs::read_to_string(self.folder.join("slices.jsonl")).expect("slices.jsonl");
        text.lines().map(|line| serde_json::from_str(line).expect("a slice")).collect()
    }

    /// The contours of the accepted slices.
    pub(crate) fn contours(&self) -> HashMap<(Plane, usize), Vec<Pixel>> {
        let bytes = std::fs::read(self.folder.join("contours.bin")).expect("contours.bin");
        let mut rest = bytes.as_slice();
        let mut contours = HashMap::new();
        while !rest.is_empty() {
            let [plane, index, count] = std::array::from_fn(|_| {
                let value = i32::from_le_bytes(take(&mut rest));
                usize::try_from(value).expect("no negative counts")
            });
            let pixels = (0..count)
                .map(|_| {
                    let [column, row] = std::array::from_fn(|_| {
                        u32::try_from(i16::from_le_bytes(take(&mut rest))).expect("within the picture")
                    });
                    Pixel { row, column }
                })
                .collect();
            contours.insert((Plane::ALL[plane], index), pixels);
        }
        contours
    }

    /// The points of a stage, in the program's own frame: `raw_axial`, `unique_leaf1`, …
    pub(crate) fn points(&self, stage: &str) -> Vec<[f32; 3]> {
        let path = self.folder.join(format!("{stage}.npy"));
        let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert_eq!(bytes[..8], *b"\x93NUMPY\x01\x00", "{stage}: npy version 1");
        let header_length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let header = std::str::from_utf8(&bytes[10..10 + header_length]).expect("an ASCII header");
        assert!(header.contains("'<f4'") && header.contains("'fortran_order': False"), "{stage}: {header}");
        let (points, []) = bytes[10 + header_length..].as_chunks::<12>() else {
            panic!("{stage}: not three float32 a point");
        };
        points
            .iter()
            .map(|point| {
                let mut rest = point.as_slice();
                std::array::from_fn(|_| f32::from_le_bytes(take(&mut rest)))
            })
            .collect()
    }
}

fn take<const N: usize>(bytes: &mut &[u8]) -> [u8; N] {
    let (head, rest) = bytes.split_first_chunk().expect("the file is whole");
    *bytes = rest;
    *head
}
