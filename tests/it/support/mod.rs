//! What the tests share.

pub(crate) mod bytes;
pub(crate) mod client;
pub(crate) mod data;
pub(crate) mod dicom;
pub(crate) mod dimse;
pub(crate) mod entrance;
pub(crate) mod head;
pub(crate) mod http;
pub(crate) mod icp;
pub(crate) mod instances;
pub(crate) mod jpeg_lossless;
pub(crate) mod memory;
pub(crate) mod pacs;
pub(crate) mod phantom;
pub(crate) mod published;
pub(crate) mod raw;
pub(crate) mod scu;
pub(crate) mod service;
pub(crate) mod skin;
pub(crate) mod slice;
pub(crate) mod vertices;
