#!/usr/bin/env python3
"""JPEG Lossless: random images, by an encoder written from ISO/IEC 10918-1 annexes B, C and H, must
decode to the encoder's own samples, (a >> Pt) << Pt; pylibjpeg or GDCM must confirm the encoder for
at least 90 % of every stratum.

    jpeg_lossless.py STORED_VALUES [COUNT]

GDCM reads 8 bits and more: a stream of fewer is given to it as one of 8 bits whose point transform
is as much larger, which is the same entropy-coded data. pylibjpeg is asked for what the data set says;
it does not read point transforms.

STORED_VALUES is the built example of that name. Needs numpy, pydicom, pylibjpeg, pylibjpeg-libjpeg,
python-gdcm. The last line is "N passed, N failed".
"""
import collections
import hashlib
import heapq
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import warnings

import gdcm
import numpy as np
import pydicom
from pydicom.dataset import Dataset, FileMetaDataset

warnings.simplefilter("ignore")
SELECTION_1, ANY_SELECTION = "1.2.840.10008.1.2.4.70", "1.2.840.10008.1.2.4.57"
CONFIRMED = 0.9


def differences(samples, selection, precision, point_transform, restart_rows):
    """Row by row, each from its prediction (H.1.2.1); -32767 to 32768."""
    rows, columns = len(samples), len(samples[0])
    for y in range(rows):
        first = y == 0 or (restart_rows and y % restart_rows == 0)
        for x in range(columns):
            if first:
                prediction = samples[y][x - 1] if x else 1 << (precision - point_transform - 1)
            elif x == 0:
                prediction = samples[y - 1][0]
            else:
                a, b, c = samples[y][x - 1], samples[y - 1][x], samples[y - 1][x - 1]
                prediction = (None, a, b, c, a + b - c, a + ((b - c) >> 1), b + ((a - c) >> 1), (a + b) >> 1)[selection]
            difference = (samples[y][x] - prediction) % 65536
            yield difference - 65536 if difference > 32768 else difference


def code_table(categories):
    """Huffman codes of at most 16 bits for those categories (K.2, C.2): {category: (code, length)}."""
    counts = collections.Counter(categories)
    # A symbol that never occurs takes the code of ones alone.
    heap = [(count, symbol, (symbol,)) for symbol, count in counts.items()] + [(0, 99, (99,))]
    heapq.heapify(heap)
    lengths, tie = collections.Counter(), 100
    while len(heap) > 1:
        (m, _, a), (n, _, b) = heapq.heappop(heap), heapq.heappop(heap)
        lengths.update(a + b)
        heapq.heappush(heap, (m + n, tie, a + b))
        tie += 1
    # The symbol that never occurs has the longest code, and the last of them.
    lengths.pop(99)
    assert max(lengths.values()) <= 16
    table, code, previous = {}, 0, 0
    for symbol in sorted(lengths, key=lambda symbol: (lengths[symbol], symbol)):
        code <<= lengths[symbol] - previous
        previous = lengths[symbol]
        table[symbol] = (code, previous)
        code += 1
    return table


def encode(image, selection, precision, point_transform, restart_rows):
    samples = [[int(value) >> point_transform for value in row] for row in image]
    rows, columns = image.shape
    coded = list(differences(samples, selection, precision, point_transform, restart_rows))
    table = code_table([abs(difference).bit_length() if difference != 32768 else 16 for difference in coded])
    counts = bytes(sum(length == bits for _, length in table.values()) for bits in range(1, 17))
    dht = b"\0" + counts + bytes(table)
    stream = b"\xff\xd8\xff\xc4" + struct.pack(">H", 2 + len(dht)) + dht
    stream += b"\xff\xc3" + struct.pack(">HBHHB", 11, precision, rows, columns, 1) + b"\x01\x11\0"
    if restart_rows:
        stream += b"\xff\xdd\0\x04" + struct.pack(">H", restart_rows * columns)
    stream += b"\xff\xda\0\x08\x01\x01\0" + bytes([selection, 0, point_transform])
    interval = (restart_rows or rows) * columns
    for number, start in enumerate(range(0, len(coded), interval)):
        if number:
            stream += bytes([0xFF, 0xD0 + (number - 1) % 8])
        bits = []
        for difference in coded[start : start + interval]:
            category = 16 if difference == 32768 else abs(difference).bit_length()
            code, length = table[category]
            bits.append(format(code, f"0{length}b"))
            if 0 < category < 16:
                additional = difference if difference > 0 else difference + (1 << category) - 1
                bits.append(format(additional, f"0{category}b"))
        bits = "".join(bits)
        bits += "1" * (-len(bits) % 8)
        data = int(bits, 2).to_bytes(len(bits) // 8, "big")
        stream += data.replace(b"\xff", b"\xff\0")
    return stream + b"\xff\xd9"


def random_image(rng, precision, largest):
    rows, columns = (int(n) for n in rng.integers(1, largest, 2))
    kind = rng.integers(4)
    top = (1 << precision) - 1
    if kind == 0:  # noise over all values
        image = rng.integers(0, top + 1, (rows, columns))
    elif kind == 1:  # the two ends
        image = rng.choice([0, top, (top + 1) // 2], (rows, columns))
    elif kind == 2:  # a constant
        image = np.full((rows, columns), rng.integers(0, top + 1))
    else:  # a soft slope with noise
        y, x = np.mgrid[:rows, :columns]
        image = (x * rng.normal(0, 3) + y * rng.normal(0, 3) + rng.normal(0, 2, (rows, columns)) + top / 2).clip(0, top)
    return image.astype(np.int64)


def write(path, stream, shape, precision, signed, syntax):
    dataset = Dataset()
    dataset.file_meta = FileMetaDataset()
    dataset.file_meta.TransferSyntaxUID = syntax
    dataset.SOPClassUID, dataset.SOPInstanceUID = "1.2.840.10008.5.1.4.1.1.2", pydicom.uid.generate_uid()
    dataset.StudyInstanceUID = dataset.SeriesInstanceUID = "1.2.3"
    dataset.Modality, dataset.SamplesPerPixel, dataset.PhotometricInterpretation = "CT", 1, "MONOCHROME2"
    dataset.Rows, dataset.Columns = shape
    dataset.BitsAllocated = 8 if precision <= 8 else 16
    dataset.BitsStored, dataset.HighBit, dataset.PixelRepresentation = precision, precision - 1, int(signed)
    dataset.PixelData = pydicom.encaps.encapsulate([stream])
    dataset["PixelData"].VR = "OB"
    dataset["PixelData"].is_undefined_length = True
    dataset.save_as(path, enforce_file_format=True)


def by_pylibjpeg(path):
    return pydicom.pixels.pixel_array(path, decoding_plugin="pylibjpeg")


def by_gdcm(path):
    reader = gdcm.ImageReader()
    reader.SetFileName(str(path))
    if not reader.Read():
        raise ValueError("not read")
    image = reader.GetImage()
    pixels = image.GetPixelFormat()
    kind = {(8, 0): "u1", (8, 1): "i1", (16, 0): "<u2", (16, 1): "<i2"}
    buffer = image.GetBuffer().encode("utf-8", "surrogateescape")
    return np.frombuffer(buffer, kind[pixels.GetBitsAllocated(), pixels.GetPixelRepresentation()])


def of_8_bits(stream, precision, point_transform):
    """The same differences and predictions, of samples that are shifted to 8 bits."""
    frame, scan = stream.index(b"\xff\xc3\0\x0b"), stream.index(b"\xff\xda\0\x08")
    shifted = bytearray(stream)
    shifted[frame + 4] = 8
    shifted[scan + 9] = point_transform + 8 - precision
    return bytes(shifted)


def confirms(decoder, path, values):
    """In a process of its own, which some decoders abort."""
    child = os.fork()
    if child == 0:
        os.close(2)
        try:
            os._exit(not np.array_equal(decoder(path).astype("<i4").ravel(), values.ravel()))
        finally:
            os._exit(2)
    return os.waitpid(child, 0)[1] == 0


def main():
    example, count = pathlib.Path(sys.argv[1]).resolve(), int(sys.argv[2]) if len(sys.argv) > 2 else 2000
    rng = np.random.default_rng(18)
    passed = failed = 0
    # Stratum: [images, confirmed by pylibjpeg, by GDCM, by either].
    strata = collections.defaultdict(lambda: [0, 0, 0, 0])
    with tempfile.TemporaryDirectory() as folder:
        folder, images = pathlib.Path(folder), {}
        for number in range(count):
            precision, selection = 2 + number % 15, 1 + int(rng.integers(7))
            point_transform = int(rng.choice([0, 0, 1, 2, precision - 1, rng.integers(precision)])) % precision
            image = random_image(rng, precision, 96 if number % 20 == 0 else 32)
            rows, columns = image.shape
            restart_rows = int(rng.choice([0, 0, 1, 2, rng.integers(1, rows + 1)]))
            signed = bool(rng.integers(2))
            syntax = SELECTION_1 if selection == 1 else ANY_SELECTION
            values = image >> point_transform << point_transform
            if signed:
                values = np.where(values >> (precision - 1), values - (1 << precision), values)
            path = folder / f"{number:05}.dcm"
            stream = encode(image, selection, precision, point_transform, restart_rows)
            write(path, stream, image.shape, precision, signed, syntax)
            by = [confirms(by_pylibjpeg, path, values)]
            if precision >= 8:
                by.append(confirms(by_gdcm, path, values))
            else:
                other = folder / "of_8_bits"
                shifted = of_8_bits(stream, precision, point_transform)
                write(other, shifted, image.shape, 8, False, ANY_SELECTION)
                by.append(confirms(by_gdcm, other, image >> point_transform << point_transform + 8 - precision))
                other.unlink()
            kinds = (
                f"precision {precision}",
                f"selection {selection}",
                f"point transform {point_transform if point_transform < 3 else '3 and more'}",
                f"restart rows {restart_rows if restart_rows < 3 else '3 and more'}",
                f"{'signed' if signed else 'unsigned'}",
                f"size {'1 to 31' if max(rows, columns) < 32 else '32 to 95'}",
            )
            for kind in kinds:
                strata[kind] = [a + b for a, b in zip(strata[kind], (1, *by, any(by)))]
            images[path.name] = (kinds, hashlib.sha256(values.astype("<i4").tobytes()).hexdigest())
        output = subprocess.run([example, folder], check=True, capture_output=True, text=True).stdout
        ours = dict(line.split(" ", 1) for line in output.splitlines())
        for name, (kinds, expected) in images.items():
            if ours.get(name) == expected:
                passed += 1
            else:
                failed += 1
                print(f"FAILED: {name} ({', '.join(kinds)}): {ours.get(name)}")
    print(f"{'stratum':26} images  pylibjpeg  GDCM  confirmed")
    for kind in sorted(strata, key=lambda kind: (kind.split()[0], len(kind), kind)):
        total, *by, either = strata[kind]
        is_confirmed = either >= CONFIRMED * total
        passed, failed = passed + is_confirmed, failed + (not is_confirmed)
        print(f"{kind:26} {total:6} {by[0]:10} {by[1]:5}  {100 * either / total:6.1f} %{'' if is_confirmed else '  FAILED'}")
    print(f"{passed} passed, {failed} failed")
    sys.exit(failed > 0)


main()
