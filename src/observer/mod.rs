//! How long work tells how far it is, and is told to stop: what reads a series ([`crate::dicom`]) and what
//! reconstructs it ([`crate::pipeline`]) are watched alike.

mod stage;
pub(crate) mod stop;

pub use stage::Stage;

/// Watches a reconstruction from outside. Called from several threads.
pub trait Observer: Sync {
    /// `fraction` of `stage` is done, 0 to 1.
    fn progress(&self, stage: Stage, fraction: f64);
    /// Whether the work should stop now; asked at least once a slice.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Nobody watches.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {
    fn progress(&self, _: Stage, _: f64) {}
}
