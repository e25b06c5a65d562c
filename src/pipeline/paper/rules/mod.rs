//! The tests that a slice must pass (paper, section 2.2), one file each, in the order of the
//! published program; the first that fails rejects the slice.
//!
//! **A new rejection rule** is a file here with its thresholds and its `test`, a variant of
//! [`Reason`](crate::pipeline::Reason), a field of [`Thresholds`], and a line in one of
//! the three lists below.

mod area_jump;
mod area_over;
mod axial_intensity;
mod axial_mid_left;
mod four_direction;
mod last_row;
mod lower_band;
mod row_crossings;
mod row_crossings_lower;
mod row_crossings_upper;
mod solidity;
mod solidity_after_jump;
#[cfg(test)]
mod tests;

pub use area_jump::AreaJumpThresholds;
pub use area_over::AreaOverThresholds;
pub use axial_intensity::AxialIntensityThresholds;
pub use axial_mid_left::AxialMidLeftThresholds;
pub use four_direction::FourDirectionThresholds;
pub use last_row::LastRowThresholds;
pub use lower_band::LowerBandThresholds;
pub use row_crossings_lower::RowCrossingsLowerThresholds;
pub use row_crossings_upper::RowCrossingsUpperThresholds;
pub use solidity::SolidityThresholds;
pub use solidity_after_jump::SolidityAfterJumpThresholds;

use super::contour::Outline;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::Rejection;

/// A test of one slice by itself.
type Rule = fn(&Outline, &Thresholds) -> Option<Rejection>;
/// A test against the area carried from the slices before, px².
type JumpRule = fn(&Measures, f64, &Thresholds) -> Option<Rejection>;

/// Tests of every slice, before its area is compared with the carried one.
const BEFORE: [Rule; 1] = [solidity::test];
/// Tests of a slice whose area jumped: those that look at the slice alone,
const ON_JUMP: [Rule; 1] = [four_direction::test];
/// and those that look at the areas.
const ON_JUMP_BY_AREA: [JumpRule; 3] = [area_over::test, area_jump::test, solidity_after_jump::test];
/// Tests of every slice whose area has become the carried one.
const AFTER: [Rule; 6] = [
    row_crossings_upper::test,
    row_crossings_lower::test,
    axial_intensity::test,
    lower_band::test,
    last_row::test,
    axial_mid_left::test,
];

/// What is measured on a slice's contour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measures {
    /// Area, px².
    pub area: f64,
    /// Area / area of the convex hull.
    pub solidity: f64,
}

/// What a slice's tests say, as far as they need no other slice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Findings {
    /// What was measured.
    pub measures: Measures,
    before: Option<Rejection>,
    on_jump: Option<Rejection>,
    after: Option<Rejection>,
}

impl Findings {
    /// Runs every test that needs no other slice.
    #[must_use]
    pub fn of(outline: &Outline, thresholds: &Thresholds) -> Self {
        let first = |rules: &[Rule]| rules.iter().find_map(|rule| rule(outline, thresholds));
        Self {
            measures: Measures { area: outline.contour.area, solidity: outline.contour.solidity },
            before: first(&BEFORE),
            on_jump: first(&ON_JUMP),
            after: first(&AFTER),
        }
    }
}

/// The area carried from slice to slice of one plane, px². `None` until a slice has a contour.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CarriedArea(pub Option<f64>);

impl CarriedArea {
    /// The state that the slice's area is compared with: the first slice that has a contour brings
    /// its own.
    pub fn start(&mut self, measures: &Measures) -> f64 {
        *self.0.get_or_insert(measures.area)
    }

    /// The decision on the next slice of the plane; `None` accepts it. A rejection up to the tests
    /// after a jump leaves the carried area as it is.
    pub fn decide(&mut self, findings: &Findings, thresholds: &Thresholds) -> Option<Rejection> {
        let measures = &findings.measures;
        let carried = self.start(measures);
        if findings.before.is_some() {
            return findings.before;
        }
        if thresholds.area_jump.is_jump(measures.area, carried) {
            let by_area = || ON_JUMP_BY_AREA.iter().find_map(|rule| rule(measures, carried, thresholds));
            let rejection = findings.on_jump.or_else(by_area);
            if rejection.is_some() {
                return rejection;
            }
        }
        self.0 = Some(measures.area);
        findings.after
    }
}
