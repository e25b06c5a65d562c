//! The skin beyond the last contour: the vertex of a head in thick slices, the underside of a chin.
//!
//! There one slice shows tissue and the next nothing. The contours of that slice and of the one below
//! it still tell how the skin bends: a quadric through them, fitted around the place in question, says how
//! high it rises between the slices.

/// A point of a slice's contour, in the slice, mm.
pub(crate) type Place = [f64; 2];

/// How high the skin rises above a slice.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rise {
    /// As a share of the way to the next slice.
    pub(crate) share: f64,
    /// Expected error of the height, mm.
    pub(crate) error: f64,
}

/// Contours count up to this far away, mm, times the square root of the slices' distance in mm: so
/// wide are the last contours of a vertex.
const REACH: f64 = 20.0;
/// Fewer points than this of either contour tell nothing.
const LEAST_POINTS: usize = 12;
/// The quadric may miss the contours' heights by this share of the slices' distance.
const MISFIT: f64 = 0.25;
/// The error of one point stands for that of so many neighbours.
const ALIKE: f64 = 16.0;
/// A height further than this outside the gap that holds it, as a share of it, is no height.
const OUTSIDE: f64 = 0.15;

/// How high the skin rises at `p` over a slice with the contour `own`, and the contour `below` in the
/// slice `below_mm` behind it, where the next slice is `gap` mm away and shows none. `None` where the
/// contours do not tell: too few points, no quadric that fits, or a height that is not in the gap.
pub(crate) fn rise(own: &[Place], below: &[Place], below_mm: f64, p: Place, gap: f64) -> Option<Rise> {
    let reach = REACH * gap.sqrt();
    let mut sums = [[0.0; TERMS + 1]; TERMS];
    let (mut total, mut squares) = (0.0, 0.0);
    for (contour, height) in [(own, 0.0), (below, -below_mm)] {
        let mut near = 0;
        for q in contour {
            let (u, v) = ((q[0] - p[0]) / reach, (q[1] - p[1]) / reach);
            let share = 1.0 - (u * u + v * v);
            if share <= 0.0 {
                continue;
            }
            near += 1;
            let (weight, terms) = (share * share, terms(u, v));
            for (row, a) in sums.iter_mut().zip(terms) {
                for (sum, b) in row.iter_mut().zip(terms.into_iter().chain([height])) {
                    *sum += weight * a * b;
                }
            }
            total += weight;
            squares += weight * height * height;
        }
        if near < LEAST_POINTS {
            return None;
        }
    }
    let explained = sums.map(|row| row[TERMS]);
    let quadric = solve(sums)?;
    let missed = squares - quadric.iter().zip(explained).map(|(c, e)| c * e).sum::<f64>();
    let misfit = (missed.max(0.0) / total).sqrt();
    // The first term is the height at `p` itself.
    let mut unit = sums;
    for (i, row) in unit.iter_mut().enumerate() {
        row[TERMS] = f64::from(u8::from(i == 0));
    }
    let leverage = solve(unit)?[0];
    let share = quadric[0] / gap;
    let fits = misfit <= MISFIT * gap && (-OUTSIDE..=1.0 + OUTSIDE).contains(&share);
    let error = misfit * (ALIKE * leverage.max(0.0)).sqrt();
    fits.then_some(Rise { share: share.clamp(0.0, 1.0), error })
}

/// The terms of a quadric over a plane.
const TERMS: usize = 6;

fn terms(u: f64, v: f64) -> [f64; TERMS] {
    [1.0, u, v, u * u, u * v, v * v]
}

/// Gauss's elimination; `None` where the equations do not tell.
fn solve(mut a: [[f64; TERMS + 1]; TERMS]) -> Option<[f64; TERMS]> {
    for i in 0..TERMS {
        let pivot = (i..TERMS).max_by(|&p, &q| a[p][i].abs().total_cmp(&a[q][i].abs()))?;
        a.swap(i, pivot);
        let row = a[i];
        if row[i].abs() < 1e-9 {
            return None;
        }
        for (j, other) in a.iter_mut().enumerate() {
            if j != i {
                let factor = other[i] / row[i];
                for (o, r) in other.iter_mut().zip(row) {
                    *o -= factor * r;
                }
            }
        }
    }
    Some(std::array::from_fn(|i| a[i][TERMS] / a[i][i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rings on a sphere of radius 80 mm at heights below its top.
    fn ring(depth: f64) -> Vec<Place> {
        let radius = (160.0 * depth - depth * depth).sqrt();
        (0..200).map(|i| f64::from(i) * 0.0314).map(|a| [radius * a.cos(), radius * a.sin()]).collect()
    }

    #[test]
    fn the_top_of_a_sphere_is_found_from_its_last_two_contours() {
        for top in [0.4, 1.0, 1.7] {
            let (own, below) = (ring(top), ring(top + 2.0));
            for p in [[0.0, 0.0], [4.0, -3.0]] {
                let truth = top - (80.0 - (6400.0f64 - p[0] * p[0] - p[1] * p[1]).sqrt());
                let rise = rise(&own, &below, 2.0, p, 2.0).expect("a cap");
                assert!((rise.share * 2.0 - truth).abs() < 0.06, "{} of {truth}", rise.share * 2.0);
            }
        }
    }

    #[test]
    fn one_side_of_a_contour_tells_nothing() {
        let half =
            |depth| ring(depth).into_iter().filter(|p| p[0] > 0.0 && p[1].abs() < 2.0).collect::<Vec<_>>();
        assert!(rise(&half(1.0), &half(3.0), 2.0, [0.0, 0.0], 2.0).is_none_or(|r| r.error > 1.0));
        assert!(rise(&ring(1.0), &[], 2.0, [0.0, 0.0], 2.0).is_none());
    }
}
