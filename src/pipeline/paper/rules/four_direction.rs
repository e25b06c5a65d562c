//! Test 2: after a jump of the area, no tissue may lie outside the contour straight below, above,
//! right or left of its centroid (paper, section 2.2, Algorithm 3).

use serde::{Deserialize, Serialize};

use crate::pipeline::paper::contour::{Outline, polygon};
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};
use crate::pipeline::slices::Pixel;

/// How finely the four rays are walked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FourDirectionThresholds {
    /// px between two positions of a ray (published program: 2).
    #[schema(minimum = 1)]
    pub step: u32,
}

impl Default for FourDirectionThresholds {
    fn default() -> Self {
        Self { step: 2 }
    }
}

pub(super) fn test(outline: &Outline, thresholds: &Thresholds) -> Option<Rejection> {
    let step = thresholds.four_direction.step.max(1) as usize;
    let (width, height) = (outline.picture.width(), outline.picture.height());
    let [x, y] = outline.contour.centroid;
    // The centroid of a polygon whose points were cut off need not lie in the picture.
    let (column, row) = (truncated(x, width)?, truncated(y, height)?);

    let vertical = Crossings::of(&outline.contour.pixels, x, |p| (p.column, p.row));
    let horizontal = Crossings::of(&outline.contour.pixels, y, |p| (p.row, p.column));
    let in_column = |&r: &usize| outline.picture.is_white(r, column) && vertical.is_outside(r);
    let in_row = |&c: &usize| outline.picture.is_white(row, c) && horizontal.is_outside(c);

    let down = (row..height).step_by(step).filter(in_column).count();
    let up = (0..=row).rev().step_by(step).filter(in_column).count();
    let right = (column..width).step_by(step).filter(in_row).count();
    let left = (0..=column).rev().step_by(step).filter(in_row).count();
    [
        (Reason::FourDirectionDown, down),
        (Reason::FourDirectionUp, up),
        (Reason::FourDirectionRight, right),
        (Reason::FourDirectionLeft, left),
    ]
    .into_iter()
    .find(|&(_, outside)| outside > 0)
    .map(|(reason, outside)| Rejection::count(reason, outside, 0))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to lie within")]
fn truncated(value: f32, length: usize) -> Option<usize> {
    let index = value.trunc();
    (index >= 0.0 && (index as usize) < length).then_some(index as usize)
}

/// Where a straight line crosses a polygon.
///
/// One pass over the polygon answers for every position on the line, where an even–odd test of
/// each position would take a pass each.
pub(super) struct Crossings {
    /// Places of the crossings along the line, ascending.
    places: Vec<f64>,
    /// Stretches along which the polygon runs on the line or touches it.
    touching: Vec<(f64, f64)>,
}

impl Crossings {
    /// The line lies at `at`; `axes` gives a pixel's coordinate across the line and along it.
    pub(super) fn of(polygon: &[Pixel], at: f32, axes: impl Fn(Pixel) -> (u32, u32)) -> Self {
        let at = f64::from(at);
        let mut places = Vec::new();
        let mut touching = Vec::new();
        for (p, q) in polygon::edges(polygon) {
            let ((across_p, along_p), (across_q, along_q)) = (axes(p), axes(q));
            let [ap, lp, aq, lq] = [across_p, along_p, across_q, along_q].map(f64::from);
            if (ap <= at) != (aq <= at) {
                places.push(lp + (at - ap) * (lq - lp) / (aq - ap));
            }
            if aq == at {
                let from = if ap == at { lp } else { lq };
                touching.push((from.min(lq), from.max(lq)));
            }
        }
        places.sort_by(f64::total_cmp);
        Self { places, touching }
    }

    /// Strictly outside by the even–odd rule: a position on the polygon is not.
    #[expect(clippy::cast_precision_loss, reason = "a picture's side")]
    pub(super) fn is_outside(&self, position: usize) -> bool {
        let position = position as f64;
        let before = self.places.partition_point(|&place| place < position);
        let is_on_crossing = self.places.get(before) == Some(&position);
        before % 2 == 0
            && !is_on_crossing
            && !self.touching.iter().any(|&(from, to)| from <= position && position <= to)
    }
}
