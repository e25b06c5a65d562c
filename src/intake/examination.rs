//! What is checked of an instance before anything of it is kept.

use super::Announced;
use super::spool::Reader;
use crate::dicom::scan::{self, Limits, Scan};
use crate::dicom::sop_class;
use crate::error::{Error, Result};

/// Scans the bytes and compares them with what was announced. Blocks.
///
/// # Errors
/// The scan's; a data set that is not what the command said (PS3.4 table B.2-1, A900); a SOP class
/// that is not stored here.
pub(super) fn examine(reader: &mut dyn Reader, announced: &Announced, limits: &Limits) -> Result<Scan> {
    let scan = scan::scan(reader, &announced.encoding, limits)?;
    let header = &scan.header;
    if let Some(class) = announced.sop_class_uid.as_ref().filter(|class| **class != header.sop_class_uid) {
        return Err(Error::DataSetMismatch(format!(
            "its SOP class is {}, the command's {class}",
            header.sop_class_uid
        )));
    }
    if let Some(uid) = announced.sop_instance_uid.as_ref().filter(|uid| **uid != header.sop_instance_uid) {
        return Err(Error::DataSetMismatch(format!(
            "its SOP instance is {}, the command's {uid}",
            header.sop_instance_uid
        )));
    }
    if let Some(uid) = announced.study_instance_uid.as_ref().filter(|uid| **uid != header.study_instance_uid)
    {
        return Err(Error::DataSetMismatch(format!(
            "its study is {}, the request's {uid}",
            header.study_instance_uid
        )));
    }
    Ok(scan)
}

/// Refuses what is no CT image.
pub(super) fn accept_class(scan: &Scan) -> Result<()> {
    let class = &scan.header.sop_class_uid;
    if sop_class::is_accepted(class) { Ok(()) } else { Err(Error::UnsupportedSopClass(class.clone())) }
}

/// Refuses an image that is not whole, or has more than its pixels.
pub(super) fn accept_pixels(scan: &Scan) -> Result<()> {
    scan.pixel_fault.clone().map_or(Ok(()), |fault| Err(fault.into()))
}
