//! Which series of the input.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::cli::inputs::{Inputs, Selected};
use crate::cli::{Exit, Failed};
use crate::dicom::header::InstanceHeader;
use crate::dicom::series::{UnfitReason, unfit, unfit_detail};
use crate::dicom::uid::SeriesInstanceUid;

struct Candidate {
    uid: SeriesInstanceUid,
    files: Vec<usize>,
    headers: Vec<InstanceHeader>,
    unfit: Option<UnfitReason>,
    /// What was found and the limit, where it is unfit.
    detail: Option<String>,
}

/// Why none of the series can be reconstructed.
pub(super) struct Refused {
    /// The stable code, where a series is at fault and not the arguments.
    pub(super) code: Option<&'static str>,
    pub(super) failed: Failed,
}

impl Refused {
    fn new(exit: Exit, code: UnfitReason, message: String) -> Self {
        Self { code: Some(code.name()), failed: Failed::new(exit, message) }
    }
}

impl From<Failed> for Refused {
    fn from(failed: Failed) -> Self {
        Self { code: None, failed }
    }
}

/// The series that is asked for, or the one that can be reconstructed.
pub(super) fn series<'a>(
    inputs: &'a Inputs,
    wanted: Option<&SeriesInstanceUid>,
    min_slices: usize,
) -> Result<Selected<'a>, Refused> {
    let candidates = candidates(inputs, min_slices);
    if candidates.is_empty() {
        let message = format!("no DICOM instance that can be used among {} files", inputs.len());
        return Err(Refused { code: Some("no_instances"), failed: Failed::new(Exit::Input, message) });
    }
    let list = listed(&candidates);
    let chosen = match wanted {
        Some(uid) => candidates
            .into_iter()
            .find(|candidate| candidate.uid == *uid)
            .ok_or_else(|| Failed::usage(format!("the input has no series {uid}; it has\n{list}")))?,
        None => the_one_that_fits(candidates, &list)?,
    };
    if let Some(reason) = chosen.unfit {
        let message = format!("{reason}: series {} can't be reconstructed\n{list}", chosen.uid);
        return Err(Refused::new(Exit::Series, reason, message));
    }
    Ok(Selected { inputs, files: chosen.files })
}

fn the_one_that_fits(candidates: Vec<Candidate>, list: &str) -> Result<Candidate, Refused> {
    let mut reasons = candidates.iter().filter_map(|candidate| candidate.unfit);
    let reason = reasons.clone().find(|reason| *reason != UnfitReason::NotCt);
    let no_ct = reasons.next().filter(|_| reason.is_none());
    let mut fit: Vec<_> = candidates.into_iter().filter(|candidate| candidate.unfit.is_none()).collect();
    match (fit.pop(), fit.len(), reason.or(no_ct)) {
        (Some(only), 0, _) => Ok(only),
        (None, _, Some(UnfitReason::NotCt)) => {
            Err(Refused::new(Exit::Input, UnfitReason::NotCt, format!("no series is CT\n{list}")))
        }
        (None, _, Some(reason)) => {
            Err(Refused::new(Exit::Series, reason, format!("no series can be reconstructed\n{list}")))
        }
        _ => Err(Failed::usage(format!("several series: choose one by --series UID\n{list}")).into()),
    }
}

/// By UID, so that the order of files does not matter.
fn candidates(inputs: &Inputs, min_slices: usize) -> Vec<Candidate> {
    let mut series: BTreeMap<_, (Vec<usize>, Vec<InstanceHeader>)> = BTreeMap::new();
    for (file, header) in &inputs.instances {
        let (files, headers) = series.entry(&header.series_instance_uid).or_default();
        files.push(*file);
        headers.push(header.clone());
    }
    series
        .into_iter()
        .map(|(uid, (files, headers))| {
            let (unfit, detail) = (unfit(&headers, min_slices), unfit_detail(&headers, min_slices));
            Candidate { uid: uid.clone(), files, headers, unfit, detail }
        })
        .collect()
}

fn listed(candidates: &[Candidate]) -> String {
    let mut list = String::new();
    for Candidate { uid, headers, unfit, detail, .. } in candidates {
        let description = headers.iter().find_map(|header| header.series_description.as_deref());
        let state = match (unfit, detail) {
            (Some(reason), Some(detail)) => format!("{}: {detail}", reason.name()),
            _ => "can be reconstructed".to_owned(),
        };
        let (count, description) = (headers.len(), description.unwrap_or("no description"));
        writeln!(list, "  {uid}  {count} instances  {description}  ({state})").expect("writing to a string");
    }
    list.trim_end().to_owned()
}
