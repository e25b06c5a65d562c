//! One skull scanned at three gantry tilts: only if each slice is put where it was does it have
//! one shape.

use std::path::Path;

use triplanar::dicom::Volume;
use triplanar::geometry::{Grid, Vec3, add, cross, dot, normalised, scale, sub};

use crate::support::icp::{Fit, Surface, register};
use crate::support::{data, instances};

/// HU of the bone's surface, half-way between soft tissue's place (here air) and dense bone.
const BONE: f64 = 300.0;

/// Where the bone's surface crosses the lines between neighbouring voxels, with its normal.
fn bone(volume: &Volume, grid: &Grid) -> Vec<(Vec3, Vec3)> {
    let [nz, ny, nx] = volume.hu.dim().into();
    let hu = |z: usize, y: usize, x: usize| f64::from(volume.hu[[z, y, x]]);
    // Directions of the gradient: the dual basis, so that a sheared grid is right too.
    let [sz, sy, sx] = *grid.step();
    let dual = |a: Vec3, b: Vec3, own: Vec3| {
        let normal = cross(a, b);
        scale(normal, 1.0 / dot(normal, own))
    };
    let (dz, dy, dx) = (dual(sy, sx, sz), dual(sx, sz, sy), dual(sz, sy, sx));
    let mut points = Vec::new();
    for z in 1..nz - 2 {
        for y in (1..ny - 2).step_by(2) {
            for x in (1..nx - 2).step_by(2) {
                for next in [[z + 1, y, x], [z, y + 1, x], [z, y, x + 1]] {
                    let (a, b) = (hu(z, y, x), hu(next[0], next[1], next[2]));
                    if (a < BONE) == (b < BONE) || (a - b).abs() < 150.0 {
                        continue;
                    }
                    let gradient = add(
                        scale(dz, hu(z + 1, y, x) - hu(z - 1, y, x)),
                        add(
                            scale(dy, hu(z, y + 1, x) - hu(z, y - 1, x)),
                            scale(dx, hu(z, y, x + 1) - hu(z, y, x - 1)),
                        ),
                    );
                    let Some(normal) = normalised(gradient) else { continue };
                    let (from, to) = (grid.lps([z, y, x]), grid.lps(next));
                    points.push((add(from, scale(sub(to, from), (BONE - a) / (b - a))), normal));
                }
            }
        }
    }
    points
}

/// The grid as somebody has it who believes that slices lie on top of one another.
fn without_tilt(grid: &Grid) -> Grid {
    let [sz, sy, sx] = *grid.step();
    let normal = normalised(cross(sy, sx)).expect("pixels have a size");
    let apart = scale(normal, dot(sz, normal));
    let origin = grid.slice_origins()[0];
    let origins = (0..grid.slice_origins().len()).map(|i| add(origin, scale(apart, i as f64))).collect();
    Grid::new(grid.slice_axis(), origins, [apart, sy, sx], grid.shape())
}

/// Of the pairs nearest to each other, this share counts: the scans don't begin and end at the same
/// place, and their slices cut thin bone differently.
const SHARE: f64 = 0.8;

/// Less of the moving bone than this beside the still one is no registration.
const OVERLAP: f64 = 0.6;

fn centre(points: &[(Vec3, Vec3)]) -> Vec3 {
    let sum = points.iter().fold([0.0; 3], |sum, (p, _)| add(sum, *p));
    scale(sum, 1.0 / points.len() as f64)
}

fn fit(moving: &[(Vec3, Vec3)], still: Vec<(Vec3, Vec3)>) -> Fit {
    let start = sub(centre(&still), centre(moving));
    let sample = |count: usize| -> Vec<Vec3> {
        moving.iter().step_by(moving.len() / count + 1).map(|(p, _)| *p).collect()
    };
    let target = Surface::new(still);
    // The scans don't begin at the same place: of several starts along z, the best.
    let few = sample(800);
    let starts = [-20.0, -10.0, 0.0, 10.0, 20.0].map(|dz| add(start, [0.0, 0.0, dz]));
    let fits = starts.map(|start| (register(&few, &target, start, SHARE), start));
    let best = fits.into_iter().max_by(|(a, _), (b, _)| (a.overlap / a.rms).total_cmp(&(b.overlap / b.rms)));
    register(&sample(4000), &target, best.expect("five starts").1, SHARE)
}

fn skull(data: &Path, name: &str) -> Volume {
    instances::volume(data, name)
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn tilted_and_untilted_skulls_register_and_only_with_their_tilt() {
    let data = data::dir();
    let [flat, minus, plus] = ["philips_phantom_5mm", "philips_phantom_tilt_m18", "philips_phantom_tilt_p16"]
        .map(|name| skull(&data, name));
    for (what, moving, still) in
        [("-18.5° on 0°", &minus, &flat), ("+16.5° on 0°", &plus, &flat), ("+16.5° on -18.5°", &plus, &minus)]
    {
        let right = fit(&bone(moving, &moving.grid), bone(still, &still.grid));
        let wrong = fit(&bone(moving, &without_tilt(&moving.grid)), bone(still, &without_tilt(&still.grid)));
        eprintln!("{what}: {right:.3?}; with the tilt ignored: {wrong:.3?}");
        assert!(right.overlap > OVERLAP, "{what}: only {:.2} of the bone found its like", right.overlap);
        assert!(right.rms <= 0.7, "{what}: RMS {:.3} mm, promised 0.7", right.rms);
        let fits = wrong.overlap > OVERLAP && wrong.rms <= 0.7;
        assert!(!fits, "{what}: {:.3} mm though the tilt is ignored: this test sees nothing", wrong.rms);
    }
}
