//! The crates that would do our own steps otherwise, and this process's memory.

use imageproc::contours::{BorderType, Contour, find_contours};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use triplanar::pipeline::Bitmap;
use triplanar::pipeline::parameters::RadiusOutlier;

/// The picture as imageproc wants it, with a black frame: it misses borders at the image's edge.
pub(crate) fn padded_image(bitmap: &Bitmap) -> image::GrayImage {
    let (width, height) = (bitmap.width() as u32, bitmap.height() as u32);
    image::GrayImage::from_fn(width + 2, height + 2, |x, y| {
        let inside = (1..=width).contains(&x) && (1..=height).contains(&y);
        let white = inside && bitmap.is_white(y as usize - 1, x as usize - 1);
        image::Luma([if white { 255 } else { 0 }])
    })
}

/// The outermost borders.
pub(crate) fn imageproc_contours(image: &image::GrayImage) -> Vec<Contour<u32>> {
    let mut contours = find_contours(image);
    contours.retain(|c| c.border_type == BorderType::Outer && c.parent.is_none());
    contours
}

/// Radius outlier removal by kiddo.
pub(crate) fn kiddo_radius(points: &[[f32; 3]], filter: &RadiusOutlier) -> Vec<bool> {
    let tree = ImmutableKdTree::<f32, 3>::new_from_slice(points).expect("finite points");
    let squared = filter.radius_mm * filter.radius_mm;
    let near = |point| tree.query(point).within::<SquaredEuclidean<f32>>(squared).unsorted().execute();
    use rayon::prelude::*;
    points.par_iter().map(|point| near(point).len() > filter.min_neighbours as usize).collect()
}

/// The most memory that this process has held so far, or "unknown" off Linux.
pub(crate) fn peak_memory() -> String {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|status| Some(status.lines().find(|l| l.starts_with("VmHWM"))?.to_owned()))
        .unwrap_or_else(|| "unknown".to_owned())
}
