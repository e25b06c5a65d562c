//! What the queue tells its workers, and what they tell it.

use crate::dicom::uid::SopInstanceUid;
use crate::geometry::Plane;
use crate::pipeline::Figures;
use crate::pipeline::precise::Quality;

use super::records::{ReconstructionId, ReconstructionRecord};

/// A worker's hold on a running reconstruction. Each claim has a higher fence than all before of
/// the same reconstruction: whoever lost the lease can't write any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lease {
    /// What is held.
    pub id: ReconstructionId,
    /// The fencing token.
    pub fence: i64,
}

/// A reconstruction to run, and the hold on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// The hold.
    pub lease: Lease,
    /// What to run; its `attempts` counts this one.
    pub reconstruction: ReconstructionRecord,
}

/// What a heartbeat learns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Heartbeat {
    /// Go on.
    Ours,
    /// Somebody asked for it to stop: stop and call `Store::finish_cancelled`.
    CancelRequested,
    /// The lease is lost, or the reconstruction was removed: stop, nothing more can be written.
    Lost,
}

/// What a reconstruction gives to be stored.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Binary PLY in LPS of each plane, `None` being the triplanar one; all four.
    pub clouds: Vec<(Option<Plane>, Vec<u8>)>,
    /// The report as it is stored.
    pub report: Vec<u8>,
    /// The figures for the catalog.
    pub figures: Figures,
    /// How far the result can be trusted, for the catalog.
    pub quality: Option<Quality>,
    /// What the pictures of its slices are drawn from.
    pub pictures: Option<Vec<u8>>,
}

/// Why a reconstruction failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Stable code.
    pub code: String,
    /// What failed and what to do next.
    pub detail: String,
    /// The instances at fault, if it names any.
    pub instances: Vec<SopInstanceUid>,
}

/// Which running reconstructions have lost their worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reclaim {
    /// All of them: this process has just started and holds the data directory alone.
    All,
    /// Those whose lease ran out.
    Expired,
}
