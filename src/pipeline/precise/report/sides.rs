//! The sides of a head, as seen from the middle of its brain.

use serde::{Deserialize, Serialize};

use crate::geometry::{Vec3, sub};

/// Where on the head something is: the patient axis along which it lies furthest from the middle of
/// the brain.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The face.
    Anterior,
    /// The back of the head.
    Posterior,
    /// The patient's left.
    Left,
    /// The patient's right.
    Right,
    /// The vertex.
    Superior,
    /// Chin, neck and what is below.
    Inferior,
}

impl Side {
    /// All sides.
    pub const ALL: [Self; 6] =
        [Self::Anterior, Self::Posterior, Self::Left, Self::Right, Self::Superior, Self::Inferior];

    /// The side on which a place lies (LPS mm), seen from `middle`.
    pub(crate) fn of(p: Vec3, middle: Vec3) -> Self {
        let d = sub(p, middle);
        let along = |axis: usize, positive: Self, negative: Self| {
            (d[axis].abs(), if d[axis] >= 0.0 { positive } else { negative })
        };
        let axes = [
            along(0, Self::Left, Self::Right),
            along(1, Self::Posterior, Self::Anterior),
            along(2, Self::Superior, Self::Inferior),
        ];
        let furthest = axes.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
        furthest.map_or(Self::Superior, |f| f.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nose_is_anterior_and_the_left_ear_on_the_left() {
        let middle = [3.0, 20.0, 50.0];
        assert_eq!(Side::of([5.0, -80.0, 10.0], middle), Side::Anterior);
        assert_eq!(Side::of([80.0, 25.0, 30.0], middle), Side::Left);
        assert_eq!(Side::of([-70.0, 25.0, 30.0], middle), Side::Right);
        assert_eq!(Side::of([0.0, 40.0, 140.0], middle), Side::Superior);
    }
}
