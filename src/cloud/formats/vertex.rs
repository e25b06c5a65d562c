//! One vertex of a cloud, and which fields the vertices of a file have.

use crate::cloud::PointCloud;
use crate::geometry::Frame;

/// What a vertex carries in the formats that can say so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Field {
    /// Its property in PLY.
    pub(super) ply: &'static str,
    /// Its field in PCD, where the Point Cloud Library has a name of its own.
    pub(super) pcd: &'static str,
    /// Bytes: 4 for a float, 1 for an unsigned one.
    pub(super) size: usize,
}

impl Field {
    const fn float(ply: &'static str, pcd: &'static str) -> Self {
        Self { ply, pcd, size: 4 }
    }

    const fn byte(name: &'static str) -> Self {
        Self { ply: name, pcd: name, size: 1 }
    }
}

const POINT: [Field; 3] = [Field::float("x", "x"), Field::float("y", "y"), Field::float("z", "z")];
const NORMAL: [Field; 3] =
    [Field::float("nx", "normal_x"), Field::float("ny", "normal_y"), Field::float("nz", "normal_z")];
const ERROR: [Field; 1] = [Field::float("expected_error_mm", "expected_error_mm")];
const FLAGS: [Field; 2] = [Field::byte("planes"), Field::byte("unique")];

/// Which of the fields that not every cloud has are there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) normals: bool,
    pub(super) errors: bool,
}

impl Layout {
    /// All layouts, the barest first.
    pub(super) const ALL: [Self; 4] = [
        Self { normals: false, errors: false },
        Self { normals: true, errors: false },
        Self { normals: false, errors: true },
        Self { normals: true, errors: true },
    ];

    pub(super) fn of(cloud: &PointCloud) -> Self {
        Self { normals: !cloud.normals.is_empty(), errors: !cloud.errors.is_empty() }
    }

    /// That of a cloud of so many points: one without points has no fields that not every cloud has.
    pub(super) fn with_points(self, points: usize) -> Self {
        if points == 0 { Self::ALL[0] } else { self }
    }

    /// The fields of a vertex in their order: floats first, bytes last.
    pub(super) fn fields(self) -> impl Iterator<Item = Field> {
        let normal = NORMAL.into_iter().filter(move |_| self.normals);
        let error = ERROR.into_iter().filter(move |_| self.errors);
        POINT.into_iter().chain(normal).chain(error).chain(FLAGS)
    }

    /// Bytes of a vertex.
    pub(super) fn size(self) -> usize {
        self.fields().map(|field| field.size).sum()
    }
}

/// One vertex, LPS mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Vertex {
    pub(super) point: [f32; 3],
    pub(super) normal: Option<[f32; 3]>,
    pub(super) error: Option<f32>,
    /// Bits of the planes, as in [`crate::geometry::PlaneSet`].
    pub(super) planes: u8,
    /// 0 or 1.
    pub(super) unique: u8,
}

impl Vertex {
    /// The vertex at `i < cloud.len()`.
    pub(super) fn of(cloud: &PointCloud, i: usize) -> Self {
        Self {
            point: cloud.points[i],
            normal: cloud.normals.get(i).copied(),
            error: cloud.errors.get(i).copied(),
            planes: cloud.planes[i].bits(),
            unique: u8::from(cloud.unique[i]),
        }
    }

    /// Point, normal and error, those that there are, in that frame.
    pub(super) fn floats(&self, frame: Frame) -> impl Iterator<Item = f32> {
        // A direction turns with the axes as a point does.
        let normal = self.normal.map(|normal| frame.from_lps(normal));
        frame.from_lps(self.point).into_iter().chain(normal.into_iter().flatten()).chain(self.error)
    }

    /// Appends little-endian floats and the two flags.
    pub(super) fn append_packed(&self, out: &mut Vec<u8>, frame: Frame) {
        for value in self.floats(frame) {
            out.extend(value.to_le_bytes());
        }
        out.extend([self.planes, self.unique]);
    }

    /// Appends the point alone as little-endian floats.
    pub(super) fn append_point(&self, out: &mut Vec<u8>, frame: Frame) {
        for coordinate in frame.from_lps(self.point) {
            out.extend(coordinate.to_le_bytes());
        }
    }
}
