//! The `precise` profile: the whole skin, in its true place, on any head CT.
//!
//! It keeps the paper's approach, three planes and a reason for what is left out, and replaces its
//! fixed thresholds by what the scan itself shows, as the paper's section 5 proposes for future
//! work. One file a step:
//!
//! | step | module |
//! |---|---|
//! | the scan as a field in mm | `space`, `levels`, `ends`, `field` |
//! | cells for the search in 3D | `crop`, `survey`, `rows`, `reach`, `pieces` |
//! | which tissue is the patient | `kinds`, `couch`, `patient`, `enclosure`, `large`, `sheets`, `parts`, `head` |
//! | which border is skin | `outside`, `openings`, `canals` |
//! | where exactly | `candidates`, `width`, `plateau`, `regions`, `crossings`, `edge`, `parted` |
//! | what lies on it | `surface`, `fill`, `ledges`, `covered` |
//! | between thick slices | `between`, `contours`, `caps` |
//! | what was not accepted | `stretches` |
//! | one point a leaf | `cubes`, `leaves`, `order` |
//! | how far to trust it | `agreement`, `confidence`, `motion`, `assess`, `quality` |

mod agreement;
mod assess;
mod between;
mod canals;
mod candidates;
mod caps;
mod confidence;
mod contours;
mod couch;
mod covered;
mod crop;
mod crossings;
mod cubes;
mod edge;
mod enclosure;
mod ends;
mod field;
mod fill;
mod head;
mod kinds;
mod large;
mod leaves;
mod ledges;
mod levels;
mod motion;
mod openings;
mod order;
mod outside;
mod parted;
mod parts;
mod patient;
mod pieces;
mod plateau;
mod quality;
mod reach;
mod reconstruct;
pub(crate) mod reconstruction;
mod regions;
mod rows;
mod sheets;
mod sides;
mod skin;
mod space;
mod stretches;
mod surface;
mod survey;
mod width;

pub use quality::{Doubt, Missing, Quality, QualityLimits, SideQuality, Verdict};
pub use reconstruct::reconstruct;
pub use sides::Side;
pub use skin::{BorderPoint, NoSkin, Skin, SkinPoint};
pub use stretches::{SliceContour, Stretch, StretchReason};

#[cfg(test)]
mod tests;
