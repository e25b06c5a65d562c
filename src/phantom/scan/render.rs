//! Measures every voxel: partial volume and blur in closed form, then noise.

use ndarray::Array3;
use rayon::prelude::*;

use super::super::Options;
use super::super::anatomy::{AIR, Head, Pose, SKIN_DEPTH};
use super::{Frame, equipment, noise};
use crate::geometry::{Vec3, add, dot, norm, scale};

/// Edge of the blocks of pixels that are looked at together, so that air and brain are cheap.
const BLOCK: usize = 8;

/// The implicit surface's gradient is below this everywhere near the head: how far the surface
/// can be from a block's centre is known from the value there.
const STEEPEST: f64 = 2.0;

/// Blur beyond so many standard deviations is nothing.
const REACH: f64 = 4.0;

/// Hounsfield units, `[[z, y, x]]` as in [`crate::dicom::Volume`].
pub(in crate::phantom) fn voxels(options: &Options, head: &Head, pose: &Pose) -> Array3<i16> {
    let scanner = Scanner::new(options, head, pose);
    let mut out = vec![0; options.slices * options.rows * options.columns];
    out.par_chunks_exact_mut(options.rows * options.columns).enumerate().for_each(|(z, slice)| {
        let mut image = scanner.slice(z);
        noise::add(&mut image, options.columns, options.noise_hu, options.seed, z);
        for (voxel, hu) in slice.iter_mut().zip(image) {
            #[expect(clippy::cast_possible_truncation)]
            let stored = hu.round().clamp(-1024.0, 3071.0) as i16;
            *voxel = stored;
        }
    });
    Array3::from_shape_vec([options.slices, options.rows, options.columns], out)
        .expect("as many voxels as the shape says")
}

struct Scanner<'a> {
    options: &'a Options,
    head: &'a Head,
    pose: &'a Pose,
    frame: Frame,
    /// Largest standard deviation of the edge's blur in any direction, mm.
    widest: f64,
}

impl<'a> Scanner<'a> {
    fn new(options: &'a Options, head: &'a Head, pose: &'a Pose) -> Self {
        let frame = Frame::new(options);
        let square: f64 = frame.step.iter().map(|step| dot(*step, *step)).sum();
        let widest = (options.blur_mm.powi(2) + square / 12.0).sqrt();
        Self { options, head, pose, frame, widest }
    }

    /// One slice without noise.
    #[expect(clippy::cast_possible_truncation)]
    fn slice(&self, z: usize) -> Vec<f32> {
        let Options { rows, columns, .. } = *self.options;
        let mut image = vec![AIR as f32; rows * columns];
        for y0 in (0..rows).step_by(BLOCK) {
            for x0 in (0..columns).step_by(BLOCK) {
                let (y1, x1) = ((y0 + BLOCK).min(rows), (x0 + BLOCK).min(columns));
                let region = self.region([z, y0, x0], [z, y1 - 1, x1 - 1]);
                for y in y0..y1 {
                    for x in x0..x1 {
                        let lps = self.frame.lps([z, y, x]);
                        let hu = match region {
                            Region::Outside => self.around(lps),
                            Region::Inside => self.head.tissue(self.pose.to_head(lps), f64::INFINITY),
                            Region::Skin => self.near_skin(lps),
                        };
                        image[y * columns + x] = hu as f32;
                    }
                }
            }
        }
        image
    }

    /// Whether the skin can matter for the pixels between two corners.
    fn region(&self, first: [usize; 3], last: [usize; 3]) -> Region {
        let (a, b) = (self.frame.lps(first), self.frame.lps(last));
        let centre = scale(add(a, b), 0.5);
        let radius = norm(crate::geometry::sub(b, a)) / 2.0;
        let value = self.head.value(self.pose.to_head(centre));
        let reach = STEEPEST * (radius + REACH * self.widest);
        if value > reach {
            Region::Outside
        } else if value < -(reach + STEEPEST * SKIN_DEPTH) {
            Region::Inside
        } else {
            Region::Skin
        }
    }

    /// Skin, what is just below it, and what is just outside.
    fn near_skin(&self, lps: Vec3) -> f64 {
        let p = self.pose.to_head(lps);
        let value = self.head.value(p);
        if value > STEEPEST * REACH * self.widest {
            return self.around(lps);
        }
        let distance = self.head.signed_distance(p);
        let normal = self.pose.direction_to_lps(self.head.normal(p));
        let inside = self.share_inside(distance, normal);
        let tissue = self.head.tissue(p, (-distance).max(0.0));
        inside * tissue + (1.0 - inside) * self.around(lps)
    }

    /// Air, holder and couch.
    fn around(&self, lps: Vec3) -> f64 {
        let share = |distance: f64, normal: Vec3| self.share_inside(distance, normal);
        let mut shell: f64 = 0.0;
        if self.options.holder {
            let distance = equipment::holder(lps);
            if distance < REACH * self.widest {
                shell = shell.max(share(distance, [0.0, 1.0, 0.0]));
            }
        }
        if self.options.couch {
            let distance = equipment::couch(lps);
            if distance < REACH * self.widest {
                shell = shell.max(share(distance, [0.0, 1.0, 0.0]));
            }
        }
        AIR + shell * (equipment::SHELL - AIR)
    }

    /// How much of a voxel's reading comes from behind an edge at `distance` with that normal: the
    /// edge blurred by the scanner's Gaussian and by the voxel's own size along the normal.
    fn share_inside(&self, distance: f64, normal: Vec3) -> f64 {
        let voxel: f64 = self.frame.step.iter().map(|step| dot(*step, normal).powi(2)).sum();
        let sigma = (self.options.blur_mm.powi(2) + voxel / 12.0).sqrt();
        normal_cdf(-distance / sigma)
    }
}

#[derive(Clone, Copy)]
enum Region {
    Outside,
    Inside,
    Skin,
}

/// The normal distribution's integral, within 3e-4 and exactly symmetric about 1/2
/// (Page 1977, Applied Statistics 26, 75).
fn normal_cdf(t: f64) -> f64 {
    0.5 * (1.0 + (0.797_884_560_8 * (t + 0.044_715 * t.powi(3))).tanh())
}
