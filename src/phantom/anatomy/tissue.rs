//! Hounsfield units inside the head.

use super::Head;
use super::blend::{capsule, ellipsoid};
use super::head::cranium_axes;
use crate::geometry::Vec3;

/// Air.
pub(in crate::phantom) const AIR: f64 = -1000.0;

/// Depth below the skin beyond which [`Head::tissue`] no longer asks for the depth, mm.
pub(in crate::phantom) const SKIN_DEPTH: f64 = 5.5;

/// Distance of the skull from the cranium's skin, mm.
const SCALP: f64 = 6.5;

impl Head {
    /// HU at a point that lies `depth` mm below the skin: skin, fat, muscle, skull with diploë,
    /// brain with ventricles, sinuses, airway, jaw and spine. Air inside never reaches the skin.
    pub(in crate::phantom) fn tissue(&self, p: Vec3, depth: f64) -> f64 {
        if depth < 2.0 {
            return 30.0;
        }
        if depth < SKIN_DEPTH {
            return -90.0;
        }
        if let Some(hu) = cavity(p) {
            return hu;
        }
        self.skull(p).or_else(|| facial_bone(p)).or_else(|| spine(p)).unwrap_or(50.0)
    }

    /// The brain's case and what is in it.
    fn skull(&self, p: Vec3) -> Option<f64> {
        let [_, y, z] = p;
        let radii = self.cranium.map(|r| r - SCALP);
        let base = 0.35 * (y + 20.0) - z - 60.0;
        let s = ellipsoid(cranium_axes(p), [0.0; 3], radii).max(base);
        match s {
            s if s > 0.0 => None,
            s if s > -1.8 || (-6.2..-4.4).contains(&s) => Some(1150.0),
            s if s > -4.4 => Some(550.0),
            _ => Some(if in_ventricle(p) { 6.0 } else { 37.0 }),
        }
    }
}

fn in_ventricle([x, y, z]: Vec3) -> bool {
    ellipsoid([x.abs(), y, z], [12.0, 5.0, 12.0], [8.0, 28.0, 12.0]) < 0.0
}

/// Sinuses and airway.
fn cavity(p: Vec3) -> Option<f64> {
    // Most of the head is behind or above all of them.
    if p[2] > 16.0 || p[1] > -12.0 || p[0].abs() > 37.0 {
        return None;
    }
    let either = [p[0].abs(), p[1], p[2]];
    let maxillary = ellipsoid(either, [24.0, -58.0, -44.0], [11.0, 14.0, 13.0]);
    let nasal = ellipsoid(either, [6.0, -62.0, -42.0], [4.0, 24.0, 15.0]);
    let frontal = ellipsoid(either, [9.0, -78.0, 6.0], [7.0, 3.0, 7.0]);
    let pharynx = capsule(p, [0.0, -32.0, -46.0], [0.0, -24.0, -75.0], 7.5);
    let trachea = capsule(p, [0.0, -24.0, -75.0], [0.0, -20.0, -300.0], 7.5);
    let nearest = maxillary.min(nasal).min(frontal).min(pharynx).min(trachea);
    match nearest {
        d if d < 0.0 => Some(AIR),
        _ if maxillary.min(frontal) < 1.6 => Some(800.0),
        _ => None,
    }
}

/// Orbits, cheekbones, jaw and teeth.
fn facial_bone(p: Vec3) -> Option<f64> {
    let [x, y, z] = p;
    if y > -4.0 {
        return None;
    }
    let either = [x.abs(), y, z];
    let orbit = ellipsoid(either, [30.0, -64.0, -16.0], [16.0, 19.0, 15.0]);
    if orbit < 0.0 {
        return Some(if orbit < -5.0 { 12.0 } else { -70.0 });
    }
    if orbit < 1.8 {
        return Some(750.0);
    }
    if capsule(either, [46.0, -52.0, -33.0], [58.0, -8.0, -30.0], 3.0) < 0.0 {
        return Some(950.0);
    }
    let arch = ((x / 33.0).powi(2) + ((y + 46.0) / 30.0).powi(2)).sqrt() - 1.0;
    if y < -34.0 && arch.abs() < 0.13 && (-108.0..-86.0).contains(&z) {
        return Some(1150.0);
    }
    let teeth = ((x / 25.0).powi(2) + ((y + 52.0) / 27.0).powi(2)).sqrt() - 1.0;
    (y < -44.0 && teeth.abs() < 0.12 && (-85.0..-64.0).contains(&z)).then_some(1800.0)
}

/// Vertebrae, discs and the canal behind.
fn spine([x, y, z]: Vec3) -> Option<f64> {
    if z > -62.0 {
        return None;
    }
    let body = ((x / 14.0).powi(2) + ((y - 12.0) / 11.0).powi(2)).sqrt();
    let canal = x.hypot(y - 33.0);
    match (body, canal) {
        (body, _) if body < 1.0 => Some(match (-z).rem_euclid(18.0) {
            along if along < 3.0 => 80.0,
            _ if body > 0.85 => 900.0,
            _ => 350.0,
        }),
        (_, canal) if canal < 9.0 => Some(30.0),
        (_, canal) if canal < 12.0 => Some(800.0),
        _ => None,
    }
}
