//! Rigid registration by iterative closest points (Besl and McKay 1992) with the choices of
//! CloudCompare's tool, which the paper used (section 3.3).
//!
//! Each round: the nearest point of the target for every point; farthest-point removal, for good;
//! of the rest the nearest ones, up to the overlap's share of all points; their root mean square;
//! the rigid motion that brings them closest to their partners. It ends when the root mean square
//! falls by less than the limit, or rises: then the motion before is the result.

mod horn;
mod rigid;
mod selection;

use serde::Serialize;

use super::Target;
use crate::geometry::{Vec3, add, norm, scale, sub};

pub use rigid::Rigid;

/// How to register.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Settings {
    /// Share of the points that take part, the nearest ones; above 0, at most 1.
    pub overlap: f64,
    /// Whether points farther than mean + 2.5 standard deviations are removed in each round.
    pub farthest_point_removal: bool,
    /// It ends when the root mean square falls by less, mm.
    pub min_rms_decrease_mm: f64,
    /// It ends after so many rounds in any case.
    pub max_iterations: usize,
}

impl Settings {
    /// The paper's settings. It used all points, too; CloudCompare has no limit of rounds.
    pub const PAPER: Self =
        Self { overlap: 0.9, farthest_point_removal: true, min_rms_decrease_mm: 1e-4, max_iterations: 2000 };
}

/// Why it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// The root mean square fell by less than the limit.
    Converged,
    /// It would have risen.
    NoDecrease,
    /// The limit of rounds was reached first: the result is not final.
    IterationLimit,
}

/// A registration, mm and degrees.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Registration {
    /// The settings it was made with.
    pub settings: Settings,
    /// Root mean square distance of the points that took part, after registration.
    pub rms_mm: f64,
    /// The same before the first motion.
    pub initial_rms_mm: f64,
    /// How many points took part in the last round.
    pub points_used: usize,
    /// Their share of all points, 0 to 1.
    pub used_share: f64,
    /// Whether the root mean square says little: far fewer points took part than the overlap lets
    /// (farthest-point removal goes on in each round, and may fit a small part of a cloud alone), or
    /// they, or what is nearest to them, lie on a line or in one place, which fixes no motion, or they
    /// moved by more than half their extent.
    pub is_doubtful: bool,
    /// How many points farthest-point removal had taken away by then.
    pub points_removed: usize,
    /// Motions that were applied.
    pub iterations: usize,
    /// Why it ended.
    pub end: End,
    /// Angle of the rotation.
    pub rotation_deg: f64,
    /// How far the middle of the points moved, x y z.
    pub shift_mm: Vec3,
    /// Length of `shift_mm`.
    pub shift_length_mm: f64,
    /// Diagonal of the box around the points.
    pub extent_mm: f64,
    /// The motion of the points onto the target: row by row, 4 × 4, homogeneous, LPS mm.
    pub matrix: [[f64; 4]; 4],
}

impl Registration {
    /// Whether far fewer points took part than the overlap lets.
    #[must_use]
    pub fn lacks_points(&self) -> bool {
        self.used_share < MIN_SHARE * self.settings.overlap
    }

    /// Whether the points lay somewhere else altogether.
    #[must_use]
    pub fn moved_far(&self) -> bool {
        self.shift_length_mm > FAR * self.extent_mm
    }
}

/// A smaller share of the overlap makes a registration doubtful.
const MIN_SHARE: f64 = 0.85;
/// A motion by a larger share of the points' extent makes a registration doubtful.
const FAR: f64 = 0.5;
/// Points whose spread across their longest direction is a smaller share of the one along it lie on
/// a line.
const LINE: f64 = 0.01;

/// Fewer points fix no rigid motion.
pub(super) const MIN_POINTS: usize = 4;

/// Moves `points` onto `target`. `None` for fewer than 4 points.
#[must_use]
pub fn register(points: &[Vec3], target: &Target, settings: Settings) -> Option<Registration> {
    if points.len() < MIN_POINTS {
        return None;
    }
    let mut moved = points.to_vec();
    // Neighbours one after the other find the same part of the target, which is then in the cache.
    moved.sort_by_cached_key(|p| cell(*p));
    let mut nearest = target.nearest(&moved, &[]);
    let limit = selection::overlap_count(points.len(), settings.overlap);
    // What the last accepted round was.
    let mut total = Rigid::IDENTITY;
    let mut pending = Rigid::IDENTITY;
    let (mut rms, mut initial, mut used, mut removed) = (f64::INFINITY, f64::NAN, 0, 0);
    let mut fixed = true;
    let mut iteration = 0;
    let end = loop {
        if settings.farthest_point_removal {
            selection::remove_farthest(&mut moved, &mut nearest);
        }
        let chosen = selection::nearest_ones(&nearest, limit);
        let squares: f64 = chosen.iter().map(|&index| nearest[index].distance.powi(2)).sum();
        let now = (squares / chosen.len() as f64).sqrt();
        // Nothing that is not a number goes on.
        if iteration > 0 && (now.is_nan() || now > rms) {
            iteration -= 1;
            break End::NoDecrease;
        }
        let decrease = rms - now;
        total = pending.after(&total);
        (rms, used, removed) = (now, chosen.len(), points.len() - moved.len());
        fixed = !on_a_line(chosen.iter().map(|&index| moved[index]))
            && !on_a_line(chosen.iter().map(|&index| nearest[index].point));
        if iteration == 0 {
            initial = now;
        }
        if decrease < settings.min_rms_decrease_mm || now == 0.0 {
            break End::Converged;
        }
        if iteration >= settings.max_iterations {
            break End::IterationLimit;
        }
        pending = horn::fit(chosen.iter().map(|&index| (moved[index], nearest[index].point)));
        moved.iter_mut().for_each(|p| *p = pending.apply(*p));
        nearest = target.nearest(&moved, &nearest);
        iteration += 1;
    };
    let middle = middle(points);
    let shift_mm = sub(total.apply(middle), middle);
    let used_share = used as f64 / points.len() as f64;
    let mut found = Registration {
        settings,
        rms_mm: rms,
        initial_rms_mm: initial,
        points_used: used,
        used_share,
        is_doubtful: !fixed,
        points_removed: removed,
        iterations: iteration,
        end,
        rotation_deg: total.angle_deg(),
        shift_mm,
        shift_length_mm: norm(shift_mm),
        extent_mm: extent(points),
        matrix: total.matrix(),
    };
    found.is_doubtful |= found.lacks_points() || found.moved_far();
    Some(found)
}

/// Diagonal of the box around some points.
fn extent(points: &[Vec3]) -> f64 {
    let reach = |a: usize| {
        let along = || points.iter().map(|p| p[a]);
        along().fold(f64::MIN, f64::max) - along().fold(f64::MAX, f64::min)
    };
    norm([0, 1, 2].map(reach))
}

/// The cube of 4 mm that a place lies in, in an order in which few neighbours are far apart.
#[expect(clippy::cast_possible_truncation, reason = "saturates, and then only the order suffers")]
fn cell(p: Vec3) -> [i32; 3] {
    let [x, y, z] = p.map(|c| (c / 4.0).floor() as i32);
    [z, y, x]
}

/// Whether places lie on a line, or are one: no motion of them is fixed then.
fn on_a_line(places: impl Iterator<Item = Vec3> + Clone) -> bool {
    let (count, sum) = places.clone().fold((0.0, [0.0; 3]), |(n, sum), p| (n + 1.0, add(sum, p)));
    let middle = scale(sum, 1.0 / count);
    let mut s = [[0.0; 3]; 3];
    for p in places {
        let d = sub(p, middle);
        for i in 0..3 {
            for j in 0..3 {
                s[i][j] += d[i] * d[j];
            }
        }
    }
    // Of the three variances: the sum, and that of the products of two.
    let sum = s[0][0] + s[1][1] + s[2][2];
    let minor = |i: usize, j: usize| s[i][i] * s[j][j] - s[i][j] * s[j][i];
    let products = minor(0, 1) + minor(0, 2) + minor(1, 2);
    // Nothing that is not a number fixes a motion.
    products.is_nan() || products <= LINE * LINE * sum * sum
}

/// Mean of the points.
fn middle(points: &[Vec3]) -> Vec3 {
    let sum = points.iter().fold([0.0; 3], |sum, p| add(sum, *p));
    scale(sum, 1.0 / points.len() as f64)
}

#[cfg(test)]
mod tests;
