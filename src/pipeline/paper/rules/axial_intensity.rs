//! Test 8: contour pixels of an axial slice that have black beside them again and again show
//! inner structures (paper, section 2.2, pixel counting filter).

use serde::{Deserialize, Serialize};

use crate::geometry::Plane;
use crate::pipeline::paper::bitmap::{BLACK, Bitmap, CONTOUR};
use crate::pipeline::paper::contour::Outline;
use crate::pipeline::parameters::Thresholds;
use crate::pipeline::result::{Reason, Rejection};

/// Axial contours larger than `min_area`: rows from 0 to half the height, walked from the right
/// edge to the left. At every contour pixel at least `gap` columns from the last one, the mean
/// intensity of the filled picture over `window` columns to the right is looked at: below
/// `min_intensity` a count goes up by one, otherwise it goes down by `relief` (to 0 at least). A
/// row whose count ends at `count` or more is bad, and `bad_rows` of them reject.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AxialIntensityThresholds {
    /// px² (published program: 15000).
    pub min_area: f64,
    /// Every so many rows, px (published program: 8).
    #[schema(minimum = 1)]
    pub row_step: u32,
    /// Columns between two contour pixels, px (published program: 2).
    pub gap: u32,
    /// Columns of the mean, px (published program: 5).
    #[schema(minimum = 1)]
    pub window: u32,
    /// Mean intensity, black 0, white 255 (published program: 170).
    pub min_intensity: u32,
    /// The count goes down by so much (published program: 2).
    pub relief: u32,
    /// A row is bad if its count ends at so much (published program: 1).
    pub count: u32,
    /// So many bad rows reject (published program: 5).
    pub bad_rows: u32,
}

impl Default for AxialIntensityThresholds {
    fn default() -> Self {
        Self {
            min_area: 15_000.0,
            row_step: 8,
            gap: 2,
            window: 5,
            min_intensity: 170,
            relief: 2,
            count: 1,
            bad_rows: 5,
        }
    }
}

pub(super) fn test(outline: &Outline, thresholds: &Thresholds) -> Option<Rejection> {
    let limits = &thresholds.axial_intensity;
    if outline.plane != Plane::Axial || outline.contour.area <= limits.min_area {
        return None;
    }
    let picture = &outline.picture;
    let bad_rows = (0..=picture.height() / 2)
        .step_by(limits.row_step.max(1) as usize)
        .filter(|&row| is_bad(picture, row, limits))
        .count();
    (bad_rows >= limits.bad_rows as usize)
        .then(|| Rejection::count(Reason::AxialIntensity, bad_rows, limits.bad_rows))
}

fn is_bad(picture: &Bitmap, row: usize, limits: &AxialIntensityThresholds) -> bool {
    let pixels = picture.row(row);
    let mut last: Option<usize> = None;
    let mut count = 0_u32;
    for column in (0..pixels.len()).rev() {
        let is_near = last.is_some_and(|last| last - column < limits.gap as usize);
        if pixels[column] != CONTOUR || is_near {
            continue;
        }
        last = Some(column);
        let end = (column + limits.window.max(1) as usize).min(pixels.len());
        if mean_intensity(&pixels[column..end]) < limits.min_intensity as usize {
            count += 1;
        } else {
            count = count.saturating_sub(limits.relief);
        }
    }
    count >= limits.count
}

fn mean_intensity(pixels: &[u8]) -> usize {
    let white = pixels.iter().filter(|&&p| p != BLACK).count();
    white * 255 / pixels.len()
}
