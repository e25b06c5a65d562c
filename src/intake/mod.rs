//! Makes an instance durable, groups it into its series, notices that a series is complete.
//!
//! The way of an instance: `Intake::begin` gives a spool file in `data_dir/incoming`; the bytes
//! are appended to it as they arrive; `Intake::store` runs the bounded scan over it, syncs it,
//! moves it to its place among the blobs, syncs the folder and enters it in the catalog, all
//! before it returns. Only then may anybody acknowledge it.

mod spool;

use uuid::Uuid;

use crate::dicom::header::InstanceHeader;
use crate::dicom::uid::{SopClassUid, SopInstanceUid, TransferSyntaxUid};

pub use spool::Spool;

/// How the spooled bytes are to be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Encoding {
    /// A Part 10 file with preamble and file meta information (or one that lost its preamble).
    Part10,
    /// A bare data set in this transfer syntax, as C-STORE carries it.
    DataSet(TransferSyntaxUid),
}

/// Who sent an instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Sender {
    /// An association, by an id of ours, with its calling AE title.
    Association {
        /// Ours, for `Intake::association_ended`.
        id: Uuid,
        /// The calling AE title.
        calling_ae_title: String,
    },
    /// An HTTP request, by an id of ours; `Intake::upload_ended` ends it.
    Upload {
        /// Ours.
        id: Uuid,
    },
}

/// What the sender said of the instance before its bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Announced {
    /// How to read the bytes.
    pub encoding: Encoding,
    /// Affected SOP Class UID of the command, if there was one.
    pub sop_class_uid: Option<SopClassUid>,
    /// Affected SOP Instance UID of the command, if there was one.
    pub sop_instance_uid: Option<SopInstanceUid>,
    /// Who.
    pub sender: Sender,
}

/// The instance is durable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Receipt {
    /// What its header says.
    pub header: InstanceHeader,
    /// It was stored before, with the same content.
    pub duplicate: bool,
}
