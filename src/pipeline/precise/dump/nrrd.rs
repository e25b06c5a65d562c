//! Values of cells as NRRD (Nearly Raw Raster Data, <https://teem.sourceforge.net/nrrd/format.html>), in LPS
//! mm as 3D Slicer and ITK-SNAP place it.

use crate::pipeline::precise::grid::cells::Cells;

/// One value for each cell, x fastest.
pub(super) struct Values<'a> {
    /// NRRD's name of the type of a value.
    pub(super) kind: &'static str,
    /// What a value means, in one line.
    pub(super) meaning: &'a str,
    /// The values, little endian.
    pub(super) bytes: &'a [u8],
}

/// The file: a header of text, an empty line, the values.
pub(super) fn encode(cells: &Cells, values: &Values<'_>) -> Vec<u8> {
    let ([nx, ny, nz], [x, y, z], edge) = (cells.shape, cells.origin, cells.edge);
    let header = format!(
        "NRRD0004\n\
         # {}\n\
         type: {}\n\
         dimension: 3\n\
         space: left-posterior-superior\n\
         sizes: {nx} {ny} {nz}\n\
         space directions: ({edge},0,0) (0,{edge},0) (0,0,{edge})\n\
         kinds: domain domain domain\n\
         endian: little\n\
         encoding: raw\n\
         space units: \"mm\" \"mm\" \"mm\"\n\
         space origin: ({x},{y},{z})\n\
         \n",
        values.meaning, values.kind,
    );
    let mut file = header.into_bytes();
    file.extend_from_slice(values.bytes);
    file
}
