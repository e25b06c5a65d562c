//! What the colours say.

use super::ramp::ramp;
use super::{Options, Subject, View};
use crate::geometry::{Plane, PlaneSet, Vec3};

/// What the colour of a point stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colouring {
    /// The property `expected_error_mm`.
    Error,
    /// The property `planes`: in which planes the point was found.
    Plane,
    /// The direction of the surface.
    Normal,
    /// The place along the patient's axis.
    Height,
}

/// Where a file does not say it.
pub(super) const UNKNOWN: [f32; 3] = [176.0, 178.0, 184.0];

impl Colouring {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Error, Self::Plane, Self::Normal, Self::Height];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Plane => "plane",
            Self::Normal => "normal",
            Self::Height => "height",
        }
    }

    /// The property of the points that says it, for those that a file must have.
    #[must_use]
    pub fn property(self) -> Option<&'static str> {
        match self {
            Self::Error => Some("expected_error_mm"),
            Self::Plane => Some("planes"),
            Self::Normal | Self::Height => None,
        }
    }
}

/// Lowest and highest place along the patient's axis of all clouds, mm.
pub(super) fn heights(subjects: &[Subject<'_>]) -> [f64; 2] {
    let all = subjects.iter().flat_map(|subject| &subject.shape.points).map(|p| p[2]);
    all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)])
}

/// The colour of each point, 0 to 255. `normals` are outward, one for each point.
pub(super) fn colours(
    subject: &Subject<'_>,
    normals: &[Vec3],
    heights: [f64; 2],
    options: &Options,
) -> Vec<[f32; 3]> {
    let points = &subject.shape.points;
    let by_property = |colour: &dyn Fn(f32) -> [f32; 3]| {
        let values = options.colouring.property().and_then(|name| subject.shape.property(name));
        values
            .map_or_else(|| vec![UNKNOWN; points.len()], |values| values.iter().map(|v| colour(*v)).collect())
    };
    match options.colouring {
        Colouring::Error => by_property(&|error| {
            if error.is_finite() { ramp(error / options.max_error_mm) } else { UNKNOWN }
        }),
        Colouring::Plane => by_property(&|bits| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
            plane_colour(PlaneSet::from_bits(bits as u8))
        }),
        Colouring::Normal => normals.iter().map(|normal| direction_colour(*normal)).collect(),
        Colouring::Height => points.iter().map(|p| height_colour(p[2], heights)).collect(),
    }
}

/// Light of each plane's colour, added up.
pub(super) fn plane_colour(planes: PlaneSet) -> [f32; 3] {
    let is_in = Plane::ALL.map(|plane| planes.contains(plane));
    match is_in {
        [true, false, false] => [216.0, 70.0, 62.0],
        [false, true, false] => [60.0, 158.0, 78.0],
        [false, false, true] => [58.0, 104.0, 206.0],
        [true, true, false] => [232.0, 184.0, 52.0],
        [true, false, true] => [178.0, 78.0, 186.0],
        [false, true, true] => [58.0, 182.0, 196.0],
        [true, true, true] => [222.0, 220.0, 212.0],
        [false, false, false] => UNKNOWN,
    }
}

/// Left and right, posterior and anterior, superior and inferior as red, green and blue.
pub(super) fn direction_colour(normal: Vec3) -> [f32; 3] {
    #[expect(clippy::cast_possible_truncation, reason = "between 0 and 255")]
    normal.map(|c| (127.5 * (c + 1.0)) as f32)
}

fn height_colour(z: f64, [low, high]: [f64; 2]) -> [f32; 3] {
    #[expect(clippy::cast_possible_truncation, reason = "a share")]
    ramp(((z - low) / (high - low).max(1e-9)) as f32)
}

/// The colours of the directions that are seen in the legend.
pub(super) fn directions() -> [(&'static str, Vec3); 6] {
    [
        ("left", [1.0, 0.0, 0.0]),
        ("right", [-1.0, 0.0, 0.0]),
        ("posterior", [0.0, 1.0, 0.0]),
        ("anterior", [0.0, -1.0, 0.0]),
        ("superior", [0.0, 0.0, 1.0]),
        ("inferior", [0.0, 0.0, -1.0]),
    ]
}

/// Normals in the picture's axes.
pub(super) fn seen(normals: &[Vec3], view: View) -> Vec<Vec3> {
    normals.iter().map(|normal| view.project(*normal)).collect()
}
