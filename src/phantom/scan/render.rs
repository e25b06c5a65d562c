//! Measures every voxel: partial volume and blur in closed form, then noise.

use ndarray::Array3;
use rayon::prelude::*;

use super::super::Options;
use super::super::anatomy::{AIR, Head, Pose, SKIN_DEPTH};
use super::{Frame, equipment, noise};
use crate::geometry::{Vec3, add, dot, norm, scale};

/// Edges of the blocks of pixels that are looked at together, so that air and brain are cheap: a
/// block near the skin is cut into those of the next size.
const BLOCKS: [usize; 3] = [32, 8, 4];

/// The implicit surface's gradient stays below this: how near the surface can be to a place is
/// known from the value there.
const STEEPEST: f64 = 1.5;

/// Beyond so many standard deviations the blur is a HU or less.
const REACH: f64 = 3.1;

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
        let mut image = vec![AIR as f32; self.options.rows * self.options.columns];
        self.fill(&mut image, z, [0, 0], [self.options.rows, self.options.columns], &BLOCKS);
        image
    }

    /// Measures the pixels from `first` to before `end` (row, column), in blocks.
    #[expect(clippy::cast_possible_truncation)]
    fn fill(&self, image: &mut [f32], z: usize, first: [usize; 2], end: [usize; 2], blocks: &[usize]) {
        let Some((&edge, smaller)) = blocks.split_first() else {
            for (y, x) in pixels(first, end) {
                image[y * self.options.columns + x] = self.near_skin(self.frame.lps([z, y, x])) as f32;
            }
            return;
        };
        for y0 in (first[0]..end[0]).step_by(edge) {
            for x0 in (first[1]..end[1]).step_by(edge) {
                let (y1, x1) = ((y0 + edge).min(end[0]), (x0 + edge).min(end[1]));
                let of_lps: &dyn Fn(Vec3) -> f64 = match self.region([z, y0, x0], [z, y1 - 1, x1 - 1]) {
                    Region::Skin => {
                        self.fill(image, z, [y0, x0], [y1, x1], smaller);
                        continue;
                    }
                    Region::Outside => &|lps| self.around(lps),
                    Region::Inside => &|lps| self.head.tissue(self.pose.to_head(lps), f64::INFINITY),
                };
                for (y, x) in pixels([y0, x0], [y1, x1]) {
                    image[y * self.options.columns + x] = of_lps(self.frame.lps([z, y, x])) as f32;
                }
            }
        }
    }

    /// Whether the skin can matter for the pixels between two corners.
    fn region(&self, first: [usize; 3], last: [usize; 3]) -> Region {
        let (a, b) = (self.frame.lps(first), self.frame.lps(last));
        let centre = scale(add(a, b), 0.5);
        let radius = norm(crate::geometry::sub(b, a)) / 2.0;
        let value = self.head.value(self.pose.to_head(centre));
        let blurred = REACH * self.widest;
        if value > STEEPEST * (radius + blurred) {
            Region::Outside
        } else if value < -STEEPEST * (radius + blurred.max(SKIN_DEPTH)) {
            Region::Inside
        } else {
            Region::Skin
        }
    }

    /// Skin, what is just below it, and what is just outside.
    fn near_skin(&self, lps: Vec3) -> f64 {
        let p = self.pose.to_head(lps);
        let value = self.head.value(p);
        let blurred = STEEPEST * REACH * self.widest;
        if value > blurred {
            return self.around(lps);
        }
        if value < -blurred {
            // The depth of layers inside need not be exact.
            return self.head.tissue(p, -value);
        }
        let (distance, normal) = self.head.skin(p);
        let inside = self.share_inside(distance, self.pose.direction_to_lps(normal));
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

fn pixels(first: [usize; 2], end: [usize; 2]) -> impl Iterator<Item = (usize, usize)> {
    (first[0]..end[0]).flat_map(move |y| (first[1]..end[1]).map(move |x| (y, x)))
}

enum Region {
    Outside,
    Inside,
    Skin,
}

/// The normal distribution's integral, within 3e-4 and exactly symmetric about 1/2
/// (Page 1977, Applied Statistics 26, 75).
fn normal_cdf(t: f64) -> f64 {
    0.5 * (1.0 + (0.797_884_560_8 * (t + 0.044_715 * t * t * t)).tanh())
}
