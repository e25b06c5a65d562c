"""A series as Hounsfield units with the places of its voxels (LPS mm), and as a grid of 1 mm along LPS."""
import io
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np
import pydicom


@dataclass
class Scan:
    hu: np.ndarray  # [slice, row, column]
    origins: np.ndarray  # place of the first voxel of each slice
    along_columns: np.ndarray  # unit vector from one column to the next
    along_rows: np.ndarray
    spacing: tuple[float, float]  # mm from row to row, from column to column

    @property
    def normal(self):
        return np.cross(self.along_columns, self.along_rows)

    def heights(self):
        return (self.origins - self.origins[0]) @ self.normal

    def lps(self, index):
        """Places of fractional indices [slice, row, column]."""
        index = np.asarray(index, float)
        low = np.clip(np.floor(index[:, 0]).astype(int), 0, len(self.origins) - 2)
        share = (index[:, 0] - low)[:, None]
        origin = self.origins[low] * (1 - share) + self.origins[low + 1] * share
        return origin + index[:, 2:3] * self.spacing[1] * self.along_columns + index[:, 1:2] * self.spacing[0] * self.along_rows

    def index(self, places):
        """Fractional indices of places; beyond the first and the last slice -1 and the number of slices."""
        heights = self.heights()
        slices = np.interp((places - self.origins[0]) @ self.normal, heights, np.arange(len(heights)), left=-1, right=len(heights))
        low = np.clip(np.floor(slices).astype(int), 0, len(heights) - 2)
        share = (slices - low)[:, None]
        rest = places - (self.origins[low] * (1 - share) + self.origins[low + 1] * share)
        return np.stack([slices, rest @ self.along_rows / self.spacing[0], rest @ self.along_columns / self.spacing[1]], 1)

    def rays(self, places, directions, steps):
        c = lambda v: np.ascontiguousarray(v, np.float64)
        return rays(
            self.hu, self.heights(), c(self.origins), c(self.normal), c(self.along_rows), c(self.along_columns),
            c(self.spacing), c(places), c(directions), c(steps),
        )

    def sample(self, places):
        return trilinear(self.hu, self.index(np.asarray(places, float).reshape(-1, 3)))


def load(path: Path) -> Scan:
    """From a folder or a zip of DICOM files."""
    path = Path(path)
    if path.is_dir():
        sources = [p for p in sorted(path.rglob('*')) if p.is_file()]
    else:
        archive = zipfile.ZipFile(path)
        sources = [io.BytesIO(archive.read(n)) for n in archive.namelist() if not n.endswith('/')]
    slices = []
    for source in sources:
        try:
            one = pydicom.dcmread(source)
        except pydicom.errors.InvalidDicomError:
            continue
        if 'PixelData' in one and 'ImagePositionPatient' in one:
            slices.append(one)
    orientation = np.array(slices[0].ImageOrientationPatient, float)
    columns, rows = orientation[:3], orientation[3:]
    normal = np.cross(columns, rows)
    slices.sort(key=lambda s: float(normal @ np.array(s.ImagePositionPatient, float)))
    hu = np.stack(
        [s.pixel_array * float(s.get('RescaleSlope', 1)) + float(s.get('RescaleIntercept', 0)) for s in slices]
    ).clip(-1024, 3071).astype(np.float32)
    origins = np.array([s.ImagePositionPatient for s in slices], float)
    spacing = tuple(float(v) for v in slices[0].PixelSpacing)
    return Scan(hu, origins, columns, rows, spacing)


@numba.njit(cache=True)
def trilinear(values, index):
    """Values at fractional indices; beyond the ends those of the nearest voxel."""
    out = np.empty(len(index), np.float32)
    nz, ny, nx = values.shape
    for n in range(len(index)):
        z = min(max(index[n, 0], 0.0), nz - 1.0)
        y = min(max(index[n, 1], 0.0), ny - 1.0)
        x = min(max(index[n, 2], 0.0), nx - 1.0)
        k, j, i = min(int(z), nz - 2), min(int(y), ny - 2), min(int(x), nx - 2)
        z, y, x = z - k, y - j, x - i
        a = values[k, j, i] * (1 - x) + values[k, j, i + 1] * x
        b = values[k, j + 1, i] * (1 - x) + values[k, j + 1, i + 1] * x
        c = values[k + 1, j, i] * (1 - x) + values[k + 1, j, i + 1] * x
        d = values[k + 1, j + 1, i] * (1 - x) + values[k + 1, j + 1, i + 1] * x
        out[n] = (a * (1 - y) + b * y) * (1 - z) + (c * (1 - y) + d * y) * z
    return out


@numba.njit(cache=True)
def rays(values, heights, origins, normal, along_rows, along_columns, spacing, places, directions, steps):
    """Values at places + step * direction, a row for each place."""
    out = np.empty((len(places), len(steps)), np.float32)
    nz, ny, nx = values.shape
    for n in range(len(places)):
        for m in range(len(steps)):
            p = places[n] + steps[m] * directions[n]
            h = (p[0] - origins[0, 0]) * normal[0] + (p[1] - origins[0, 1]) * normal[1] + (p[2] - origins[0, 2]) * normal[2]
            k = min(max(np.searchsorted(heights, h) - 1, 0), nz - 2)
            z = min(max((h - heights[k]) / (heights[k + 1] - heights[k]), 0.0), 1.0)
            y = x = 0.0
            for a in range(3):
                d = p[a] - (origins[k, a] * (1 - z) + origins[k + 1, a] * z)
                y += d * along_rows[a]
                x += d * along_columns[a]
            y = min(max(y / spacing[0], 0.0), ny - 1.0)
            x = min(max(x / spacing[1], 0.0), nx - 1.0)
            j, i = min(int(y), ny - 2), min(int(x), nx - 2)
            y, x = y - j, x - i
            a0 = values[k, j, i] * (1 - x) + values[k, j, i + 1] * x
            b0 = values[k, j + 1, i] * (1 - x) + values[k, j + 1, i + 1] * x
            c0 = values[k + 1, j, i] * (1 - x) + values[k + 1, j, i + 1] * x
            d0 = values[k + 1, j + 1, i] * (1 - x) + values[k + 1, j + 1, i + 1] * x
            out[n, m] = (a0 * (1 - y) + b0 * y) * (1 - z) + (c0 * (1 - y) + d0 * y) * z
    return out


@dataclass
class Grid:
    """Cells of 1 mm along LPS, [z, y, x]; `low` is the centre of the first."""

    low: np.ndarray
    shape: tuple[int, int, int]

    def places(self, cells):
        return np.asarray(cells, float)[:, ::-1] + self.low

    def cells(self, places):
        return (np.asarray(places, float) - self.low)[:, ::-1]

    def at(self, values, places):
        """Trilinear."""
        return trilinear(values.astype(np.float32, copy=False), np.ascontiguousarray(self.cells(places)))

    def resampled(self, scan: Scan):
        """The scan at the centres; air beyond it."""
        out = np.empty(self.shape, np.float32)
        y, x = np.meshgrid(np.arange(self.shape[1]), np.arange(self.shape[2]), indexing='ij')
        for z in range(self.shape[0]):
            cells = np.stack([np.full(x.size, z), y.ravel(), x.ravel()], 1)
            index = scan.index(self.places(cells))
            value = trilinear(scan.hu, index)
            last = np.array(scan.hu.shape) - 1
            value[((index < -0.5) | (index > last + 0.5)).any(1)] = -1024
            out[z] = value.reshape(x.shape)
        return out


def around(scan: Scan, places, margin=24.0) -> Grid:
    """The grid around places, within the scan."""
    corner = np.array([[k, j, i] for k in (0, 1) for j in (0, 1) for i in (0, 1)]) * (np.array(scan.hu.shape) - 1)
    corners = scan.lps(corner)
    low = np.maximum(np.floor(places.min(0) - margin), np.ceil(corners.min(0)))
    high = np.minimum(np.ceil(places.max(0) + margin), np.floor(corners.max(0)))
    size = (high - low).astype(int) + 1
    return Grid(low, (size[2], size[1], size[0]))
