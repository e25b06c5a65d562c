//! From the scan's own axes to the patient's: the nearest permutation and flips.

use super::slice::Slice;
use super::{Warning, WarningCode};
use crate::geometry::{Axis, Grid, Vec3, add, dot, scale};

/// The way each axis of the volume runs: z to the feet, y to the front, x to the patient's left.
const TOWARD: [Vec3; 3] = [[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]];
/// A scan whose axes are off the patient's by more than this is oblique, degrees.
const OBLIQUE: f64 = 1.0;

/// Which volume axis each scan axis becomes, and whether it runs the other way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Orientation {
    pub(super) slices: Target,
    pub(super) rows: Target,
    pub(super) columns: Target,
}

/// A volume axis and the way along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Target {
    pub(super) axis: Axis,
    pub(super) flipped: bool,
}

const AXES: [Axis; 3] = [Axis::Z, Axis::Y, Axis::X];
const PERMUTATIONS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

impl Orientation {
    /// The nearest one for scan axes along these unit vectors: of the next slice, the next row,
    /// the next column.
    pub(super) fn nearest(slices: Vec3, rows: Vec3, columns: Vec3) -> Self {
        let scan = [slices, rows, columns];
        let score = |permutation: &[usize; 3]| -> f64 {
            scan.iter().zip(permutation).map(|(axis, target)| dot(*axis, TOWARD[*target]).abs()).sum()
        };
        // The first of equals wins, so that an axis at 45 degrees goes the same way each time.
        let mut best = PERMUTATIONS[0];
        for permutation in PERMUTATIONS {
            if score(&permutation) > score(&best) + 1e-9 {
                best = permutation;
            }
        }
        let target = |axis: usize| Target {
            axis: AXES[best[axis]],
            flipped: dot(scan[axis], TOWARD[best[axis]]) < 0.0,
        };
        Self { slices: target(0), rows: target(1), columns: target(2) }
    }

    /// Whether a supine, head-first, axial scan is what it is: rows run to the back, columns to
    /// the left (PS3.3 section C.7.6.2.1.1). The way of the slices is told apart as descending.
    pub(super) fn is_usual(self) -> bool {
        self.slices.axis == Axis::Z
            && self.rows == Target { axis: Axis::Y, flipped: true }
            && self.columns == Target { axis: Axis::X, flipped: false }
    }
}

/// The grid of slices that are sorted in the order of the volume's axis.
pub(super) fn grid(slices: &[Slice], orientation: Orientation, rows: usize, columns: usize) -> Option<Grid> {
    let geometry = slices.first()?.geometry();
    let down = scale(geometry.down_column, geometry.row_spacing);
    let along = scale(geometry.along_row, geometry.column_spacing);
    let sign = |target: Target| if target.flipped { -1.0 } else { 1.0 };
    let to_last = |target: Target, step: Vec3, count: usize| {
        #[expect(clippy::cast_precision_loss)]
        if target.flipped { scale(step, (count - 1) as f64) } else { [0.0; 3] }
    };
    let corner = add(to_last(orientation.rows, down, rows), to_last(orientation.columns, along, columns));
    let origins = slices.iter().map(|slice| add(slice.geometry().position, corner)).collect();

    let mut step = [[0.0; 3]; 3];
    let mut shape = [0; 3];
    // A single slice has no step to the next; its normal stands for it.
    step[orientation.slices.axis as usize] = scale(geometry.normal(), sign(orientation.slices));
    step[orientation.rows.axis as usize] = scale(down, sign(orientation.rows));
    step[orientation.columns.axis as usize] = scale(along, sign(orientation.columns));
    shape[orientation.slices.axis as usize] = slices.len();
    shape[orientation.rows.axis as usize] = rows;
    shape[orientation.columns.axis as usize] = columns;
    Some(Grid::new(orientation.slices.axis, origins, step, shape))
}

/// Warns of an acquisition that is not the usual one.
pub(super) fn warn(orientation: Orientation, slice: &Slice, warnings: &mut Vec<Warning>) {
    let geometry = slice.geometry();
    if !orientation.is_usual() {
        let plane = match orientation.slices.axis {
            Axis::Z => "axial",
            Axis::Y => "coronal",
            Axis::X => "sagittal",
        };
        warnings.push(Warning::new(
            WarningCode::Reoriented,
            format!(
                "acquired in {plane} slices, rows {}, columns {}; brought into the patient's axes",
                way(orientation.rows),
                way(orientation.columns)
            ),
        ));
    }
    let off = [geometry.normal(), geometry.down_column, geometry.along_row]
        .into_iter()
        .map(|axis| {
            TOWARD.iter().map(|to| dot(axis, *to).abs()).fold(0.0, f64::max).min(1.0).acos().to_degrees()
        })
        .fold(0.0, f64::max);
    if off > OBLIQUE {
        warnings.push(Warning::new(
            WarningCode::Oblique,
            format!("the scan's axes are up to {off:.1} degrees off the patient's"),
        ));
    }
}

fn way(target: Target) -> &'static str {
    match (target.axis, target.flipped) {
        (Axis::Z, false) => "to the feet",
        (Axis::Z, true) => "to the head",
        (Axis::Y, false) => "to the front",
        (Axis::Y, true) => "to the back",
        (Axis::X, false) => "to the left",
        (Axis::X, true) => "to the right",
    }
}
