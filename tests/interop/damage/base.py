"""The unharmed series that are damaged: small enough to run hundreds of times."""
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pydicom


class Base:
    """Headers in the order of their places, and their HU."""

    def __init__(self, name, headers, hu):
        self.name, self.headers, self.hu = name, headers, hu


def read(folder: Path):
    files = [pydicom.dcmread(path) for path in folder.rglob('*') if path.is_file() and path.suffix != '.json']
    row, column = np.reshape(np.array(files[0].ImageOrientationPatient, float), (2, 3))
    normal = np.cross(row, column)
    files.sort(key=lambda f: float(np.dot(normal, np.array(f.ImagePositionPatient, float))))
    hu = np.stack([f.pixel_array * float(f.RescaleSlope) + float(f.RescaleIntercept) for f in files])
    return files, np.trunc(hu).astype(np.int32)


SMALL = '--matrix 160 --pixel 1.5 --slices 75 --step 2.5 --pitch 6 --noise 10'
FULL = '--matrix 512 --pixel 0.5 --slices 40 --step 5 --pitch -4 --noise 8'


def phantom(triplanar: Path, work: Path, seed: int, matrix: str) -> Base:
    folder = work / f'phantom_{seed}'
    options = f'--seed {seed} {matrix}'
    subprocess.run([triplanar, 'phantom', folder, *options.split()], check=True, stdout=subprocess.DEVNULL)
    return Base(f'phantom {seed}', *read(folder))


def human(shared: Path, work: Path, name: str, every: int, pixels: int) -> Base:
    """One of the shared series: every so many slices, means of squares of pixels, cut to the patient."""
    folder = work / name
    with zipfile.ZipFile(shared / 'data' / 'series' / f'{name}.zip') as archive:
        archive.extractall(folder)
    files, hu = read(folder)
    files, hu = files[::every], hu[::every]
    tissue = (hu > -400).sum(0) > 2
    rows, columns = (np.nonzero(tissue.any(axis))[0] for axis in (1, 0))
    cut = []
    for seen, size in ((rows, hu.shape[1]), (columns, hu.shape[2])):
        first = max(0, seen[0] - 12)
        cut.append((first, first + (min(size, seen[-1] + 12) - first) // pixels * pixels))
    (top, bottom), (left, right) = cut
    hu = hu[:, top:bottom, left:right]
    count, height, width = hu.shape
    hu = hu.reshape(count, height // pixels, pixels, width // pixels, pixels).mean((2, 4)).round().astype(np.int32)
    for file in files:
        spacing = [float(v) for v in file.PixelSpacing]
        along, down = np.reshape(np.array(file.ImageOrientationPatient, float), (2, 3))
        offset = along * spacing[1] * (left + (pixels - 1) / 2) + down * spacing[0] * (top + (pixels - 1) / 2)
        place = np.array(file.ImagePositionPatient, float) + offset
        file.ImagePositionPatient = [f'{v:.4f}' for v in place]
        file.PixelSpacing = [f'{v * pixels:.5f}' for v in spacing]
    return Base(f'{name} / {pixels}', files, hu)


def all_of(triplanar: Path, work: Path, shared: Path):
    """Phantoms and human heads, small ones and ones with 512 columns."""
    bases = [phantom(triplanar, work, 3, SMALL)]
    if (shared / 'data' / 'series').is_dir():
        bases.append(human(shared, work, 'vhf_head', 2, 2))
        bases.append(human(shared, work, 'vismale', 2, 1))
        bases.append(phantom(triplanar, work, 5, FULL))
        bases.append(human(shared, work, 'vhf_head', 4, 1))
    else:
        print('skipped: humans: no shared data')
        bases += [phantom(triplanar, work, 8, SMALL), phantom(triplanar, work, 5, FULL)]
    return bases
