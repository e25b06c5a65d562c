//! How far a cloud lies from the phantom's known skin. Nothing is registered: a shifted or mirrored
//! cloud scores badly.

use crate::cloud::PointCloud;
use crate::phantom::Phantom;

/// Only points so near count for rms and bias, mm: farther ones are no skin.
const NEAR_MM: f64 = 3.0;

/// A point farther from the skin than this is stray, mm: holder, inner anatomy.
const STRAY_MM: f64 = 2.0;

/// What a cloud is called absurd for. The profile `paper` gives rms 0.6 to 0.7 mm, bias −0.6 mm and
/// 0.2 % stray on such phantoms.
const ABSURD: Score = Score { points: 10_000, rms_mm: 1.0, bias_mm: 1.0, stray: 0.02 };

/// A cloud's distance to the known skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Score {
    /// Points of the cloud.
    pub(super) points: usize,
    /// Root mean square of the signed distance of the points near the skin, mm.
    pub(super) rms_mm: f64,
    /// Their mean signed distance, mm, positive outside the head.
    pub(super) bias_mm: f64,
    /// Share of stray points, 0 to 1.
    pub(super) stray: f64,
}

impl Score {
    pub(super) fn new(cloud: &PointCloud, phantom: &Phantom) -> Self {
        let distances: Vec<f64> =
            cloud.points.iter().map(|point| phantom.signed_distance(point.map(f64::from))).collect();
        let near: Vec<f64> = distances.iter().copied().filter(|distance| distance.abs() < NEAR_MM).collect();
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / near.len() as f64;
        let stray = distances.iter().filter(|distance| distance.abs() > STRAY_MM).count();
        Self {
            points: distances.len(),
            rms_mm: mean(&mut near.iter().map(|distance| distance * distance)).sqrt(),
            bias_mm: mean(&mut near.iter().copied()),
            stray: stray as f64 / distances.len() as f64,
        }
    }

    /// Whether this can't be the phantom's skin. Also true where a figure is not a number.
    pub(super) fn is_absurd(&self) -> bool {
        let plausible = self.points >= ABSURD.points
            && self.rms_mm <= ABSURD.rms_mm
            && self.bias_mm.abs() <= ABSURD.bias_mm
            && self.stray <= ABSURD.stray;
        !plausible
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::PlaneSet;
    use crate::phantom::Options;

    fn cloud(points: Vec<[f32; 3]>) -> PointCloud {
        let (planes, unique) = (vec![PlaneSet::EMPTY; points.len()], vec![false; points.len()]);
        PointCloud { points, planes, unique, ..PointCloud::default() }
    }

    fn skin(phantom: &Phantom) -> Vec<[f32; 3]> {
        phantom.skin_points(1.5).into_iter().map(|point| point.map(|mm| mm as f32)).collect()
    }

    #[test]
    fn the_skin_itself_scores_well_and_the_mirrored_or_shifted_one_is_absurd() {
        let phantom = Phantom::new(Options::default()).unwrap();
        let skin = skin(&phantom);
        let score = Score::new(&cloud(skin.clone()), &phantom);
        assert!(score.rms_mm < 0.05 && score.stray == 0.0 && !score.is_absurd(), "{score:?}");
        let shifted = skin.iter().map(|[x, y, z]| [*x, *y, z + 5.0]).collect();
        assert!(Score::new(&cloud(shifted), &phantom).is_absurd());
        let mirrored = skin.iter().map(|[x, y, z]| [-x, *y, *z]).collect();
        assert!(Score::new(&cloud(mirrored), &phantom).is_absurd());
    }

    #[test]
    fn an_empty_cloud_is_absurd() {
        let phantom = Phantom::new(Options::default()).unwrap();
        assert!(Score::new(&cloud(Vec::new()), &phantom).is_absurd());
    }
}
