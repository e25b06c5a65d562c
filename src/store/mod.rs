//! What survives: the catalog (SQL) and the blobs (files).

mod records;

pub use records::{
    CompleteReason, InstanceRecord, Page, ReconstructionFilter, ReconstructionId, ReconstructionRecord,
    ReconstructionState, Refused, SeriesFilter, SeriesRecord, SeriesState, UnfitReason,
};
