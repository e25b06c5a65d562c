//! The crates that would do our own steps otherwise, and a head to try both on.

use imageproc::contours::{BorderType, Contour, find_contours};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use triplanar::dicom::{SeriesIdentity, Volume};
use triplanar::geometry::{Axis, Grid};
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

/// An ellipsoid with skull, sinus and neck above a holder, with some noise.
pub(crate) fn head(shape: [usize; 3], spacing: [f64; 3]) -> Volume {
    let hu = ndarray::Array3::from_shape_fn(shape, |(z, y, x)| {
        let at = |i: usize, axis: usize| (i as f64 - shape[axis] as f64 / 2.0) * spacing[axis];
        let (x, y, z) = (at(x, 2), at(y, 1), at(z, 0));
        let noise = ((x * 12.9898 + y * 78.233 + z * 37.719).sin() * 43_758.547).fract() * 16.0;
        let r = (x / 75.0).hypot(y / 95.0).hypot((z - 5.0) / 80.0);
        let neck = x.hypot(y + 15.0) < 50.0 && z > 40.0;
        let sinus = x.hypot(y - 60.0).hypot(z - 30.0) < 15.0;
        let holder = ((x.hypot(y + 10.0) - 106.0).abs() < 1.5) && y < -40.0;
        let value = match r {
            _ if sinus => -1000.0,
            r if r < 0.88 => 40.0,
            r if r < 0.95 => 900.0,
            r if r < 1.0 => 20.0,
            _ if neck => 40.0,
            _ if holder => -100.0,
            _ => -1000.0,
        };
        (value + noise) as i16
    });
    let origins = (0..shape[0]).map(|z| [-115.0, 115.0, 90.0 - z as f64 * spacing[0]]).collect();
    let step = [[0.0, 0.0, -spacing[0]], [0.0, -spacing[1], 0.0], [spacing[2], 0.0, 0.0]];
    Volume {
        hu,
        grid: Grid::new(Axis::Z, origins, step, shape),
        sop_instance_uids: Vec::new(),
        identity: SeriesIdentity {
            study_instance_uid: None,
            series_instance_uid: "2.25.1".parse().expect("a UID"),
            frame_of_reference_uid: None,
        },
    }
}

/// The most memory that this process has held so far, or "unknown" off Linux.
pub(crate) fn peak_memory() -> String {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|status| Some(status.lines().find(|l| l.starts_with("VmHWM"))?.to_owned()))
        .unwrap_or_else(|| "unknown".to_owned())
}
