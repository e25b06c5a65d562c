//! The straight line on which the slices of one volume lie, whatever their spacing and the gantry's
//! tilt.

use super::SeriesError;
use super::slice::Slice;
use crate::geometry::{Vec3, add, norm, scale, sub};

/// Farthest that a slice may lie off the line, mm. Positions that are rounded to 0.1 mm lie within a
/// tenth of it.
pub(super) const OFF_LINE: f64 = 0.5;
/// Most that the line may lean against the slices' normal, degrees. Gantries tilt by up to 30.
const STEEPEST: f64 = 45.0;

/// Fewer slices than this have no median that one of them can't move.
const FEW: usize = 5;

/// Refuses a stack, sorted along `normal`, of which a slice lies beside the line of the others, or
/// whose line leans more than a gantry can.
///
/// The slices named are those off the line on which most of them lie.
pub(super) fn straight(slices: &[Slice], normal: Vec3) -> Result<(), SeriesError> {
    let points: Vec<Point> = slices.iter().map(|slice| Point::of(slice, normal)).collect();
    let fewest = leans(&points)
        .into_iter()
        .map(|lean| (lean, off_line(&points, lean)))
        .min_by_key(|(_, off)| off.iter().filter(|off| **off > OFF_LINE).count());
    let Some((lean, off)) = fewest else { return Ok(()) };
    let most = off.iter().copied().fold(0.0, f64::max);
    if most > OFF_LINE {
        let odd: Vec<Slice> = slices
            .iter()
            .zip(off)
            .filter(|(_, off)| *off > OFF_LINE)
            .map(|(slice, _)| slice.clone())
            .collect();
        return Err(SeriesError::new(
            "inconsistent_position",
            format!(
                "{} of {} slices lie beside the line of the others, by up to {most:.3} mm (the limit is {OFF_LINE} \
                 mm): the patient or the table was moved, or ImagePositionPatient is wrong; send one volume as one \
                 series",
                odd.len(),
                slices.len()
            ),
            super::check::named(&odd, |_| true),
        ));
    }
    let degrees = norm(lean).atan().to_degrees();
    if degrees > STEEPEST {
        return Err(SeriesError::new(
            "excessive_tilt",
            format!(
                "the slices are sheared by {degrees:.2} degrees against their normal, more than the {STEEPEST} that a \
                 gantry can be taken to tilt: ImagePositionPatient or ImageOrientationPatient is wrong"
            ),
            super::check::named(slices, |_| true),
        ));
    }
    Ok(())
}

/// A slice's place: how far along the normal, and where across it.
#[derive(Clone, Copy)]
struct Point {
    along: f64,
    across: Vec3,
}

impl Point {
    fn of(slice: &Slice, normal: Vec3) -> Self {
        let along = slice.along(normal);
        Self { along, across: sub(slice.geometry().position, scale(normal, along)) }
    }
}

/// Ways in which the line may lean, mm across for 1 mm along: the median over pairs that lie half a
/// stack apart, which a few wrong ones do not move; and over neighbours, which a part of the stack
/// that was moved as a whole does not move. Too few slices have no such median; the first and the
/// last stand for them.
fn leans(points: &[Point]) -> Vec<Vec3> {
    let half = points.len() / 2;
    let far = points.iter().zip(points.get(half..).unwrap_or_default());
    let near = points.iter().zip(points.get(1..).unwrap_or_default());
    let lean = |(from, to): (&Point, &Point)| {
        let along = to.along - from.along;
        (along > 0.0).then(|| scale(sub(to.across, from.across), 1.0 / along))
    };
    let ends = points.first().zip(points.last()).filter(|_| points.len() < FEW).and_then(lean);
    let far: Vec<Vec3> = far.filter_map(lean).collect();
    let near: Vec<Vec3> = near.filter_map(lean).collect();
    [ends, median(&far), median(&near)].into_iter().flatten().collect()
}

/// Distance of each point across the normal from the line of that lean through their median.
fn off_line(points: &[Point], lean: Vec3) -> Vec<f64> {
    // Held against the first point, so that no large numbers are subtracted.
    let start = points.first().map_or(0.0, |point| point.along);
    let rest: Vec<Vec3> =
        points.iter().map(|point| add(point.across, scale(lean, start - point.along))).collect();
    let centre = median(&rest).unwrap_or_default();
    rest.into_iter().map(|point| norm(sub(point, centre))).collect()
}

/// The median of each component; of an even number, the lower one of the two in the middle, so that
/// it is one of two heaps and not between them.
fn median(of: &[Vec3]) -> Option<Vec3> {
    let middle = of.len().checked_sub(1)? / 2;
    Some([0, 1, 2].map(|axis| {
        let mut values: Vec<f64> = of.iter().map(|vector| vector[axis]).collect();
        values.sort_by(f64::total_cmp);
        values[middle]
    }))
}
