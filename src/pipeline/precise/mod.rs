//! The `precise` profile: the whole skin, in its true place, on any head CT.
//!
//! It keeps the paper's approach, three planes and a reason for what is left out, and replaces its
//! fixed thresholds by what the scan itself shows, as the paper's section 5 proposes for future
//! work. Five stages, each handing its result to the next (`run.rs`):
//!
//! | stage | folder | what it tells |
//! |---|---|---|
//! | scan | `scan/` | the scan as a field in mm: places, levels, field of view |
//! | labels | `labels/` | what each cell of 1 mm is: patient, device, air outside, canal |
//! | border | `border/` | every crossing of the patient's border with a grid line, measured |
//! | verdicts | `rules/` | which of them is skin, and why another is none |
//! | skin | `cloud/`, `confidence/`, `report/` | a point for each leaf, its error, what to make of it |
//!
//! `grid/` is geometry that knows no anatomy; all of them build on it. `dump/` writes what the stages hand
//! on, to be looked at in other programs.

mod border;
mod cloud;
mod confidence;
mod dump;
mod grid;
mod labels;
mod no_skin;
mod reason;
pub(crate) mod reconstruction;
mod report;
mod rules;
mod run;
mod scan;
mod skin;

pub use cloud::point::SkinPoint;
pub use no_skin::NoSkin;
pub use reason::StretchReason;
pub use report::border::BorderPoint;
pub use report::quality::{Doubt, Missing, Quality, QualityLimits, SideQuality, Verdict};
pub use report::sides::Side;
pub use report::stretches::{SliceContour, Stretch};
pub use run::reconstruct;
pub use skin::Skin;
