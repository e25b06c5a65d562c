//! Raw coordinates: x y z as little-endian 32-bit floats, point after point, no header.

use super::Writer;
use super::vertex::Vertex;

pub(super) const WRITER: Writer = Writer {
    header: |_, _, _, _| Vec::new(),
    vertex: |vertex, frame, out| Vertex::append_point(vertex, out, frame),
    vertex_bytes: |_| Some(12),
};
