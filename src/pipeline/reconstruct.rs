//! One door for all profiles.

use crate::dicom::Volume;
use crate::observer::Observer;
use crate::observer::stop::unless_stopped;
use crate::pipeline::paper;
use crate::pipeline::parameters::{Parameters, Profile};
use crate::pipeline::precise::reconstruction;
use crate::pipeline::result::{PipelineError, Reconstruction};

/// Reconstructs the skin surface of a head from a CT volume, as the parameters' profile does it.
///
/// Runs on the rayon pool of the caller; the result is the same on any number of threads.
///
/// # Errors
/// [`PipelineError::EmptyCloud`] and [`PipelineError::NoSkin`] with everything found so far if there
/// is no point, [`PipelineError::Cancelled`] if the observer asks for it.
pub fn reconstruct(
    volume: &Volume,
    parameters: &Parameters,
    observer: &dyn Observer,
) -> Result<Reconstruction, PipelineError> {
    let work = || match parameters.profile {
        Profile::Paper => paper::reconstruct(volume, parameters, observer),
        Profile::Precise => reconstruction::reconstruct(volume, parameters, observer),
    };
    unless_stopped(work)?
}
