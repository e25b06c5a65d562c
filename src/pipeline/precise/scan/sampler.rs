//! The volume as a continuous field: where an index is in the patient, and what the scan shows at
//! a place.

use crate::geometry::{Axis, Grid, Vec3, add, cross, dot, norm, normalised, scale, sub};
use crate::observer::Observer;
use crate::observer::stop::Asked;
use crate::pipeline::precise::grid::index::{Voxel, VoxelPlace};

/// Read access to a volume by voxel, by fractional index and by place in LPS mm.
///
/// Between two slices positions are interpolated linearly, so that tilt (a shear) and variable
/// spacing are exact at every slice.
#[derive(Debug)]
pub(crate) struct Sampler<'a> {
    /// Hounsfield units, x fastest.
    pub(crate) hu: &'a [i16],
    /// `[nz, ny, nx]`.
    pub(crate) shape: [usize; 3],
    /// Index of the last voxel along each axis.
    last: [f64; 3],
    slice_axis: usize,
    in_plane: [usize; 2],
    origins: Vec<Vec3>,
    step: [Vec3; 3],
    normal: Vec3,
    /// Place of each slice along `normal`, mm; ascending.
    heights: Vec<f64>,
    slices_per_mm: f64,
    /// Reciprocal vectors of the two in-plane steps.
    reciprocal: [Vec3; 2],
    /// Of a scan with even steps: what turns mm from the first voxel into `[z, y, x]`.
    even: Option<[Vec3; 3]>,
    /// Whom every step asks as it goes over the scan.
    asked: Asked<'a>,
}

/// Voxels so many times longer along one axis of the images than along both others come from slices along
/// it: the series was reformatted.
const REFORMATTED: f64 = 1.1;

/// Slices no further than this from where even steps would put them count as even, mm.
const EVEN_MM: f64 = 1e-6;

/// The grid with the slices along its coarsest axis, be it that of the images or, in a sagittal or coronal
/// series that was reformatted from thick axial slices, another one.
pub(crate) fn along_coarsest(grid: &Grid) -> Grid {
    let length = |axis: Axis| norm(grid.step()[axis as usize]);
    let coarsest = Axis::ALL.into_iter().max_by(|&a, &b| length(a).total_cmp(&length(b)));
    let others = |axis| Axis::ALL.into_iter().filter(move |&a| a != axis).map(length).fold(0.0, f64::max);
    let reformatted = coarsest.filter(|&axis| length(axis) > REFORMATTED * others(axis));
    reformatted.and_then(|axis| grid.sliced_along(axis)).unwrap_or_else(|| grid.clone())
}

impl<'a> Sampler<'a> {
    /// Voxels in HU, x fastest, and their grid. `None` with fewer than two voxels along an axis, or where
    /// they have no extent.
    pub(crate) fn new(hu: &'a [i16], grid: &Grid) -> Option<Self> {
        let shape = grid.shape();
        if shape.iter().any(|&n| n < 2) {
            return None;
        }
        let slice_axis = grid.slice_axis() as usize;
        let in_plane = match grid.slice_axis() {
            Axis::Z => [1, 2],
            Axis::Y => [0, 2],
            Axis::X => [0, 1],
        };
        let step = *grid.step();
        let [a, b] = in_plane.map(|i| step[i]);
        let mut normal = normalised(cross(a, b))?;
        if dot(normal, step[slice_axis]) < 0.0 {
            normal = scale(normal, -1.0);
        }
        let origins = grid.slice_origins().to_vec();
        let heights: Vec<f64> = origins.iter().map(|&o| dot(o, normal)).collect();
        if heights.windows(2).any(|w| w[1] <= w[0]) {
            return None;
        }
        let slices_per_mm = (heights.len() - 1) as f64 / (heights[heights.len() - 1] - heights[0]);
        let up = cross(a, b);
        let area = dot(up, up);
        let reciprocal = [scale(cross(b, up), 1.0 / area), scale(cross(up, a), 1.0 / area)];
        let mut sampler = Self {
            hu,
            shape,
            last: shape.map(|n| (n - 1) as f64),
            slice_axis,
            in_plane,
            origins,
            step,
            normal,
            heights,
            slices_per_mm,
            reciprocal,
            even: None,
            asked: Asked::default(),
        };
        sampler.even = sampler.even_steps();
        Some(sampler)
    }

    /// The same, with somebody to ask whether to stop.
    pub(crate) fn asking(mut self, observer: &'a dyn Observer) -> Self {
        self.asked = Asked::of(observer);
        self
    }

    /// Whom to ask, for those that see no more of the scan.
    pub(crate) fn asked(&self) -> Asked<'a> {
        self.asked
    }

    /// Stops here if the observer says so.
    #[inline]
    pub(crate) fn ask(&self) {
        self.asked.ask();
    }

    /// The same once for so many items of a loop, by the number of the item: what an item costs is far
    /// less than to ask.
    #[inline]
    pub(crate) fn ask_at(&self, item: usize) {
        self.asked.ask_at(item);
    }

    fn even_steps(&self) -> Option<[Vec3; 3]> {
        let [first, .., last] = self.origins[..] else { return None };
        let step = scale(sub(last, first), 1.0 / (self.origins.len() - 1) as f64);
        let expected = |k: usize| add(first, scale(step, k as f64));
        if self.origins.iter().enumerate().any(|(k, &o)| norm(sub(o, expected(k))) > EVEN_MM) {
            return None;
        }
        let across = scale(self.normal, 1.0 / dot(step, self.normal));
        let mut rows = [across; 3];
        for (axis, r) in self.in_plane.into_iter().zip(self.reciprocal) {
            rows[axis] = sub(r, scale(across, dot(step, r)));
        }
        Some(rows)
    }

    /// Offset of a voxel in [`Self::hu`].
    #[inline]
    pub(crate) fn offset(&self, Voxel([z, y, x]): Voxel) -> usize {
        (z * self.shape[1] + y) * self.shape[2] + x
    }

    /// Offset of one step along an axis.
    #[inline]
    pub(crate) fn stride(&self, axis: usize) -> usize {
        [self.shape[1] * self.shape[2], self.shape[2], 1][axis]
    }

    /// Hounsfield units of a voxel.
    #[inline]
    pub(crate) fn voxel(&self, index: Voxel) -> f32 {
        f32::from(self.hu[self.offset(index)])
    }

    /// Index of the axis of the slices: the one along which they were acquired, or the coarsest.
    pub(crate) fn slice_axis(&self) -> usize {
        self.slice_axis
    }

    /// Unit vector from the first slice to the last, at right angles to the slices.
    pub(crate) fn slice_normal(&self) -> Vec3 {
        self.normal
    }

    /// The step from `index` to `index + 1` along `axis`, mm (the last one again beyond the end).
    #[inline]
    pub(crate) fn step_at(&self, axis: usize, index: usize) -> Vec3 {
        if axis == self.slice_axis {
            let k = index.min(self.origins.len() - 2);
            sub(self.origins[k + 1], self.origins[k])
        } else {
            self.step[axis]
        }
    }

    /// From each slice to the next, mm.
    pub(crate) fn gaps(&self) -> Vec<f64> {
        let axis = self.slice_axis();
        (0..self.shape[axis] - 1).map(|k| dot(self.step_at(axis, k), self.slice_normal()).abs()).collect()
    }

    /// The area of a pixel of the slices, mm².
    pub(crate) fn pixel_mm2(&self) -> f64 {
        let [a, b] = self.in_plane.map(|a| self.step[a]);
        norm(cross(a, b))
    }

    /// The longer edge of a pixel of the slices, mm.
    pub(crate) fn largest_pixel(&self) -> f64 {
        self.in_plane.map(|a| norm(self.step[a])).into_iter().fold(0.0, f64::max)
    }

    /// Unit vectors along the two axes of the slices.
    pub(crate) fn in_plane_units(&self) -> [Vec3; 2] {
        self.in_plane.map(|a| scale(self.step[a], 1.0 / norm(self.step[a])))
    }

    /// Unit vectors along the three axes, the slices' normal in place of theirs: at right angles even if
    /// the gantry was tilted.
    pub(crate) fn units(&self) -> [Vec3; 3] {
        let mut units = [self.normal; 3];
        for (axis, unit) in self.in_plane.into_iter().zip(self.in_plane_units()) {
            units[axis] = unit;
        }
        units
    }

    /// The slice nearest to a place.
    pub(crate) fn slice_of(&self, p: Vec3) -> usize {
        let k = self.index(p).nearest()[self.slice_axis];
        k.min(self.shape[self.slice_axis] - 1)
    }

    /// The mean step along an axis, mm.
    pub(crate) fn mean_step(&self, axis: usize) -> Vec3 {
        self.step[axis]
    }

    /// LPS mm of a place in voxels; beyond the volume the last step goes on.
    #[inline]
    pub(crate) fn lps(&self, index: VoxelPlace) -> Vec3 {
        let s = index[self.slice_axis];
        let k = (s.floor().max(0.0) as usize).min(self.origins.len() - 2);
        let t = s - k as f64;
        let p = add(self.origins[k], scale(sub(self.origins[k + 1], self.origins[k]), t));
        let [a, b] = self.in_plane;
        add(p, add(scale(self.step[a], index[a]), scale(self.step[b], index[b])))
    }

    /// A place of the patient in voxels; outside the volume too.
    #[inline]
    pub(crate) fn index(&self, p: Vec3) -> VoxelPlace {
        if let Some(rows) = &self.even {
            let r = sub(p, self.origins[0]);
            return VoxelPlace(rows.map(|row| dot(r, row)));
        }
        let h = dot(p, self.normal);
        let k = self.slice_below(h);
        let t = (h - self.heights[k]) / (self.heights[k + 1] - self.heights[k]);
        let origin = add(self.origins[k], scale(sub(self.origins[k + 1], self.origins[k]), t));
        let r = sub(p, origin);
        let mut index = [0.0; 3];
        index[self.slice_axis] = k as f64 + t;
        index[self.in_plane[0]] = dot(r, self.reciprocal[0]);
        index[self.in_plane[1]] = dot(r, self.reciprocal[1]);
        VoxelPlace(index)
    }

    /// The line through a place whose parameter is in steps from there.
    #[inline]
    pub(crate) fn line(&self, from: Vec3, step: Vec3) -> Line<'_> {
        let each = self.even.as_ref().map(|rows| rows.map(|row| dot(step, row)));
        Line { sampler: self, from, step, first: self.index(from), each }
    }

    /// The slice below a height along the normal, but for the last slice: guessed from the mean
    /// step, which is right at once where spacing is regular.
    #[inline]
    fn slice_below(&self, height: f64) -> usize {
        let last = self.heights.len() - 2;
        let guess = (height - self.heights[0]) * self.slices_per_mm;
        let mut k = (guess.max(0.0) as usize).min(last);
        while k > 0 && self.heights[k] > height {
            k -= 1;
        }
        while k < last && self.heights[k + 1] <= height {
            k += 1;
        }
        k
    }

    /// Hounsfield units at a place, trilinear; `None` outside the voxel centres.
    #[inline]
    pub(crate) fn sample(&self, p: Vec3) -> Option<f32> {
        self.sample_index(self.index(p))
    }

    /// The nearest place within the volume, in voxels.
    #[inline]
    pub(crate) fn clamped(&self, p: Vec3) -> VoxelPlace {
        self.within(self.index(p))
    }

    /// The nearest place within the volume.
    #[inline]
    pub(crate) fn within(&self, index: VoxelPlace) -> VoxelPlace {
        VoxelPlace(std::array::from_fn(|a| index[a].clamp(0.0, self.last[a])))
    }

    /// Hounsfield units at a place in voxels, trilinear; `None` outside the voxel centres.
    #[inline]
    pub(crate) fn sample_index(&self, index: VoxelPlace) -> Option<f32> {
        let (mut base, mut t) = ([0; 3], [0f32; 3]);
        for axis in 0..3 {
            let v = index[axis];
            if !(v >= 0.0 && v <= self.last[axis]) {
                return None;
            }
            // A conversion to and from i32 is one instruction.
            let whole = (v as i32).min(self.shape[axis] as i32 - 2);
            base[axis] = whole as usize;
            t[axis] = (v - f64::from(whole)) as f32;
        }
        let o = self.offset(Voxel(base));
        let (sz, sy) = (self.stride(0), self.stride(1));
        let row = |o: usize| {
            let pair = &self.hu[o..o + 2];
            let (a, b) = (f32::from(pair[0]), f32::from(pair[1]));
            a + (b - a) * t[2]
        };
        let plane = |o: usize| {
            let (a, b) = (row(o), row(o + sy));
            a + (b - a) * t[1]
        };
        let (a, b) = (plane(o), plane(o + sz));
        Some(a + (b - a) * t[0])
    }
}

/// A straight line through a volume, for those who look at several places of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line<'a> {
    sampler: &'a Sampler<'a>,
    from: Vec3,
    step: Vec3,
    first: VoxelPlace,
    /// Of a step, where slices are even.
    each: Option<[f64; 3]>,
}

impl Line<'_> {
    /// The place in voxels so many steps along the line.
    #[inline]
    pub(crate) fn index(&self, steps: f64) -> VoxelPlace {
        match self.each {
            Some(each) => VoxelPlace(std::array::from_fn(|a| self.first[a] + steps * each[a])),
            None => self.sampler.index(add(self.from, scale(self.step, steps))),
        }
    }

    /// Hounsfield units there, trilinear; `None` outside the voxel centres.
    #[inline]
    pub(crate) fn sample(&self, steps: f64) -> Option<f32> {
        self.sampler.sample_index(self.index(steps))
    }
}
