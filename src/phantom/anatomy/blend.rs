//! Implicit bodies (negative inside, about mm near their surface) and smooth joints between them.

use crate::geometry::Vec3;

/// An ellipsoid with its axes along x, y, z.
#[inline]
pub(super) fn ellipsoid(p: Vec3, centre: Vec3, radii: Vec3) -> f64 {
    let unit = [0, 1, 2].map(|i| (p[i] - centre[i]) / radii[i]);
    let [k0, k1] = [unit, [0, 1, 2].map(|i| unit[i] / radii[i])].map(length);
    if k1 > 1e-9 { k0 * (k0 - 1.0) / k1 } else { -radii[0].min(radii[1]).min(radii[2]) }
}

/// A capsule from `a` to `b`.
#[inline]
pub(super) fn capsule(p: Vec3, a: Vec3, b: Vec3, radius: f64) -> f64 {
    let along = [0, 1, 2].map(|i| b[i] - a[i]);
    let from = [0, 1, 2].map(|i| p[i] - a[i]);
    let square: f64 = along.iter().map(|v| v * v).sum();
    let t = (from[0] * along[0] + from[1] * along[1] + from[2] * along[2]) / square;
    let t = t.clamp(0.0, 1.0);
    length([0, 1, 2].map(|i| from[i] - t * along[i])) - radius
}

/// Union, rounded over `k` mm (the polynomial smooth minimum).
#[inline]
pub(super) fn join(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - h * h / (4.0 * k)
}

/// `a` without `b`, rounded over `k` mm.
#[inline]
pub(super) fn hollow(a: f64, b: f64, k: f64) -> f64 {
    -join(-a, b, k)
}

#[inline]
fn length(v: Vec3) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}
