//! The `precise` profile: the whole skin, in its true place, on any head CT.

mod between;
mod couch;
mod crossings;
mod distance;
mod edge;
mod head;
mod leaves;
mod levels;
mod outside;
mod patient;
mod pieces;
mod regions;
mod space;
mod survey;
mod width;

use crate::cloud::PointCloud;
use crate::dicom::Volume;

/// Dev entry.
pub fn dev(volume: &Volume, leaf: f64) -> Option<(PointCloud, Vec<[f32; 6]>)> {
    let t = std::time::Instant::now();
    let lap = |what: &str| eprintln!("{:6.2}s {what}", t.elapsed().as_secs_f64());
    let space = space::Space::new(volume)?;
    let levels = levels::Levels::of(&space)?;
    lap(&format!("levels {levels:?}"));
    let patient = patient::Patient::find(&space, &levels)?;
    lap(&format!("patient {:?}", patient.cells));
    let head = head::Head::of(&space, &levels, &patient);
    lap(&format!("{head:?}"));
    let outside = outside::Outside::find(&space, &patient);
    lap("outside");
    let mut candidates = crossings::candidates(&space, &levels, &patient, &outside);
    lap(&format!("candidates {}", candidates.len()));
    let regions = regions::Regions::of(&candidates, &levels);
    let width = width::Width::of(&space, &candidates, &regions);
    lap(&format!("{width:?}"));
    crossings::refine_levels(&space, &width, &regions, &mut candidates);
    let regions = regions::Regions::of(&candidates, &levels);
    let points = crossings::measure(&space, &levels, &width, &regions, &candidates);
    lap(&format!("crossings {}", points.len()));
    let points = between::fill(&space, points);
    lap(&format!("with those between slices {}", points.len()));
    let points = leaves::thin(&points, leaf);
    lap(&format!("points {}", points.len()));
    let cloud = PointCloud {
        points: points.iter().map(|c| c.place.map(|v| v as f32)).collect(),
        planes: points.iter().map(|c| c.planes).collect(),
        unique: vec![false; points.len()],
    };
    let extra = points
        .iter()
        .map(|c| [c.normal[0] as f32, c.normal[1] as f32, c.normal[2] as f32, c.error as f32, f32::from(c.axis) + if c.between { 4.0 } else { 0.0 }, c.coarseness as f32])
        .collect();
    Some((cloud, extra))
}
