//! The pipeline's speed: `cargo bench --bench pipeline`.
//!
//! Beside each of our own steps stands, in the same run on the same input, the crate that would do
//! it otherwise, so that the choice can be checked on any machine. The peak memory of the whole
//! process up to the first reconstruction's end is printed (it includes making the phantom).

mod stopwatch;
mod twins;

use std::hint::black_box;

use stopwatch::timed;
use triplanar::dicom::Volume;
use triplanar::geometry::Plane;
use triplanar::observer::Silent;
use triplanar::phantom::{Options, Phantom};
use triplanar::pipeline::paper::contour::external_contours;
use triplanar::pipeline::paper::mask::mask;
use triplanar::pipeline::paper::{radius_outlier, statistical_outlier};
use triplanar::pipeline::{Parameters, reconstruct, slices};

/// 512 × 512 pixels of 0.45 mm, 280 slices of 0.625 mm.
fn volume() -> Volume {
    let options = Options { slices: 280, slice_mm: 0.625, ..Options::default() };
    Phantom::new(options).expect("options within their ranges").volume()
}

fn main() {
    let volume = volume();
    whole(&volume);
    contours(&volume);
    outliers(&volume);
}

fn whole(volume: &Volume) {
    println!("volume to cloud, 512 x 512 x 280, leaf 1");
    let run = |parameters: &Parameters| reconstruct(volume, parameters, &Silent).expect("a head");
    let (paper, precise) = (Parameters::paper(), Parameters::precise());
    let started = std::time::Instant::now();
    let points = run(&paper).triplanar.len();
    println!("  first run: {points} points, {:?}, peak memory {}", started.elapsed(), twins::peak_memory());
    timed("paper", 10, || run(&paper));
    timed("precise", 10, || run(&precise));
}

fn contours(volume: &Volume) {
    println!("external contours of a slice");
    let slice = slices::view(&volume.hu, Plane::Axial, 140).expect("the middle slice");
    let mask = mask(slice, &Parameters::paper());
    timed("ours", 1000, || external_contours(&mut black_box(mask.clone())));
    let image = twins::padded_image(&mask);
    timed("imageproc", 1000, || twins::imageproc_contours(black_box(&image)));
}

fn outliers(volume: &Volume) {
    println!("outliers of a cloud");
    let mut parameters = Parameters::paper();
    parameters.radius_outlier.min_neighbours = 0;
    parameters.statistical_outlier.neighbours = 0;
    let cloud = reconstruct(volume, &parameters, &Silent).expect("a head").triplanar;
    let defaults = Parameters::paper();
    let (points, radius) = (&cloud.points, &defaults.radius_outlier);
    timed("radius: ours", 10, || radius_outlier::kept(black_box(points), radius, &Silent));
    timed("radius: kiddo", 10, || twins::kiddo_radius(black_box(points), radius));
    let statistical = &defaults.statistical_outlier;
    timed("statistical: ours", 10, || statistical_outlier::kept(black_box(points), statistical, &Silent));
}
