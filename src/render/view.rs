//! Where the viewer stands.

use crate::geometry::{Vec3, cross, dot};

/// A side to look from, along an axis of the patient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// At the face; the patient's left is at the picture's right.
    Front,
    /// At the patient's left ear; the face is at the picture's left.
    Left,
    /// At the patient's right ear; the face is at the picture's right.
    Right,
    /// At the back of the head; the patient's left is at the picture's left.
    Back,
    /// Down at the vertex, the face upward; the patient's left is at the picture's left.
    Top,
}

impl View {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Front, Self::Left, Self::Right, Self::Back, Self::Top];

    /// The name on the command line and in captions.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Left => "left",
            Self::Right => "right",
            Self::Back => "back",
            Self::Top => "top",
        }
    }

    /// Unit vectors to the viewer and up in the picture, LPS.
    fn axes(self) -> [Vec3; 2] {
        const SUPERIOR: Vec3 = [0.0, 0.0, 1.0];
        match self {
            Self::Front => [[0.0, -1.0, 0.0], SUPERIOR],
            Self::Left => [[1.0, 0.0, 0.0], SUPERIOR],
            Self::Right => [[-1.0, 0.0, 0.0], SUPERIOR],
            Self::Back => [[0.0, 1.0, 0.0], SUPERIOR],
            Self::Top => [SUPERIOR, [0.0, -1.0, 0.0]],
        }
    }

    /// A vector in the picture's axes: right, up, to the viewer.
    #[must_use]
    pub fn project(self, v: Vec3) -> Vec3 {
        let [viewer, up] = self.axes();
        [dot(cross(up, viewer), v), dot(up, v), dot(viewer, v)]
    }

    /// The letters of the patient's directions at the picture's left and right.
    pub(super) fn sides(self) -> [char; 2] {
        match self {
            Self::Front => ['R', 'L'],
            Self::Left => ['A', 'P'],
            Self::Right => ['P', 'A'],
            Self::Back | Self::Top => ['L', 'R'],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_letters_stand_where_the_directions_lead() {
        for view in View::ALL {
            for (letter, side) in view.sides().into_iter().zip([-1.0, 1.0]) {
                let direction = match letter {
                    'L' => [1.0, 0.0, 0.0],
                    'R' => [-1.0, 0.0, 0.0],
                    'P' => [0.0, 1.0, 0.0],
                    'A' => [0.0, -1.0, 0.0],
                    other => panic!("{other}"),
                };
                assert_eq!(view.project(direction), [side, 0.0, 0.0], "{letter} seen from {}", view.name());
            }
        }
    }

    #[test]
    fn what_is_near_the_viewer_is_what_the_view_is_called_after() {
        let towards = |view: View, v: Vec3| assert_eq!(view.project(v)[2], 1.0, "{}", view.name());
        towards(View::Front, [0.0, -1.0, 0.0]);
        towards(View::Left, [1.0, 0.0, 0.0]);
        towards(View::Right, [-1.0, 0.0, 0.0]);
        towards(View::Back, [0.0, 1.0, 0.0]);
        towards(View::Top, [0.0, 0.0, 1.0]);
    }
}
