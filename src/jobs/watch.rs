//! One running attempt as seen from both sides: the pipeline's threads report progress and ask
//! whether to stop; the worker reads the progress and says stop.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use super::events::{Event, Hub};
use super::progress::overall;
use crate::observer::{Observer, Stage};
use crate::pipeline::Profile;
use crate::store::{ReconstructionId, ReconstructionState};
use crate::telemetry::Metrics;

/// Progress within a stage is told to subscribers at most this often.
const EVENT_INTERVAL: Duration = Duration::from_millis(250);

/// Why an attempt must stop before its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// Somebody cancelled the reconstruction.
    Cancelled,
    /// Another worker holds it now, or it was removed.
    Lost,
    /// `jobs.timeout` has passed.
    TimedOut,
    /// The service is shutting down.
    ShuttingDown,
}

#[derive(Debug)]
struct Progress {
    stage: Stage,
    fraction: f64,
    stage_began: Instant,
    told: Instant,
}

/// One attempt.
#[derive(Debug)]
pub(super) struct Watch {
    id: ReconstructionId,
    profile: Profile,
    hub: Arc<Hub>,
    metrics: Arc<Metrics>,
    deadline: Instant,
    progress: Mutex<Progress>,
    stop: OnceLock<Stop>,
}

impl Watch {
    /// An attempt that begins now.
    pub(super) fn new(
        id: ReconstructionId,
        profile: Profile,
        hub: Arc<Hub>,
        metrics: Arc<Metrics>,
        timeout: Duration,
    ) -> Self {
        let now = Instant::now();
        let progress = Progress { stage: Stage::Reading, fraction: 0.0, stage_began: now, told: now };
        let watch = Self {
            id,
            profile,
            hub,
            metrics,
            deadline: now + timeout,
            progress: Mutex::new(progress),
            stop: OnceLock::new(),
        };
        watch.tell(Stage::Reading, 0.0);
        watch
    }

    /// Asks the attempt to stop; the first reason counts.
    pub(super) fn stop(&self, why: Stop) {
        let _an_earlier_reason_stands = self.stop.set(why);
    }

    /// Why it was asked to stop, if it was.
    pub(super) fn stopped(&self) -> Option<Stop> {
        self.stop.get().copied()
    }

    /// The stage that runs and the part of the whole that is done.
    pub(super) fn now(&self) -> (Stage, f64) {
        let progress = self.lock();
        (progress.stage, overall(self.profile, progress.stage, progress.fraction))
    }

    /// The last stage has ended.
    pub(super) fn ended(&self) {
        let progress = self.lock();
        self.metrics.stage_ended(progress.stage, progress.stage_began.elapsed());
    }

    fn tell(&self, stage: Stage, fraction: f64) {
        self.hub.publish(Event {
            id: self.id,
            state: ReconstructionState::Running,
            stage: Some(stage),
            fraction: overall(self.profile, stage, fraction),
        });
    }

    fn lock(&self) -> MutexGuard<'_, Progress> {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Observer for Watch {
    fn progress(&self, stage: Stage, fraction: f64) {
        let now = Instant::now();
        let mut progress = self.lock();
        // The threads of a stage report out of order, and late ones may speak of an earlier stage.
        let further = (stage, fraction) > (progress.stage, progress.fraction);
        if !further {
            return;
        }
        let next_stage = stage > progress.stage;
        if next_stage {
            self.metrics.stage_ended(progress.stage, now - progress.stage_began);
            progress.stage_began = now;
        }
        (progress.stage, progress.fraction) = (stage, fraction);
        if next_stage || now - progress.told >= EVENT_INTERVAL {
            progress.told = now;
            self.tell(stage, fraction);
        }
    }

    fn cancelled(&self) -> bool {
        if Instant::now() >= self.deadline {
            self.stop(Stop::TimedOut);
        }
        self.stop.get().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watch(timeout: Duration) -> (Watch, Arc<Hub>) {
        let hub = Arc::new(Hub::default());
        (Watch::new(ReconstructionId::new(), Profile::Paper, Arc::clone(&hub), Arc::default(), timeout), hub)
    }

    #[test]
    fn every_stage_is_told_and_late_threads_do_not_turn_it_back() {
        let (watch, hub) = watch(Duration::from_secs(60));
        let mut events = hub.subscribe(watch.id);
        watch.progress(Stage::Axial, 0.5);
        watch.progress(Stage::Reading, 0.9);
        watch.progress(Stage::Axial, 0.1);
        watch.progress(Stage::Sagittal, 0.0);
        let told: Vec<_> = std::iter::from_fn(|| events.try_recv().ok()).map(|e| e.stage.unwrap()).collect();
        assert_eq!(told, [Stage::Axial, Stage::Sagittal]);
        assert_eq!(watch.now().0, Stage::Sagittal);
    }

    #[test]
    fn an_attempt_past_its_deadline_is_stopped_as_timed_out() {
        let (watch, _hub) = watch(Duration::ZERO);
        assert!(watch.cancelled());
        watch.stop(Stop::ShuttingDown);
        assert_eq!(watch.stopped(), Some(Stop::TimedOut));
    }
}
