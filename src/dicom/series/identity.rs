//! One patient and one study in a series: slices of two never make one volume.

use super::SeriesError;
use super::frame::Instance;
use crate::dicom::identity::{Identity, parted};
use crate::dicom::uid::SopInstanceUid;

/// Refuses instances of which some are of another study than the others.
pub(super) fn one_study(instances: &[Instance]) -> Result<(), SeriesError> {
    let mut studies: Vec<_> = instances.iter().filter_map(|i| i.study_instance_uid.as_ref()).collect();
    studies.sort();
    studies.dedup();
    if studies.len() < 2 {
        return Ok(());
    }
    let of = |study| {
        let of = instances.iter().filter(move |i| i.study_instance_uid.as_ref() == Some(study));
        of.map(|i| i.sop_instance_uid.clone()).collect()
    };
    let sets = studies.into_iter().map(of).collect();
    Err(mixed("mixed_study", "studies (Study Instance UID differs)", sets))
}

/// Refuses instances of which some are of another patient than the others.
pub(super) fn one_patient(instances: &[Instance]) -> Result<(), SeriesError> {
    let identities: Vec<&Identity> = instances.iter().map(|instance| &instance.identity).collect();
    let Some((parting, sets)) = parted(&identities) else { return Ok(()) };
    let uids = |set: Vec<usize>| set.into_iter().map(|index| instances[index].sop_instance_uid.clone());
    let sets = sets.into_iter().map(|set| uids(set).collect()).collect();
    Err(mixed("mixed_patient", &format!("patients ({parting})"), sets))
}

/// The error that names the instances set after set, the largest first, and how many are of each.
fn mixed(code: &'static str, what: &str, mut sets: Vec<Vec<SopInstanceUid>>) -> SeriesError {
    for set in &mut sets {
        set.sort();
        set.dedup();
    }
    sets.sort_by(|a, b| b.len().cmp(&a.len()).then_with(|| a.cmp(b)));
    let counts: Vec<String> = sets.iter().map(|set| set.len().to_string()).collect();
    let detail = format!(
        "the series holds instances of {} {what}: those named are of one each, {} of them in that order; send each \
         as a series of its own, or send again with a corrected identity what was wrong",
        sets.len(),
        counts.join(", then "),
    );
    SeriesError::new(code, detail, sets.into_iter().flatten().collect())
}
