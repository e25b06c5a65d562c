//! What the doubts of a series' transfer are about, in words.

use std::collections::BTreeMap;

use crate::error::Result;
use crate::http::Context;
use crate::http::views::DoubtView;
use crate::store::{BrokenTransfer, Refused, SenderEnd, SeriesRecord, TransferDoubt};

const FORMER_DECODER: &str = "release 0.1 made the cloud that is served, with a decoder that could read JPEG Lossless \
    wrongly, from instances that are JPEG Lossless or, no longer stored, may have been; it is made again at a start \
    of the service where they are stored (see the latest reconstruction): wait for that, ask for it, or send the \
    series again";

/// One for each doubt of the series.
pub(super) async fn view(
    context: &Context,
    series: &SeriesRecord,
    refused: &[Refused],
) -> Result<Vec<DoubtView>> {
    let mut views = Vec::new();
    for doubt in &series.doubts {
        let detail = match doubt {
            TransferDoubt::IncompleteTransfer => {
                let broken = context.store.broken_transfers(&series.series_instance_uid).await?;
                incomplete(series, &broken)
            }
            TransferDoubt::InstancesRefused => refusals(series, refused),
            TransferDoubt::FormerDecoder => FORMER_DECODER.to_owned(),
        };
        views.push(DoubtView { doubt: *doubt, detail });
    }
    Ok(views)
}

fn incomplete(series: &SeriesRecord, broken: &[BrokenTransfer]) -> String {
    let mut ends = BTreeMap::<SenderEnd, usize>::new();
    for transfer in broken {
        *ends.entry(transfer.end).or_default() += 1;
    }
    let mut parts = Vec::new();
    if !broken.is_empty() {
        let ends: Vec<String> = ends.iter().map(|(end, count)| format!("{end}: {count}")).collect();
        parts.push(format!("senders broke off ({})", ends.join(", ")));
    }
    let missing: u64 = broken.iter().map(|transfer| transfer.missing).sum();
    if missing > 0 {
        parts.push(format!("{missing} instances that were under way are not stored"));
    }
    if let Some(expected) = series.expected_instances.filter(|expected| *expected > series.instances) {
        parts.push(format!("{expected} instances were announced and {} are stored", series.instances));
    }
    format!("{}; send the whole series again, or say that it is complete", parts.join("; "))
}

fn refusals(series: &SeriesRecord, refused: &[Refused]) -> String {
    let held: Vec<&Refused> = refused.iter().filter(|refused| refused.held).collect();
    let mut codes = BTreeMap::<&str, usize>::new();
    for refused in &held {
        *codes.entry(&refused.code).or_default() += 1;
    }
    let codes: Vec<String> = codes.iter().map(|(code, count)| format!("{code}: {count}")).collect();
    let mut text = format!("instances were refused and are not stored ({})", codes.join(", "));
    let stored = &series.study_instance_uid;
    let mut studies = BTreeMap::<&str, usize>::new();
    for study in held.iter().filter_map(|refused| refused.study_instance_uid.as_ref()) {
        if study != stored {
            *studies.entry(study.as_str()).or_default() += 1;
        }
    }
    if !studies.is_empty() {
        let others: Vec<String> =
            studies.iter().map(|(study, count)| format!("{count} of study {study}")).collect();
        text.push_str(&format!(
            "; instances of several studies bear this Series Instance UID: {} of study {stored} are stored, {} \
             were refused",
            series.instances,
            others.join(", ")
        ));
    }
    text + "; send what lacks again, or say that the series is complete without it"
}
