//! Steps between slices: a patient who moved, or a table that did not.
//!
//! From slice to slice a head's outline changes smoothly. A slice whose outline stands aside from
//! the mean of the outlines before and after it tells of a step.

use crate::geometry::{Vec3, dot, sub};
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::scan::sampler::Sampler;

/// Directions from the middle in which an outline is measured.
const RAYS: usize = 90;
/// The same as a number.
const RAYS_F: f64 = 90.0;
/// An outline must be seen in this share of the directions.
const LEAST_SEEN: f64 = 0.6;
/// Radii that change more than this between slices belong to ears, nose and chin, not to a step, mm.
const MOST_MM: f64 = 6.0;

/// How far at most a slice's outline stands aside from between those before and after it, mm (a
/// lasting step shows with half its length); 0 where too little is seen to tell.
pub(crate) fn largest_step(sampler: &Sampler, crossings: &[Crossing], middle: Vec3) -> f64 {
    let slices = sampler.shape[sampler.slice_axis()];
    let mut radii = vec![[f64::NAN; RAYS]; slices];
    let [u, v] = sampler.in_plane_units();
    for (i, c) in crossings.iter().enumerate() {
        sampler.ask_at(i);
        if usize::from(c.axis) == sampler.slice_axis() || c.between {
            continue;
        }
        let k = sampler.slice_of(c.place);
        let d = sub(c.place, middle);
        let (a, b) = (dot(d, u), dot(d, v));
        let ray = ((b.atan2(a) / std::f64::consts::TAU + 1.0) * RAYS_F) as usize % RAYS;
        let radius = &mut radii[k][ray];
        if radius.is_nan() || a.hypot(b) > *radius {
            *radius = a.hypot(b);
        }
    }
    let gap = |k: usize| dot(sampler.step_at(sampler.slice_axis(), k), sampler.slice_normal());
    let steps = radii.windows(3).enumerate().filter_map(|(k, three)| {
        let (before, after) = (gap(k), gap(k + 1));
        aside(three, before / (before + after))
    });
    steps.fold(0.0, f64::max)
}

/// How far the middle one of three outlines, the share `t` of the way from the first to the last,
/// stands aside from between the others, mm.
fn aside(outlines: &[[f64; RAYS]], t: f64) -> Option<f64> {
    let bend: Vec<(usize, f64)> = (0..RAYS)
        .map(|i| (i, outlines[1][i] - (outlines[0][i] * (1.0 - t) + outlines[2][i] * t)))
        .filter(|(i, bend)| bend.abs() < MOST_MM && (outlines[0][*i] - outlines[2][*i]).abs() < MOST_MM)
        .collect();
    let seen = |from: usize, to: usize| bend.iter().filter(|(i, _)| (from..to).contains(i)).count();
    let quarters =
        [seen(0, RAYS / 4), seen(RAYS / 4, RAYS / 2), seen(RAYS / 2, RAYS * 3 / 4), seen(RAYS * 3 / 4, RAYS)];
    let least = (LEAST_SEEN * RAYS_F / 4.0) as usize;
    if quarters.iter().any(|&q| q < least) {
        return None;
    }
    // A shift by (x, y) changes the radius by x cos + y sin: the middle half of opposite quarters is
    // robust to an ear.
    let along = |phase: f64| {
        let mut parts: Vec<f64> = bend
            .iter()
            .filter_map(|(i, bend)| {
                let angle = (*i as f64 + 0.5) / RAYS_F * std::f64::consts::TAU;
                let cosine = (angle - phase).cos();
                (cosine.abs() > 0.7).then(|| bend / cosine)
            })
            .collect();
        parts.sort_unstable_by(f64::total_cmp);
        // A growing outline pulls the two sides apart: the middle half cancels that.
        let half = &parts[parts.len() / 4..parts.len() - parts.len() / 4];
        half.iter().sum::<f64>() / half.len() as f64
    };
    Some(along(0.0).hypot(along(std::f64::consts::FRAC_PI_2)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The outline of an ellipse around `(x, y)`.
    fn outline(x: f64, y: f64) -> [f64; RAYS] {
        std::array::from_fn(|i| {
            let angle = (i as f64 + 0.5) / RAYS_F * std::f64::consts::TAU;
            let (c, s) = (angle.cos(), angle.sin());
            // |t·(c, s) − (x, y)| in units of the semi-axes is 1.
            let (p, q) = (70.0, 90.0);
            let a = (c / p).powi(2) + (s / q).powi(2);
            let b = c * x / (p * p) + s * y / (q * q);
            let k = (x / p).powi(2) + (y / q).powi(2) - 1.0;
            (b + (b * b - a * k).sqrt()) / a
        })
    }

    #[test]
    fn a_step_is_measured_and_a_growing_outline_is_none() {
        let still =
            aside(&[outline(0.0, 0.0), outline(0.0, 0.0), outline(0.0, 0.0)], 0.5).expect("all is seen");
        assert!(still < 1e-9, "{still}");
        let stepped =
            aside(&[outline(0.0, 0.0), outline(1.2, -1.6), outline(1.2, -1.6)], 0.5).expect("all is seen");
        assert!((stepped - 1.0).abs() < 0.1, "half a step of 2 mm measured as {stepped}");
        let uneven = aside(&[outline(0.0, 0.0), outline(1.0, 0.0), outline(4.0, 0.0)], 0.25).expect("seen");
        assert!(uneven < 0.1, "a slanting head in unequal slices moves by {uneven}");
        let grown = outline(0.0, 0.0).map(|r| r * 1.02);
        let growing =
            aside(&[outline(0.0, 0.0), grown, outline(0.0, 0.0).map(|r| r * 1.03)], 0.5).expect("seen");
        assert!(growing < 0.15, "{growing}");
    }
}
