//! The voxels of a series in Hounsfield units, with their true place in the patient.

use ndarray::Array3;

use super::uid::{FrameOfReferenceUid, SeriesInstanceUid, SopInstanceUid, StudyInstanceUid};
use crate::geometry::{Axis, Grid};

/// A CT series as a volume.
#[derive(Debug, Clone)]
pub struct Volume {
    /// Hounsfield units `[[z, y, x]]`, in the order that [`Grid`] describes: z = 0 most superior,
    /// y = 0 most posterior, x = 0 the patient's rightmost. HU = slope · stored + intercept,
    /// truncated toward zero (the paper's mask works on that) and clipped to the range of `i16`.
    pub hu: Array3<i16>,
    /// Where the voxels are.
    pub grid: Grid,
    /// The instance of each acquired slice, along [`Grid::slice_axis`] (the same UID again and
    /// again for the frames of a multi-frame instance).
    pub sop_instance_uids: Vec<SopInstanceUid>,
    /// Indices along [`Grid::slice_axis`] of the acquired slices that don't go with their neighbours, as
    /// those of damaged data do; the warning `inconsistent_levels` tells what was found.
    pub doubtful_slices: Vec<usize>,
    /// Identity of what was read.
    pub identity: SeriesIdentity,
}

/// What ties a result to its source. Holds nothing that names a patient.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SeriesIdentity {
    /// Study Instance UID (0020,000D).
    pub study_instance_uid: Option<StudyInstanceUid>,
    /// Series Instance UID (0020,000E).
    pub series_instance_uid: SeriesInstanceUid,
    /// Frame of Reference UID (0020,0052): the frame in which the LPS coordinates are valid.
    pub frame_of_reference_uid: Option<FrameOfReferenceUid>,
}

impl Volume {
    /// The instance of an axial slice, if the series was acquired in axial slices.
    #[must_use]
    pub fn axial_sop_instance_uid(&self, z: usize) -> Option<&SopInstanceUid> {
        (self.grid.slice_axis() == Axis::Z).then(|| self.sop_instance_uids.get(z)).flatten()
    }
}
