//! `paper` decides on every slice of three series as the published program does, from what lies in
//! the repository: masks of the series and that program's decisions (`tests/it/fixtures/README.md`).

use std::io::Read as _;
use std::path::Path;

use flate2::read::GzDecoder;
use ndarray::Array3;
use serde::Deserialize;
use sha2::{Digest, Sha256};
use triplanar::geometry::Plane;
use triplanar::observer::Silent;
use triplanar::pipeline::Parameters;
use triplanar::pipeline::paper::decisions::decide;
use triplanar::pipeline::slices::Pixel;

use crate::published_program_slices::{is_equal, sorted, told};
use crate::support::published::Slice;

/// The published program's decision, and the digest of its contour's pixels where it was accepted.
#[derive(Debug, Deserialize)]
struct Row {
    #[serde(flatten)]
    slice: Slice,
    contour: Option<String>,
}

fn unpacked(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("it/fixtures/published").join(name);
    let file = std::fs::File::open(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut bytes = Vec::new();
    GzDecoder::new(file).read_to_end(&mut bytes).expect("gzip");
    bytes
}

/// The volume `V[[z, y, x]]` as the pipeline has it: top first, the back of the head in row 0. Tissue
/// is 0 HU, all else air.
fn volume(series: &str, slices: usize) -> Array3<i16> {
    const SIZE: usize = 512;
    let bytes = unpacked(&format!("{series}.mask.gz"));
    assert_eq!(bytes.len(), slices * SIZE * SIZE / 8, "{series}");
    let bit = |at: usize| bytes[at / 8] >> (7 - at % 8) & 1 == 1;
    let mut hu = Array3::from_elem((slices, SIZE, SIZE), -1000);
    for slice in 0..slices {
        for column in 0..SIZE {
            let mut is_tissue = false;
            for row in 0..SIZE {
                // A row is stored as what differs from the row before it.
                is_tissue ^= bit((slice * SIZE + row) * SIZE + column);
                if is_tissue {
                    hu[[slices - 1 - slice, SIZE - 1 - row, column]] = 0;
                }
            }
        }
    }
    hu
}

fn digest(contour: &[Pixel]) -> String {
    let mut hash = Sha256::new();
    for pixel in sorted(contour) {
        for value in [pixel.row, pixel.column] {
            hash.update(u16::try_from(value).expect("within the picture").to_le_bytes());
        }
    }
    hex::encode(hash.finalize())[..16].to_owned()
}

#[test]
fn every_slice_of_the_fixture_is_decided_as_by_the_published_program() {
    let [mut accepted, mut rejected] = [[0; 3]; 2];
    for (series, slices) in
        [("phantom_4", 145), ("ge_hispeed_tilt_variable", 28), ("philips_phantom_tilt_p16", 58)]
    {
        let decisions =
            decide(&volume(series, slices), &Parameters::paper(), &Silent).expect("not cancelled");
        let text = String::from_utf8(unpacked(&format!("{series}.slices.jsonl.gz"))).expect("text");
        let theirs: Vec<Row> =
            text.lines().map(|line| serde_json::from_str(line).expect("a slice")).collect();
        assert_eq!(decisions.rows.len(), theirs.len(), "{series}: a row for every slice");
        let mut differences = Vec::new();
        for ((row, contour), their) in decisions.rows.iter().zip(&decisions.contours).zip(&theirs) {
            let our = told(row);
            if !is_equal(&our, &their.slice) {
                differences.push(format!("{our:?}, theirs {:?}", their.slice));
            } else if our.accepted && Some(digest(contour)) != their.contour {
                differences.push(format!("{:?} {}: other contour pixels", our.plane, our.index));
            }
            let counted = if our.accepted { &mut accepted } else { &mut rejected };
            counted[our.plane.index()] += 1;
        }
        let (first, n) = (differences.first(), differences.len());
        assert!(n == 0, "{series}: {n} of {} slices differ, first {first:?}", theirs.len());
    }
    let decided = |plane: Plane| accepted[plane.index()] > 0 && rejected[plane.index()] > 0;
    assert!(Plane::ALL.into_iter().all(decided), "accepted {accepted:?}, rejected {rejected:?}");
}
