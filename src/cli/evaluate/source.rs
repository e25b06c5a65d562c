//! A cloud or mesh that was opened, and what was assumed of it.

use std::path::Path;

use serde::Serialize;

use crate::cli::{Exit, Failed};
use crate::evaluation::{Kind, Shape, files};
use crate::geometry::Frame;

/// Where a file's frame is known from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FrameFrom {
    /// The file's comments.
    File,
    /// The command line.
    Flag,
    /// The command line, though the file's comments name the other one.
    FlagAgainstFile,
    /// Nothing says it: LPS, as everything in DICOM.
    Assumed,
}

/// What was read, for table and JSON.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Source {
    /// The path as it was given.
    pub(super) file: String,
    /// Cloud or mesh.
    pub(super) kind: Kind,
    /// Points that are used.
    pub(super) points: usize,
    /// Triangles of a mesh.
    pub(super) triangles: usize,
    /// The frame that the file is in.
    pub(super) frame: Frame,
    /// How that is known.
    pub(super) frame_from: FrameFrom,
    /// Points that are left out: no numbers, or beyond 10 km.
    pub(super) dropped_points: usize,
}

/// From this ratio of two extents to as far on the other side of 1000, one is in metres and the other in mm.
const METRES: f64 = 500.0;

/// A shape in LPS mm, with what is to be said of it.
#[derive(Debug)]
pub(crate) struct Opened {
    pub(crate) shape: Shape,
    pub(crate) source: Source,
}

impl Opened {
    /// Reads `path`; `flag` overrides what the file says of its frame.
    pub(crate) fn new(path: &Path, flag: Option<Frame>) -> Result<Self, Failed> {
        let failed =
            |error: &dyn std::fmt::Display| Failed::new(Exit::Input, format!("{}: {error}", path.display()));
        let bytes = std::fs::read(path).map_err(|error| failed(&error))?;
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let files::Contents { shape, frame: stated } =
            files::read(&bytes, &extension).map_err(|error| failed(&error))?;
        let (frame, frame_from) = match (flag, stated) {
            (Some(flag), Some(stated)) if flag != stated => (flag, FrameFrom::FlagAgainstFile),
            (Some(flag), _) => (flag, FrameFrom::Flag),
            (None, Some(stated)) => (stated, FrameFrom::File),
            (None, None) => (Frame::Lps, FrameFrom::Assumed),
        };
        let mut shape = shape.into_lps(frame);
        let dropped_points = shape.drop_unusable();
        let source = Source {
            file: path.display().to_string(),
            kind: shape.kind(),
            points: shape.points.len(),
            triangles: shape.triangles.len(),
            frame,
            frame_from,
            dropped_points,
        };
        Ok(Self { shape, source })
    }

    /// Refuses what is a thousand times as large as the other: one of them is not in mm. Figures of it
    /// would say nothing, and take long.
    pub(crate) fn check_unit(&self, other: &Self) -> Result<(), Failed> {
        let [a, b] = [self, other].map(|opened| opened.shape.extent_mm());
        let ratio = (a / b).max(b / a);
        if !(METRES..=1e6 / METRES).contains(&ratio) {
            return Ok(());
        }
        let [first, second] = [&self.source.file, &other.source.file];
        let (small, large) = if a < b { (first, second) } else { (second, first) };
        Err(Failed::new(
            Exit::Input,
            format!(
                "{large} is {ratio:.0} times as large as {small}: one of them is not in mm; \
                 multiply coordinates in metres by 1000"
            ),
        ))
    }
}
