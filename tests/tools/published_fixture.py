#!/usr/bin/env python3
"""Makes tests/it/fixtures/published/ from the series on which the published program was run and from
its results:

    published_fixture.py DATA tests/it/fixtures/published    # needs numpy and pydicom

The published algorithm sees nothing of a volume but its mask (-200 to 220 HU), so that the mask is
enough to decide on every slice again. NAME.mask.gz: gzip of the mask's bits (numpy.packbits), each
row XOR the row before it, slices from the feet up, rows and columns as in the DICOM images.
NAME.slices.jsonl.gz: the program's lines as they are, and of each accepted slice `contour`, the first
16 hex digits of the SHA-256 of its contour's pixels (little-endian int16 row, int16 column; sorted).
"""
import gzip
import hashlib
import io
import json
import pathlib
import struct
import sys
import zipfile

import numpy as np
import pydicom

SERIES = ["phantom_4", "ge_hispeed_tilt_variable", "philips_phantom_tilt_p16"]
PLANES = ["axial", "sagittal", "coronal"]


def mask(path):
    slices = []
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            if name.endswith("/") or name.endswith("DIRFILE"):
                continue
            data = pydicom.dcmread(io.BytesIO(archive.read(name)))
            slices.append(data)
    along = np.cross(*np.array(slices[0].ImageOrientationPatient, float).reshape(2, 3))
    slices.sort(key=lambda data: along @ np.array(data.ImagePositionPatient, float))
    hu = [data.pixel_array * float(data.RescaleSlope) + float(data.RescaleIntercept) for data in slices]
    return np.array([(-200 <= image) & (image <= 220) for image in hu])


def contours(path):
    """SHA-256 of each contour, by plane and index."""
    content, at, found = path.read_bytes(), 0, {}
    while at < len(content):
        plane, index, count = struct.unpack_from("<3i", content, at)
        pixels = np.frombuffer(content, "<i2", 2 * count, at + 12).reshape(-1, 2)[:, ::-1]
        pixels = pixels[np.lexsort((pixels[:, 1], pixels[:, 0]))]
        found[PLANES[plane], index] = hashlib.sha256(pixels.astype("<i2").tobytes()).hexdigest()[:16]
        at += 12 + 4 * count
    return found


def main(data, output):
    output.mkdir(parents=True, exist_ok=True)
    for name in SERIES:
        bits = mask(data / "series" / f"{name}.zip")
        print(name, bits.shape)
        rows = bits.copy()
        rows[:, 1:] ^= bits[:, :-1]
        packed = gzip.compress(np.packbits(rows).tobytes(), 9, mtime=0)
        (output / f"{name}.mask.gz").write_bytes(packed)
        published = data / "published_program" / name
        of = contours(published / "contours.bin")
        lines = []
        for line in (published / "slices.jsonl").read_text().splitlines():
            row = json.loads(line)
            row["contour"] = of.get((row["plane"], row["index"]))
            lines.append(json.dumps(row) + "\n")
        text = gzip.compress("".join(lines).encode(), 9, mtime=0)
        (output / f"{name}.slices.jsonl.gz").write_bytes(text)


main(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
