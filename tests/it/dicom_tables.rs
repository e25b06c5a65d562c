//! What is offered can be done, what is written can be read, what is no head CT is said so.

use std::io::Cursor;

use dicom_encoding::TransferSyntaxIndex;
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;
use triplanar::dicom::header::InstanceHeader;
use triplanar::dicom::scan::{Encoding, Limits, scan};
use triplanar::dicom::series::UnfitReason;
use triplanar::dicom::series::unfit;
use triplanar::dicom::transfer_syntax::SUPPORTED;
use triplanar::dicom::{part10, sop_class};

use crate::support::dicom::{CT, EXPLICIT, identity};

#[test]
fn every_offered_transfer_syntax_can_be_decoded() {
    let mut uids: Vec<_> = SUPPORTED.iter().map(|syntax| syntax.uid).collect();
    for uid in &uids {
        let known = TransferSyntaxRegistry.get(uid).unwrap_or_else(|| panic!("{uid} is not known"));
        // Decoded here: RLE Lossless, JPEG Lossless.
        let ours = ["1.2.840.10008.1.2.5", "1.2.840.10008.1.2.4.57", "1.2.840.10008.1.2.4.70"];
        assert!(known.can_decode_all() || ours.contains(uid), "{uid} has no decoder");
    }
    assert_eq!(uids[0], EXPLICIT, "uncompressed is preferred");
    let first_lossy = SUPPORTED.iter().position(|syntax| syntax.lossy).expect("some are lossy");
    assert!(SUPPORTED[first_lossy..].iter().all(|syntax| syntax.lossy), "lossy ones come last");
    uids.sort_unstable();
    uids.dedup();
    assert_eq!(uids.len(), SUPPORTED.len());
    assert!(sop_class::is_accepted(&CT.parse().expect("a UID")));
    assert!(!sop_class::is_accepted(&"1.2.840.10008.5.1.4.1.1.4".parse().expect("a UID")));
}

#[test]
fn another_toolkit_reads_the_file_header() {
    let file = identity(CT, "1.2.3.4.5").part10(CT, "1.2.3.4.5", EXPLICIT);
    let object = dicom_object::from_reader(Cursor::new(file)).expect("a Part 10 file");
    let meta = object.meta();
    assert_eq!(meta.media_storage_sop_class_uid.trim_end_matches('\0'), CT);
    assert_eq!(meta.media_storage_sop_instance_uid.trim_end_matches('\0'), "1.2.3.4.5");
    assert_eq!(meta.transfer_syntax.trim_end_matches('\0'), EXPLICIT);
    assert_eq!(meta.implementation_class_uid.trim_end_matches('\0'), part10::IMPLEMENTATION_CLASS_UID);
    assert_eq!(object.element_by_name("SeriesInstanceUID").expect("it").to_str().expect("text"), "1.2.3.2");
}

fn header() -> InstanceHeader {
    let mut header = scan(
        Cursor::new(identity(CT, "1.2.3.4").0),
        &Encoding::DataSet(EXPLICIT.parse().expect("a UID")),
        &Limits::default(),
    )
    .expect("a header")
    .header;
    header.has_pixel_data = true;
    header.has_position = Some(true);
    header
}

#[test]
fn a_series_that_is_no_head_ct_is_told_why() {
    let slices = |count: usize, change: fn(&mut InstanceHeader)| {
        let mut slice = header();
        change(&mut slice);
        vec![slice; count]
    };
    let localizer = |header: &mut InstanceHeader| header.image_type[2] = "LOCALIZER".into();
    assert_eq!(unfit(&slices(10, |_| {}), 10), None);
    assert_eq!(unfit(&slices(9, |_| {}), 10), Some(UnfitReason::TooFewSlices));
    assert_eq!(unfit(&slices(1, |header| header.frames = 10), 10), None);
    assert_eq!(
        unfit(&slices(99, |header| header.modality = Some("MR".into())), 10),
        Some(UnfitReason::NotCt)
    );
    let sr = |header: &mut InstanceHeader| {
        header.sop_class_uid = "1.2.840.10008.5.1.4.1.1.88.67".parse().expect("a UID");
    };
    assert_eq!(unfit(&slices(1, sr), 10), Some(UnfitReason::NotCt));
    assert_eq!(unfit(&slices(99, localizer), 10), Some(UnfitReason::Localizer));
    assert_eq!(
        unfit(&slices(99, |header| header.has_pixel_data = false), 10),
        Some(UnfitReason::NoPixelData)
    );
    let screen = |header: &mut InstanceHeader| header.image_type.push("SCREEN SAVE".into());
    assert_eq!(unfit(&slices(99, screen), 10), Some(UnfitReason::SecondaryCapture));
    let reformat = |header: &mut InstanceHeader| {
        header.image_type = ["DERIVED", "SECONDARY", "REFORMATTED"].map(String::from).to_vec();
    };
    assert_eq!(unfit(&slices(99, reformat), 10), None, "a reformat of the volume is a volume");
    let mixed = [slices(2, localizer), slices(9, |_| {})].concat();
    assert_eq!(unfit(&mixed, 10), Some(UnfitReason::TooFewSlices), "localizers are no slices");
    assert_eq!(unfit(&mixed, 9), None);
}
