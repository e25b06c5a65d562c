//! Places by the cube that holds them, of a grid through the patient's origin.

use std::ops::Range;

use rayon::prelude::*;

use crate::geometry::Vec3;
use crate::observer::stop::Asked;

/// Bits for the cube's index along each axis.
const BITS: u32 = 21;

/// A key for the cube of edge `edge` mm that holds a place in single precision, as a cloud has it; far
/// beyond any scanner's bore two cubes may share one.
pub(crate) fn key(p: Vec3, edge: f64) -> u64 {
    let cell = |v: f64| {
        let v = f64::from(v as f32);
        // `floor` is a call where the target has no instruction for it.
        let (q, whole) = (v / edge, (v / edge) as i64);
        (whole - i64::from(q < whole as f64) + (1 << (BITS - 1))) as u64 & ((1 << BITS) - 1)
    };
    cell(p[2]) << (2 * BITS) | cell(p[1]) << BITS | cell(p[0])
}

/// Sorts the numbers of places by the keys of their cubes, and by number.
pub(crate) fn sorted(asked: Asked<'_>, keyed: impl ParallelIterator<Item = (u64, u32)>) -> Vec<(u64, u32)> {
    let mut keyed: Vec<(u64, u32)> = keyed.inspect(|one| asked.ask_at(one.1 as usize)).panic_fuse().collect();
    // Each is compared again and again all through the sort.
    keyed.par_sort_unstable_by(|a, b| {
        asked.ask_at(a.1 as usize);
        a.cmp(b)
    });
    keyed
}

/// The members of each cube, of those that are sorted.
pub(crate) fn groups<'a>(asked: Asked<'_>, sorted: &'a [(u64, u32)]) -> Vec<&'a [(u64, u32)]> {
    let cubes = sorted.chunk_by(|a, b| {
        asked.ask_at(a.1 as usize);
        a.0 == b.0
    });
    cubes.collect()
}

/// Places, cube by cube.
#[derive(Debug)]
pub(crate) struct Cubes {
    sorted: Vec<(u64, u32)>,
    /// The cube of each place, counted in the order of their keys.
    of: Vec<u32>,
}

impl Cubes {
    /// Of edge `edge` mm.
    pub(crate) fn of(asked: Asked<'_>, places: impl IndexedParallelIterator<Item = Vec3>, edge: f64) -> Self {
        let sorted = sorted(asked, places.enumerate().map(|(i, place)| (key(place, edge), i as u32)));
        let mut of = vec![0; sorted.len()];
        for (cube, members) in groups(asked, &sorted).into_iter().enumerate() {
            asked.ask_at(cube);
            members.iter().for_each(|m| of[m.1 as usize] = cube as u32);
        }
        Self { sorted, of }
    }

    /// Drops them, asking.
    pub(crate) fn free(self, asked: Asked<'_>) {
        asked.free(self.sorted);
        asked.free(self.of);
    }

    /// The number of the cube that holds a place, by the place's number.
    #[inline]
    pub(crate) fn cube(&self, place: usize) -> usize {
        self.of[place] as usize
    }

    /// The key of each place's cube with the place's number, cube by cube.
    pub(crate) fn sorted(&self) -> &[(u64, u32)] {
        &self.sorted
    }

    /// For every cube where in [`Self::sorted`] the places of the 27 cubes around it are: nine rows
    /// of three along x.
    pub(crate) fn around(&self, asked: Asked<'_>) -> Vec<[Range<usize>; 9]> {
        let groups = groups(asked, &self.sorted);
        let rows = |(number, group): (usize, &&[(u64, u32)])| {
            asked.ask_at(number);
            rows_around(group[0].0).map(|[first, last]| {
                let from = self.sorted.partition_point(|m| m.0 < first);
                from..from + self.sorted[from..].partition_point(|m| m.0 <= last)
            })
        };
        groups.par_iter().enumerate().panic_fuse().map(rows).collect()
    }
}

/// The first and the last key of the nine rows of three cubes along x that a cube is the middle of.
fn rows_around(key: u64) -> [[u64; 2]; 9] {
    let first = key.wrapping_sub(1 << (2 * BITS) | 1 << BITS | 1);
    std::array::from_fn(|row| {
        let (y, z) = (row as u64 % 3, row as u64 / 3);
        let first = first.wrapping_add(z << (2 * BITS) | y << BITS);
        [first, first.wrapping_add(2)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_around_a_cube_hold_the_places_beside_it_and_no_others() {
        let edge = 1.5;
        let place = |i: i32| [i % 7 - 3, i / 7 % 7 - 4, i / 49 - 2].map(|v| (f64::from(v) + 0.3) * edge);
        let places: Vec<Vec3> = (0..343).map(place).collect();
        let cubes = Cubes::of(Asked::default(), places.par_iter().copied(), edge);
        let around = cubes.around(Asked::default());
        assert_eq!(around.len(), 343, "each has a cube of its own");
        for (i, p) in places.iter().enumerate() {
            let rows = around[cubes.cube(i)].clone().map(|row| cubes.sorted()[row].to_vec());
            let mut found: Vec<u32> = rows.iter().flatten().map(|m| m.1).collect();
            found.sort_unstable();
            let is_beside = |q: &Vec3| (0..3).all(|a| (q[a] - p[a]).abs() < 1.1 * edge);
            let expected: Vec<u32> = (0..343).filter(|&j| is_beside(&places[j as usize])).collect();
            assert_eq!(found, expected, "around {p:?}");
        }
    }
}
