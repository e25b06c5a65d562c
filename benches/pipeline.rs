//! The pipeline's speed: `cargo bench --bench pipeline`.
//!
//! Beside each of our own steps stands, in the same run on the same input, the crate that would do
//! it otherwise, so that the choice can be checked on any machine. The peak memory of the whole
//! process up to the first reconstruction's end is printed (it includes making the phantom).

mod twins;

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use triplanar::dicom::Volume;
use triplanar::geometry::Plane;
use triplanar::phantom::{Options, Phantom};
use triplanar::pipeline::contour::external_contours;
use triplanar::pipeline::mask::mask;
use triplanar::pipeline::{Parameters, Silent, radius_outlier, reconstruct, slices, statistical_outlier};

/// 512 × 512 pixels of 0.45 mm, 280 slices of 0.625 mm.
fn volume() -> Volume {
    let options = Options { slices: 280, slice_mm: 0.625, ..Options::default() };
    Phantom::new(options).expect("options within their ranges").volume()
}

fn whole(c: &mut Criterion) {
    let volume = volume();
    let parameters = Parameters::paper();
    let run = || reconstruct(&volume, &parameters, &Silent).expect("a head");
    let started = std::time::Instant::now();
    let points = run().triplanar.len();
    eprintln!("first run: {points} points, {:?}, peak memory {}", started.elapsed(), twins::peak_memory());
    let mut group = c.benchmark_group("volume to cloud");
    group.sample_size(10).measurement_time(Duration::from_secs(20));
    group.bench_function("512 x 512 x 280, leaf 1, paper", |b| b.iter(|| black_box(run())));
    let parameters = Parameters::precise();
    group.bench_function("512 x 512 x 280, leaf 1, precise", |b| {
        b.iter(|| black_box(reconstruct(&volume, &parameters, &Silent).expect("a head")));
    });
    group.finish();
}

fn contours(c: &mut Criterion) {
    let volume = volume();
    let parameters = Parameters::paper();
    let slice = slices::view(&volume.hu, Plane::Axial, 140).expect("the middle slice");
    let mask = mask(slice, &parameters);
    let mut group = c.benchmark_group("external contours of a slice");
    group.bench_function("ours", |b| b.iter(|| external_contours(&mut black_box(mask.clone()))));
    let image = twins::padded_image(&mask);
    group.bench_function("imageproc", |b| b.iter(|| twins::imageproc_contours(black_box(&image))));
    group.finish();
}

fn outliers(c: &mut Criterion) {
    let mut parameters = Parameters::paper();
    parameters.radius_outlier.min_neighbours = 0;
    parameters.statistical_outlier.neighbours = 0;
    let cloud = reconstruct(&volume(), &parameters, &Silent).expect("a head").triplanar;
    let defaults = Parameters::paper();
    let mut group = c.benchmark_group("outliers of a cloud");
    group.sample_size(10);
    group.bench_function("radius: ours", |b| {
        b.iter(|| radius_outlier::kept(black_box(&cloud.points), &defaults.radius_outlier, &Silent));
    });
    group.bench_function("radius: kiddo", |b| {
        b.iter(|| twins::kiddo_radius(black_box(&cloud.points), &defaults.radius_outlier));
    });
    group.bench_function("statistical: ours", |b| {
        b.iter(|| {
            statistical_outlier::kept(black_box(&cloud.points), &defaults.statistical_outlier, &Silent)
        });
    });
    group.finish();
}

criterion_group!(benches, whole, contours, outliers);
criterion_main!(benches);
