//! The bounded scan: what is valid passes, what would hurt is refused with its error.

use triplanar::dicom::scan::{Encoding, Limits, ScanError, scan};

use crate::support::data;

#[test]
fn every_file_passes_or_is_refused_for_its_documented_reason() {
    let Some(data) = data::dir() else { return };
    let mut refused = Vec::new();
    for folder in ["cornerstone3d_CTImage", "pydicom", "misc"] {
        for entry in std::fs::read_dir(data.join("syntax").join(folder)).expect("the folder") {
            let path = entry.expect("an entry").path();
            let file = std::fs::File::open(&path).expect("the file");
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            match scan(file, &Encoding::Part10, &Limits::default()) {
                Ok(scan) => assert_eq!(scan.header.has_pixel_data, name != "no-pixel-data.dcm", "{name}"),
                Err(ScanError::UnsupportedTransferSyntax(uid)) => refused.push(uid.to_string()),
                // Its SOP Instance UID is a hash in hexadecimal digits.
                Err(ScanError::Missing { attribute: "SOPInstanceUID (0008,0018)" }) => {
                    assert_eq!(name, "bad_sequence.dcm");
                }
                Err(error) => panic!("{name}: {error:?}"),
            }
        }
    }
    refused.sort();
    refused.dedup();
    let mut expected = vec![".50", ".51", ".53", ".55"];
    if cfg!(not(feature = "jpegls")) {
        expected.extend([".80", ".81"]);
    }
    assert_eq!(refused, expected.iter().map(|end| format!("1.2.840.10008.1.2.4{end}")).collect::<Vec<_>>());
}
