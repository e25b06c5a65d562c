//! What else is in the picture: the head holder and the couch. Both stay where they are however
//! the head is turned.

use crate::geometry::Vec3;

/// HU of their shells.
pub(super) const SHELL: f64 = 60.0;

/// Centre and half axes of the holder's ellipse in x and y, mm.
const HOLDER_CENTRE: [f64; 2] = [0.0, -8.0];
const HOLDER_RADII: [f64; 2] = [94.0, 109.0];
/// Half its thickness, mm, and half the angle that it spans, rad.
const HOLDER_HALF: f64 = 1.3;
const HOLDER_ANGLE: f64 = 0.96;

/// y of the couch top's middle and half its thickness, mm.
const COUCH: (f64, f64) = (106.5, 0.9);

/// About mm to the holder's shell, negative inside it. It runs through all of z.
pub(super) fn holder([x, y, _]: Vec3) -> f64 {
    // In front of its ends there is none of it.
    if y < HOLDER_CENTRE[1] {
        return f64::INFINITY;
    }
    let u = (x - HOLDER_CENTRE[0]) / HOLDER_RADII[0];
    let v = (y - HOLDER_CENTRE[1]) / HOLDER_RADII[1];
    let shell = (u.hypot(v) - 1.0).abs() * HOLDER_RADII[0] - HOLDER_HALF;
    let end = (u.atan2(v).abs() - HOLDER_ANGLE) * HOLDER_RADII[0];
    shell.max(end)
}

/// mm to the couch's top, an endless sheet.
pub(super) fn couch([_, y, _]: Vec3) -> f64 {
    (y - COUCH.0).abs() - COUCH.1
}
