"""Where the voxels of a series lie, LPS mm."""
from pathlib import Path

import numpy as np
import pydicom


class Places:
    """Of the slices in a folder, in the order of their places."""

    def __init__(self, folder: Path):
        slices = [pydicom.dcmread(path, stop_before_pixels=True) for path in sorted(folder.rglob('*.dcm'))]
        orientation = np.array(slices[0].ImageOrientationPatient, float)
        self.row, self.column = orientation[:3], orientation[3:]
        normal = np.cross(self.row, self.column)
        first = np.array([s.ImagePositionPatient for s in slices], float)
        self.first = first[np.argsort(first @ normal)]
        # Spacing between rows, then between columns (PS3.3 10.7.1.1).
        self.row_mm, self.column_mm = (float(mm) for mm in slices[0].PixelSpacing)
        self.rows, self.columns = slices[0].Rows, slices[0].Columns

    def of(self, slice_, row, column):
        along = np.asarray(column)[..., None] * self.column_mm * self.row
        return self.first[slice_] + along + np.asarray(row)[..., None] * self.row_mm * self.column

    def middle(self):
        """Of the first image."""
        return self.of(0, (self.rows - 1) / 2, (self.columns - 1) / 2)

    def of_mask(self, path: Path):
        """Of the voxels of a mask of variants.py."""
        stored = np.load(path)
        shape = tuple(stored['shape'])
        inside = np.unpackbits(stored['mask'])[: int(np.prod(shape))].reshape(shape)
        return self.of(*np.nonzero(inside))
