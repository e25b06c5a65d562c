//! What is counted, as typed methods; `GET /metrics` shows it in the OpenMetrics text format.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::registry::{Registry, Unit};

use crate::geometry::Plane;
use crate::observer::Stage;
use crate::pipeline::name_of;
use crate::pipeline::precise::Verdict;
use crate::store::{CompleteReason, ReconstructionState};

/// The door that an instance came through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SenderKind {
    /// C-STORE.
    Association,
    /// HTTP: upload or STOW-RS.
    Upload,
}

impl SenderKind {
    /// The label's value.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Association => "association",
            Self::Upload => "upload",
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct InstanceLabels {
    sender: &'static str,
    outcome: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct ReasonLabel {
    reason: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct ResultLabel {
    result: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct EndLabel {
    end: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct StateLabel {
    state: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct StageLabel {
    stage: &'static str,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct SliceLabels {
    plane: &'static str,
    reason: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct VerdictLabel {
    verdict: String,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct RequestLabels {
    method: &'static str,
    route: String,
    status: u16,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct RouteLabels {
    method: &'static str,
    route: String,
}

/// 5 ms to about 5 minutes.
fn durations() -> Histogram {
    Histogram::new(exponential_buckets(0.005, 2.0, 16))
}

/// All counters, gauges and histograms of one service. Cheap to count on from any thread.
#[derive(Debug)]
pub struct Metrics {
    registry: Registry,
    instances: Family<InstanceLabels, Counter>,
    bytes_stored: Counter,
    corrected_instances: Counter,
    identity_changing: Gauge,
    series_completed: Family<ReasonLabel, Counter>,
    associations_accepted: Counter,
    associations_rejected: Family<ReasonLabel, Counter>,
    associations_failed: Family<ReasonLabel, Counter>,
    associations_ended: Family<EndLabel, Counter>,
    presentation_contexts: Family<ResultLabel, Counter>,
    associations_open: Gauge,
    jobs: Family<StateLabel, Counter>,
    job_attempts: Counter,
    queue_depth: Gauge,
    stages: Family<StageLabel, Histogram, fn() -> Histogram>,
    slices_rejected: Family<SliceLabels, Counter>,
    verdicts: Family<VerdictLabel, Counter>,
    requests: Family<RequestLabels, Counter>,
    request_durations: Family<RouteLabels, Histogram, fn() -> Histogram>,
    free_disk_bytes: Gauge<u64, AtomicU64>,
    results_damaged: Counter,
    recovered_blobs: Gauge<u64, AtomicU64>,
    replaced_blobs: Gauge<u64, AtomicU64>,
    set_aside_files: Gauge<u64, AtomicU64>,
    set_aside_bytes: Gauge<u64, AtomicU64>,
}

impl Default for Metrics {
    fn default() -> Self {
        Self::new()
    }
}

impl Metrics {
    /// Everything at zero.
    #[must_use]
    pub fn new() -> Self {
        let mut metrics = Self {
            registry: Registry::with_prefix("triplanar"),
            instances: Family::default(),
            bytes_stored: Counter::default(),
            corrected_instances: Counter::default(),
            identity_changing: Gauge::default(),
            series_completed: Family::default(),
            associations_accepted: Counter::default(),
            associations_rejected: Family::default(),
            associations_failed: Family::default(),
            associations_ended: Family::default(),
            presentation_contexts: Family::default(),
            associations_open: Gauge::default(),
            jobs: Family::default(),
            job_attempts: Counter::default(),
            queue_depth: Gauge::default(),
            stages: Family::new_with_constructor(durations),
            slices_rejected: Family::default(),
            verdicts: Family::default(),
            requests: Family::default(),
            request_durations: Family::new_with_constructor(durations),
            free_disk_bytes: Gauge::default(),
            results_damaged: Counter::default(),
            recovered_blobs: Gauge::default(),
            replaced_blobs: Gauge::default(),
            set_aside_files: Gauge::default(),
            set_aside_bytes: Gauge::default(),
        };
        metrics.register();
        metrics
    }

    /// A stored result was found changed or gone.
    pub fn result_damaged(&self) {
        self.results_damaged.inc();
    }

    fn register(&mut self) {
        let r = &mut self.registry;
        r.register(
            "instances",
            "Instances received, by sender and outcome (stored, duplicate, the refusal's code, or cut: its \
             association or request ended within it)",
            self.instances.clone(),
        );
        r.register_with_unit(
            "stored",
            "Bytes of the instances stored",
            Unit::Bytes,
            self.bytes_stored.clone(),
        );
        r.register(
            "corrected_instances",
            "Stored instances whose data set was replaced by one with a corrected identity",
            self.corrected_instances.clone(),
        );
        r.register(
            "series_identity_changing",
            "Series of which some instances carry a corrected identity and others do not yet",
            self.identity_changing.clone(),
        );
        r.register(
            "series_completed",
            "Series that became complete, by what completed them",
            self.series_completed.clone(),
        );
        r.register(
            "associations_accepted",
            "DICOM associations accepted",
            self.associations_accepted.clone(),
        );
        r.register(
            "associations_rejected",
            "DICOM associations rejected, by reason",
            self.associations_rejected.clone(),
        );
        r.register(
            "associations_failed",
            "DICOM connections and associations that ended other than by release, by reason",
            self.associations_failed.clone(),
        );
        r.register(
            "associations_ended",
            "DICOM associations that ended, by how: released, aborted by either side, lost",
            self.associations_ended.clone(),
        );
        r.register(
            "presentation_contexts",
            "Presentation contexts offered in accepted associations, by result",
            self.presentation_contexts.clone(),
        );
        r.register("associations_open", "DICOM associations open now", self.associations_open.clone());
        r.register("jobs", "Reconstructions that reached a final state, by state", self.jobs.clone());
        r.register(
            "results_damaged",
            "Stored results found changed or gone when they were asked for",
            self.results_damaged.clone(),
        );
        r.register("job_attempts", "Attempts at a reconstruction begun", self.job_attempts.clone());
        r.register("queue_depth", "Reconstructions that wait for a worker", self.queue_depth.clone());
        r.register_with_unit(
            "stage_duration",
            "Time that a stage of a reconstruction took",
            Unit::Seconds,
            self.stages.clone(),
        );
        r.register(
            "slices_rejected",
            "Slices that the pipeline rejected, by plane and reason",
            self.slices_rejected.clone(),
        );
        r.register(
            "verdicts",
            "Reconstructions of the profile precise that succeeded, by verdict",
            self.verdicts.clone(),
        );
        r.register(
            "http_requests",
            "HTTP requests answered, by method, route template and status",
            self.requests.clone(),
        );
        r.register_with_unit(
            "http_request_duration",
            "Time from a request's head to its answer's head",
            Unit::Seconds,
            self.request_durations.clone(),
        );
        r.register_with_unit(
            "free_disk",
            "Free space on the disk of the data directory",
            Unit::Bytes,
            self.free_disk_bytes.clone(),
        );
        r.register(
            "recovered_blobs",
            "Files without a row in the catalog that got one at this start",
            self.recovered_blobs.clone(),
        );
        r.register(
            "replaced_blobs",
            "Stored instances found missing or damaged since this start, replaced when they came again",
            self.replaced_blobs.clone(),
        );
        r.register("set_aside_files", "Files in set-aside/", self.set_aside_files.clone());
        r.register_with_unit(
            "set_aside",
            "Size of the files in set-aside/",
            Unit::Bytes,
            self.set_aside_bytes.clone(),
        );
        // Final states exist from the start, so that a rate over them does.
        for state in ReconstructionState::ALL.iter().filter(|state| state.is_final()) {
            let _ = self.jobs.get_or_create(&StateLabel { state: ended_as(*state).name() });
        }
    }

    /// An instance was answered: `outcome` is `stored`, `duplicate` or the code of
    /// [`crate::error::Mapping`]; or its sender ended within it: `cut`.
    pub fn instance_received(&self, sender: SenderKind, outcome: &'static str) {
        self.instances.get_or_create(&InstanceLabels { sender: sender.name(), outcome }).inc();
    }

    /// So many bytes of an instance were made durable.
    pub fn bytes_stored(&self, bytes: u64) {
        self.bytes_stored.inc_by(bytes);
    }

    /// A stored instance was replaced by one with a corrected identity.
    pub fn instance_corrected(&self) {
        self.corrected_instances.inc();
    }

    /// So many series wait for the rest of their instances with a corrected identity.
    pub fn set_identity_changing(&self, series: u64) {
        self.identity_changing.set(i64::try_from(series).unwrap_or(i64::MAX));
    }

    /// A series became complete.
    pub fn series_completed(&self, reason: CompleteReason) {
        self.series_completed.get_or_create(&ReasonLabel { reason: reason.name() }).inc();
    }

    /// An association was accepted; [`Metrics::association_closed`] ends it.
    pub fn association_opened(&self) {
        self.associations_accepted.inc();
        self.associations_open.inc();
    }

    /// An accepted association ended, however it did.
    pub fn association_closed(&self) {
        self.associations_open.dec();
    }

    /// An accepted association ended: `released`, `aborted` or `lost`.
    pub fn association_ended(&self, end: &'static str) {
        self.associations_ended.get_or_create(&EndLabel { end }).inc();
    }

    /// A presentation context was answered; `result` is `accepted` or why it was refused.
    pub fn presentation_context(&self, result: &'static str) {
        self.presentation_contexts.get_or_create(&ResultLabel { result }).inc();
    }

    /// An association was rejected; `reason` is a stable code such as `unknown_calling_ae_title`.
    pub fn association_rejected(&self, reason: &'static str) {
        self.associations_rejected.get_or_create(&ReasonLabel { reason }).inc();
    }

    /// A connection or an association ended other than by release; `reason` is a stable code such
    /// as `idle`.
    pub fn association_failed(&self, reason: &'static str) {
        self.associations_failed.get_or_create(&ReasonLabel { reason }).inc();
    }

    /// A reconstruction reached a final state.
    pub fn job_finished(&self, state: ReconstructionState) {
        self.jobs.get_or_create(&StateLabel { state: ended_as(state).name() }).inc();
    }

    /// A worker began an attempt.
    pub fn job_attempted(&self) {
        self.job_attempts.inc();
    }

    /// So many reconstructions wait now.
    pub fn set_queue_depth(&self, queued: u64) {
        self.queue_depth.set(i64::try_from(queued).unwrap_or(i64::MAX));
    }

    /// A stage ended after so long.
    pub fn stage_ended(&self, stage: Stage, took: Duration) {
        self.stages.get_or_create(&StageLabel { stage: stage.name() }).observe(took.as_secs_f64());
    }

    /// A result was judged.
    pub fn verdict_reached(&self, verdict: Verdict) {
        self.verdicts.get_or_create(&VerdictLabel { verdict: name_of(&verdict) }).inc();
    }

    /// So many slices of a plane were rejected for a reason, named as [`crate::pipeline::Reason`] is.
    pub fn slices_rejected(&self, plane: Plane, reason: &str, slices: u64) {
        let labels = SliceLabels { plane: plane.name(), reason: reason.to_owned() };
        self.slices_rejected.get_or_create(&labels).inc_by(slices);
    }

    /// A request was answered. `route` is the template, never the path itself.
    pub fn http_request(&self, method: &'static str, route: &str, status: u16, took: Duration) {
        let route = route.to_owned();
        self.requests.get_or_create(&RequestLabels { method, route: route.clone(), status }).inc();
        self.request_durations.get_or_create(&RouteLabels { method, route }).observe(took.as_secs_f64());
    }

    /// So many bytes are free on the data directory's disk.
    pub fn set_free_disk_bytes(&self, bytes: u64) {
        self.free_disk_bytes.set(bytes);
    }

    /// What the store found wrong and dealt with.
    pub(crate) fn set_store_counts(&self, counts: &crate::store::Counts) {
        self.recovered_blobs.set(counts.entered.load(Ordering::Relaxed));
        self.replaced_blobs.set(counts.replaced.load(Ordering::Relaxed));
        self.set_aside_files.set(counts.set_aside_files.load(Ordering::Relaxed));
        self.set_aside_bytes.set(counts.set_aside_bytes.load(Ordering::Relaxed));
    }

    /// The media type of [`Metrics::encode`].
    pub const MEDIA_TYPE: &'static str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

    /// Everything in the OpenMetrics text format, which Prometheus reads.
    #[must_use]
    pub fn encode(&self) -> String {
        let mut text = String::new();
        prometheus_client::encoding::text::encode(&mut text, &self.registry)
            .expect("writing to a String can't fail");
        text
    }
}

/// What is superseded had succeeded.
fn ended_as(state: ReconstructionState) -> ReconstructionState {
    match state {
        ReconstructionState::Superseded => ReconstructionState::Succeeded,
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_counted_stands_in_the_text() {
        let metrics = Metrics::new();
        metrics.instance_received(SenderKind::Upload, "stored");
        metrics.association_opened();
        metrics.job_finished(ReconstructionState::Failed);
        metrics.set_queue_depth(3);
        metrics.slices_rejected(Plane::Axial, "solidity", 7);
        metrics.verdict_reached(Verdict::Limited);
        metrics.stage_ended(Stage::Reading, Duration::from_millis(20));
        metrics.http_request("GET", "/v1/series/{uid}", 404, Duration::ZERO);
        metrics.set_free_disk_bytes(12);
        let text = metrics.encode();
        for line in [
            r#"triplanar_instances_total{sender="upload",outcome="stored"} 1"#,
            "triplanar_associations_open 1",
            r#"triplanar_jobs_total{state="failed"} 1"#,
            r#"triplanar_jobs_total{state="succeeded"} 0"#,
            "triplanar_queue_depth 3",
            r#"triplanar_slices_rejected_total{plane="axial",reason="solidity"} 7"#,
            r#"triplanar_verdicts_total{verdict="limited"} 1"#,
            r#"triplanar_stage_duration_seconds_count{stage="reading"} 1"#,
            r#"triplanar_http_requests_total{method="GET",route="/v1/series/{uid}",status="404"} 1"#,
            "triplanar_free_disk_bytes 12",
        ] {
            assert!(text.lines().any(|l| l == line), "{line} is missing in\n{text}");
        }
        assert!(!text.contains("superseded"), "a state in which no job ends");
    }
}
