//! `api/dicom-conformance.md` says what the program does.

use triplanar::dicom::part10::{IMPLEMENTATION_CLASS_UID, IMPLEMENTATION_VERSION_NAME};
use triplanar::dicom::{PixelExtentError, sop_class, transfer_syntax};
use triplanar::error::Error;

fn statement() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../api/dicom-conformance.md");
    std::fs::read_to_string(path).unwrap()
}

/// The cells of the rows that have `columns` of them.
fn rows(statement: &str, columns: usize) -> Vec<Vec<&str>> {
    let cells = |line| str::split(line, '|').skip(1).map(str::trim).collect::<Vec<_>>();
    statement
        .lines()
        .filter(|line| line.starts_with('|'))
        .map(cells)
        .filter(|row| row.len() == columns + 1)
        .collect()
}

#[test]
fn the_statement_lists_the_transfer_syntaxes_in_our_order_of_preference() {
    let statement = statement();
    let optional = |name: &str| name.starts_with("JPEG-LS") && !cfg!(feature = "jpegls");
    let listed: Vec<_> = rows(&statement, 2)
        .into_iter()
        .filter(|row| row[1].starts_with("1.2.840.10008.1.2") && !optional(row[0]))
        .map(|row| row[1])
        .collect();
    let supported: Vec<_> = transfer_syntax::SUPPORTED.iter().map(|syntax| syntax.uid).collect();
    assert_eq!(listed, supported);
}

#[test]
fn the_statement_lists_the_sop_classes_and_who_we_are() {
    let statement = statement();
    for class in sop_class::ACCEPTED {
        let row = format!("| {} ({}) | yes¹ | yes |", class.name, class.uid);
        assert!(statement.contains(&row), "{row} is missing");
    }
    assert_eq!(statement.matches("1.2.840.10008.5.1.4").count(), sop_class::ACCEPTED.len());
    assert!(statement.contains(IMPLEMENTATION_CLASS_UID));
    assert!(statement.contains(IMPLEMENTATION_VERSION_NAME));
}

#[test]
fn the_statement_gives_every_refusal_of_an_instance_its_status() {
    let statement = statement();
    let rows = rows(&statement, 5);
    let uid = "1.2.3";
    let refusals = [
        Error::NotDicom(String::new()),
        Error::MalformedDataSet(String::new()),
        Error::MissingAttribute { attribute: "" },
        Error::PixelDataSize(PixelExtentError::Short { length: 0, needed: 1 }),
        Error::ConflictingInstance(uid.parse().unwrap()),
        Error::ConflictingSeries(uid.parse().unwrap()),
        Error::ConflictingStudy(uid.parse().unwrap()),
        Error::ConflictingIdentity(uid.parse().unwrap()),
        Error::SeriesFull { limit: 0, setting: "" },
        Error::UnsupportedTransferSyntax(uid.parse().unwrap()),
        Error::UnsupportedSopClass(uid.parse().unwrap()),
        Error::DataSetMismatch(String::new()),
        Error::TooLarge { limit_bytes: 0, setting: "" },
        Error::OutOfStorage,
        Error::OutOfDescriptors,
        Error::OutOfMemory,
        Error::NotPermitted,
        Error::StoredDamaged(String::new()),
        Error::Busy(""),
        Error::ShuttingDown,
        Error::internal("a cause"),
    ];
    for refusal in refusals {
        let mapping = refusal.mapping();
        let (status, code) = (format!("{:04X}", mapping.dimse_status), format!("`{}`", mapping.code));
        assert!(rows.iter().any(|row| row[1] == status && row[2] == code), "{status} {code} is missing");
    }
}
