//! The paper's evaluation of one cloud.

use serde::Serialize;

use super::icp::{self, Registration, Settings};
use super::{Coverage, Distances, Shape, Sign, Target, Unique};
use crate::geometry::Vec3;

/// Nothing to measure, or nothing to measure to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{0} holds no usable point; check the file and how it was made")]
pub struct Empty(pub &'static str);

/// A cloud held against the truth and against the axial cloud.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// Points of the cloud.
    pub points: usize,
    /// Where the signs of distances come from.
    pub sign: Sign,
    /// What the cloud has over the axial one, if that was given.
    pub over_axial: Option<OverAxial>,
    /// How much of the truth the cloud covers.
    pub coverage: Coverage,
    /// From the cloud's points to the truth, without registration.
    pub distances: Distances,
    /// Of the cloud onto the truth; `None` for fewer than 4 points.
    pub registration: Option<Registration>,
}

/// What a cloud has over the axial cloud (paper, section 3.2).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OverAxial {
    /// Points of the axial cloud.
    pub axial_points: usize,
    /// Points of the cloud less those of the axial one.
    pub additional: i64,
    /// `additional` over the axial cloud's points.
    pub additional_share: f64,
    /// Points of the cloud without an axial one within 1 mm.
    pub unique: Unique,
    /// How much of the truth the axial cloud alone covers.
    pub axial_coverage: Coverage,
}

/// Measures the points of `cloud` against `truth` and, if given, the points of `axial`; all LPS mm.
///
/// # Errors
/// [`Empty`] if one of them has no point.
pub fn evaluate(
    cloud: &[Vec3],
    truth: &Shape,
    axial: Option<&[Vec3]>,
    settings: Settings,
) -> Result<Evaluation, Empty> {
    let target = Target::new(truth).ok_or(Empty("the truth"))?;
    let own = target_of(cloud).ok_or(Empty("the cloud"))?;
    let distances = Distances::new(&target.nearest(cloud, &[])).ok_or(Empty("the cloud"))?;
    let over_axial = axial.map(|axial| over_axial(cloud, axial, &target)).transpose()?;
    Ok(Evaluation {
        points: cloud.len(),
        sign: target.sign(),
        over_axial,
        coverage: Coverage::new(&target, &own),
        distances,
        registration: icp::register(cloud, &target, settings),
    })
}

pub(super) fn target_of(points: &[Vec3]) -> Option<Target> {
    Target::new(&Shape::cloud(points.to_vec()))
}

fn over_axial(cloud: &[Vec3], axial: &[Vec3], truth: &Target) -> Result<OverAxial, Empty> {
    let own = target_of(axial).ok_or(Empty("the axial cloud"))?;
    let signed = |count: usize| i64::try_from(count).unwrap_or(i64::MAX);
    let additional = signed(cloud.len()) - signed(axial.len());
    Ok(OverAxial {
        axial_points: axial.len(),
        additional,
        additional_share: additional as f64 / axial.len() as f64,
        unique: Unique::new(cloud, axial),
        axial_coverage: Coverage::new(truth, &own),
    })
}

#[cfg(test)]
mod tests;
