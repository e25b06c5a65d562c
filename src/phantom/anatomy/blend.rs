//! Implicit bodies (negative inside, about mm near their surface) and smooth joints between them.

use crate::geometry::Vec3;

/// An ellipsoid with its axes along x, y, z.
#[inline(always)]
pub(super) fn ellipsoid(p: Vec3, centre: Vec3, radii: Vec3) -> f64 {
    let (a, b, c) =
        ((p[0] - centre[0]) / radii[0], (p[1] - centre[1]) / radii[1], (p[2] - centre[2]) / radii[2]);
    let k0 = (a * a + b * b + c * c).sqrt();
    let (a, b, c) = (a / radii[0], b / radii[1], c / radii[2]);
    let k1 = (a * a + b * b + c * c).sqrt();
    if k1 > 1e-9 { k0 * (k0 - 1.0) / k1 } else { -radii[0].min(radii[1]).min(radii[2]) }
}

/// A capsule from `a` to `b`.
#[inline(always)]
pub(super) fn capsule(p: Vec3, a: Vec3, b: Vec3, radius: f64) -> f64 {
    let (ax, ay, az) = (b[0] - a[0], b[1] - a[1], b[2] - a[2]);
    let (x, y, z) = (p[0] - a[0], p[1] - a[1], p[2] - a[2]);
    let along = (x * ax + y * ay + z * az) / (ax * ax + ay * ay + az * az);
    let t = along.clamp(0.0, 1.0);
    let (x, y, z) = (x - t * ax, y - t * ay, z - t * az);
    (x * x + y * y + z * z).sqrt() - radius
}

/// Union, rounded over `k` mm (the polynomial smooth minimum).
#[inline(always)]
pub(super) fn join(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - h * h / (4.0 * k)
}

/// `a` without `b`, rounded over `k` mm.
#[inline(always)]
pub(super) fn hollow(a: f64, b: f64, k: f64) -> f64 {
    -join(-a, b, k)
}
