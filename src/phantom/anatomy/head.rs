//! The outer surface of the head. Head axes: x left, y posterior, z superior, mm; the origin is the
//! centre of the cranium. The one ear is on the left, and the
//! cranium is askew.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;

use super::blend::{capsule, ellipsoid, hollow, join};
use crate::geometry::{Vec3, norm, scale, sub};

/// Step of the numeric gradient, mm: small against the sharpest bend of the skin (2 mm), large
/// against the arithmetic's rounding.
const STEP: f64 = 0.001;

/// The proportions of one head.
#[derive(Debug, Clone)]
pub(in crate::phantom) struct Head {
    /// Half axes of the cranium.
    pub(super) cranium: Vec3,
    nose: f64,
    jaw: f64,
    ear: f64,
    /// Sine and cosine of the angle at which the ear stands off.
    ear_angle: (f64, f64),
    /// Phases of the low swellings that make the head one's own.
    phases: Vec3,
}

impl Head {
    /// The head of that seed.
    pub(in crate::phantom) fn new(seed: u64) -> Self {
        use rand::RngExt as _;
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut within = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        Self {
            cranium: [within(69.0, 74.0), within(89.0, 94.0), within(76.0, 81.0)],
            nose: within(9.0, 14.0),
            jaw: within(38.0, 44.0),
            ear: within(0.9, 1.1),
            ear_angle: within(28.0, 38.0).to_radians().sin_cos(),
            phases: [within(0.0, 6.0), within(0.0, 6.0), within(0.0, 6.0)],
        }
    }

    /// The implicit surface: negative inside, 0 on the skin, about mm next to it.
    pub(in crate::phantom) fn value(&self, p: Vec3) -> f64 {
        let [rx, ry, rz] = self.cranium;
        let either = [p[0].abs(), p[1], p[2]];
        let cranium = ellipsoid(cranium_axes(p), [0.0; 3], [rx, ry, rz]);
        let face = ellipsoid(p, [0.0, -39.0, -44.0], [0.82 * rx, 0.57 * ry, 74.0]);
        let mut f = join(cranium, face, 17.0);
        f = join(f, ellipsoid(p, [0.0, -53.0, -93.0], [self.jaw, 35.0, 27.0]), 14.0);
        f = join(f, neck(p), 20.0);
        f = join(f, ellipsoid(either, [35.0, 21.0 - ry, -43.0], [17.0, 16.0, 17.0]), 12.0);
        f = hollow(f, ellipsoid(either, [30.0, 0.5 - ry, -18.0], [13.0, 10.0, 8.0]), 9.0);
        f = join(f, ellipsoid(either, [30.0, 18.0 - ry, -18.0], [12.5, 12.5, 11.5]), 4.0);
        let tip = -ry - self.nose;
        f = join(f, capsule(p, [0.0, 5.0 - ry, -13.0], [0.0, tip + 3.0, -43.0], 7.0), 8.0);
        f = join(f, ellipsoid(p, [0.0, tip + 5.0, -45.0], [12.5, 12.5, 8.5]), 7.0);
        f = join(f, ellipsoid(p, [0.0, 4.0 - ry, -75.0], [20.0, 8.0, 9.0]), 7.0);
        f = join(f, ellipsoid(p, [0.0, 9.0 - ry, -104.0], [17.0, 13.0, 13.0]), 10.0);
        f = join(f, self.left_ear(p), 5.0);
        f + self.swellings(p)
    }

    /// A plate that stands off backwards, hollowed on its outer side.
    fn left_ear(&self, [x, y, z]: Vec3) -> f64 {
        let (sin, cos) = self.ear_angle;
        let (dx, dy) = (x - 0.94 * self.cranium[0], y - 4.0);
        let q = [dx * cos - dy * sin, dx * sin + dy * cos, z + 20.0];
        let ear = self.ear;
        let plate = ellipsoid(q, [0.0, 7.0, 0.0], [3.4 * ear, 15.0 * ear, 24.0 * ear]);
        hollow(plate, ellipsoid(q, [4.2, 5.0, -3.0], [3.6, 8.0, 11.0]), 2.0)
    }

    fn swellings(&self, p: Vec3) -> f64 {
        let wave = |i: usize, per_mm: f64| (p[i] * per_mm + self.phases[i]).sin();
        0.7 * wave(0, 0.052) * wave(1, 0.047) * wave(2, 0.058)
    }

    /// [`Head::value`] and its gradient.
    fn value_and_gradient(&self, p: Vec3) -> (f64, Vec3) {
        let value = self.value(p);
        let gradient = [0, 1, 2].map(|i| {
            let mut after = p;
            after[i] += STEP;
            (self.value(after) - value) / STEP
        });
        (value, gradient)
    }

    /// mm to the skin, to first order, and the outward unit normal.
    pub(in crate::phantom) fn skin(&self, p: Vec3) -> (f64, Vec3) {
        let (value, gradient) = self.value_and_gradient(p);
        let per_mm = 1.0 / norm(gradient).max(1e-9);
        (value * per_mm, scale(gradient, per_mm))
    }

    /// The point of the skin that Newton's steps reach from `p`.
    pub(in crate::phantom) fn foot(&self, mut p: Vec3) -> Vec3 {
        for _ in 0..5 {
            let (value, gradient) = self.value_and_gradient(p);
            let square = gradient.iter().map(|g| g * g).sum::<f64>().max(1e-9);
            p = sub(p, scale(gradient, value / square));
        }
        p
    }
}

/// Makes an ellipsoid a cranium: wider at the back, and askew (its left half lies further back), as
/// many are, so that a mirrored cloud is nowhere near the skin.
#[inline(always)]
pub(super) fn cranium_axes([x, y, z]: Vec3) -> Vec3 {
    [x / (1.0 + 0.0006 * y), y - 0.07 * x, z]
}

/// An elliptic cylinder that leans back towards the feet, from the skull's base down.
fn neck([x, y, z]: Vec3) -> f64 {
    let radius = 55.0;
    let dy = y - 19.0 - 0.10 * (z + 60.0);
    let (u, v) = (x / 56.0, dy / 54.0);
    let side = (u * u + v * v).sqrt() * radius - radius;
    side.max(z + 44.0)
}
