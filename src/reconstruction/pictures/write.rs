//! Volume and contours → file.

use std::io;

use ndarray::Slice;
use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator, ParallelIterator};

use super::header::{Header, SCHEMA};
use super::{BRICK, MAGIC, MOST_BYTES, MOST_LOST_BITS, deflated, marks};
use crate::dicom::Volume;
use crate::geometry::{Plane, norm};
use crate::observer::stop::Asked;
use crate::pipeline::{COLOURS, Reconstruction, WINDOW, grey, marks_of_plane};

/// The file of a reconstruction of `volume`. Deflates brick by brick: beyond the volume it needs no
/// more memory than the file has bytes.
///
/// # Errors
/// Those of writing to memory: none.
pub(crate) fn write(
    asked: Asked<'_>,
    volume: &Volume,
    reconstruction: &Reconstruction,
) -> io::Result<Vec<u8>> {
    let mut blocks = Vec::new();
    let mut lengths = [Vec::new(), Vec::new(), Vec::new()];
    for plane in Plane::ALL {
        let of_slices = marks_of_plane(asked, reconstruction, volume.grid.shape(), plane);
        let packed: Vec<io::Result<Vec<u8>>> = of_slices
            .into_par_iter()
            .panic_fuse()
            .map(|marks| {
                asked.ask();
                if marks.is_empty() { Ok(Vec::new()) } else { deflated(&marks::bytes_of(&marks)) }
            })
            .collect();
        for block in packed {
            let block = block?;
            lengths[plane.index()].push(block.len());
            blocks.extend(block);
        }
    }
    let (origin, size) = in_view(asked, volume);
    let room = MOST_BYTES.saturating_sub(blocks.len());
    let (mut lost_bits, mut bricks) = (0, bricks(asked, volume, origin, size, 0)?);
    while lost_bits < MOST_LOST_BITS && bricks.iter().map(Vec::len).sum::<usize>() > room {
        lost_bits += 1;
        bricks = self::bricks(asked, volume, origin, size, lost_bits)?;
    }
    let header = Header {
        schema: SCHEMA,
        shape: volume.grid.shape(),
        step_mm: volume.grid.step().map(norm),
        window: [WINDOW.0, WINDOW.1],
        lost_bits,
        origin,
        size,
        brick: BRICK,
        bricks: bricks.iter().map(Vec::len).collect(),
        pixels: reconstruction.contours.are_pixels(),
        colours: COLOURS.map(|colour| colour.0).into(),
        marks: lengths,
    };
    let header = serde_json::to_vec(&header)?;
    let mut file = MAGIC.to_vec();
    file.extend(u32::try_from(header.len()).map_err(io::Error::other)?.to_le_bytes());
    file.extend(header);
    asked.ask();
    bricks.iter().for_each(|brick| file.extend(brick));
    file.extend(blocks);
    Ok(file)
}

/// First voxel and voxels of the smallest box around all that is not black.
fn in_view(asked: Asked<'_>, volume: &Volume) -> ([usize; 3], [usize; 3]) {
    let [nz, ny, nx] = volume.grid.shape();
    let nothing = ([usize::MAX; 3], [0; 3]);
    let (first, end) = (0..nz)
        .into_par_iter()
        .panic_fuse()
        .map(|z| {
            asked.ask();
            let slice = volume.hu.index_axis(ndarray::Axis(0), z);
            let mut found = nothing;
            for (y, row) in slice.outer_iter().enumerate().take(ny) {
                let shows = |hu: &i16| grey(*hu) > 0;
                let Some(left) = row.iter().position(shows) else { continue };
                let right = row.iter().rposition(shows).unwrap_or(left).min(nx - 1);
                found = joined(found, ([z, y, left], [z + 1, y + 1, right + 1]));
            }
            found
        })
        .reduce(|| nothing, joined);
    if end == [0; 3] {
        return ([0; 3], [0; 3]);
    }
    (first, std::array::from_fn(|axis| end[axis] - first[axis]))
}

fn joined(a: ([usize; 3], [usize; 3]), b: ([usize; 3], [usize; 3])) -> ([usize; 3], [usize; 3]) {
    (
        std::array::from_fn(|axis| a.0[axis].min(b.0[axis])),
        std::array::from_fn(|axis| a.1[axis].max(b.1[axis])),
    )
}

/// Every brick, deflated.
fn bricks(
    asked: Asked<'_>,
    volume: &Volume,
    origin: [usize; 3],
    size: [usize; 3],
    lost_bits: u8,
) -> io::Result<Vec<Vec<u8>>> {
    let [nz, ny, nx] = size.map(|voxels| voxels.div_ceil(BRICK));
    (0..nz * ny * nx)
        .into_par_iter()
        .with_min_len(8)
        .panic_fuse()
        .map(|number| {
            asked.ask();
            let place = [number / (ny * nx), number / nx % ny, number % nx];
            let voxels = volume.hu.slice_each_axis(|along| {
                let axis = along.axis.index();
                let first = origin[axis] + place[axis] * BRICK;
                Slice::from(first..(first + BRICK).min(origin[axis] + size[axis]))
            });
            let shades: Vec<u8> = voxels.iter().map(|hu| grey(*hu) >> lost_bits).collect();
            if shades.iter().all(|shade| *shade == 0) { Ok(Vec::new()) } else { deflated(&shades) }
        })
        .collect()
}
