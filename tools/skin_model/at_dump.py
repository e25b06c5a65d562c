"""python at_dump.py DUMP SERIES TRUTH_DIR NAME OUT.npz: the features at the borders of a dump (see rules.py), one a rule
and mm cube."""
import sys
from pathlib import Path

import numpy as np

import features
import scan
import truth


def main():
    dump, series, folder, name, out = sys.argv[1:6]
    rows = np.fromfile(dump, np.float32).reshape(-1, 12)
    volume = scan.load(series)
    known = truth.load(Path(folder), name)
    grid = scan.around(volume, known.places)
    cells = grid.cells(rows[:, :3])
    rows = rows[((cells > 1) & (cells < np.array(grid.shape) - 2)).all(1)]
    _, one = np.unique(np.c_[rows[:, 6].astype(int), np.floor(rows[:, :3]).astype(int)], axis=0, return_index=True)
    rows = rows[one]
    places = rows[:, :3].astype(float)
    shape = features.Shape(grid.resampled(volume), grid)
    values = features.measure(volume, shape, places)
    normals = features.normals(volume, places)
    label, signed, doubt = truth.labels(known, places)
    np.savez(
        out, places=places.astype(np.float32), normals=normals.astype(np.float32), values=values, label=label, signed=signed,
        doubt=doubt, kind=np.zeros(len(label), np.int8), rule=rows[:, 6].astype(np.int8), measured=rows[:, 9],
    )


if __name__ == '__main__':
    main()
