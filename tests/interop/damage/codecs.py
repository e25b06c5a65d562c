"""A slice in each transfer syntax: how its HU are stored, and the bytes of its pixels."""
import io
import subprocess
import tempfile
import zlib
from pathlib import Path

import numpy as np
import pydicom
from pydicom.uid import (
    DeflatedExplicitVRLittleEndian, ExplicitVRLittleEndian, HTJ2KLossless, JPEG2000, JPEG2000Lossless, JPEGLossless,
    JPEGLosslessSV1, JPEGLSLossless, RLELossless,
)

from . import ljpeg


def stored(hu, signed):
    """Samples and (bits stored, intercept)."""
    if signed:
        return hu.astype('<i2'), 16, 0
    return np.clip(hu + 1024, 0, 4095).astype('<u2'), 12, -1024


def native(samples, bits):
    return samples.tobytes()


def rle(samples, bits):
    from rle.utils import encode_pixel_data
    rows, columns = samples.shape
    return bytes(encode_pixel_data(samples.tobytes(), byteorder='<', rows=rows, columns=columns, samples_per_pixel=1, bits_allocated=16))


def lossless(selections):
    def encode(samples, bits):
        selection = selections[int(samples.astype(np.int64).sum()) % len(selections)]
        return ljpeg.encode(samples.astype(np.int64) & ((1 << bits) - 1), bits, selection)
    return encode


def jpeg2000(ratios):
    def encode(samples, bits):
        from openjpeg.utils import encode_array
        options = {'compression_ratios': ratios} if ratios else {}
        return bytes(encode_array(samples, bits_stored=bits, photometric_interpretation=2, use_mct=False, **options))
    return encode


def htj2k(samples, bits):
    """By OpenJPH, which takes a PGM file: unsigned samples only."""
    with tempfile.TemporaryDirectory() as folder:
        head = f'P5 {samples.shape[1]} {samples.shape[0]} {(1 << bits) - 1}\n'.encode()
        Path(folder, 'a.pgm').write_bytes(head + samples.astype('>u2').tobytes())
        command = ['ojph_compress', '-i', f'{folder}/a.pgm', '-o', f'{folder}/a.j2c', '-reversible', 'true']
        subprocess.run(command, check=True, capture_output=True)
        return Path(folder, 'a.j2c').read_bytes()


def jpegls(samples, bits):
    """By DCMTK."""
    from pydicom.encaps import generate_fragments
    with tempfile.TemporaryDirectory() as folder:
        data_set = pydicom.Dataset()
        data_set.file_meta = pydicom.dataset.FileMetaDataset()
        data_set.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        data_set.SOPClassUID, data_set.SOPInstanceUID = '1.2.840.10008.5.1.4.1.1.2', '2.25.1'
        describe(data_set, samples, bits)
        data_set.PixelData = samples.tobytes()
        data_set['PixelData'].VR = 'OW'
        data_set.save_as(f'{folder}/a', enforce_file_format=True)
        subprocess.run(['dcmcjpls', f'{folder}/a', f'{folder}/b'], check=True, capture_output=True)
        return b''.join(list(generate_fragments(pydicom.dcmread(f'{folder}/b').PixelData))[1:])


# Whose voxels are not those that went in.
LOSSY = ('JPEG 2000 .91',)

# Name, transfer syntax, encoder, whether the pixels come in fragments.
ALL = [
    ('native', ExplicitVRLittleEndian, native, False),
    ('deflated', DeflatedExplicitVRLittleEndian, native, False),
    ('RLE', RLELossless, rle, True),
    ('JPEG Lossless .70', JPEGLosslessSV1, lossless([1]), True),
    ('JPEG Lossless .57', JPEGLossless, lossless([2, 3, 4, 5, 6, 7]), True),
    ('JPEG 2000 .90', JPEG2000Lossless, jpeg2000(None), True),
    ('JPEG 2000 .91', JPEG2000, jpeg2000([8]), True),
    ('HTJ2K .201', HTJ2KLossless, htj2k, True),
    ('JPEG-LS .80', JPEGLSLossless, jpegls, True),
]


def describe(data_set, samples, bits):
    data_set.Rows, data_set.Columns = samples.shape
    data_set.BitsAllocated, data_set.BitsStored, data_set.HighBit = 16, bits, bits - 1
    data_set.PixelRepresentation = int(samples.dtype.kind == 'i')
    data_set.SamplesPerPixel, data_set.PhotometricInterpretation = 1, 'MONOCHROME2'


def part10(header, samples, bits, intercept, syntax, pixels, in_fragments, harm_file=None):
    """A file whose pixels are `pixels`: bytes, or a list of fragments. `harm_file` changes a deflated
    data set's bytes."""
    data_set = pydicom.Dataset()
    for element in header:
        if element.tag.group != 0x7FE0:
            data_set[element.tag] = element
    data_set.file_meta = pydicom.dataset.FileMetaDataset()
    data_set.file_meta.TransferSyntaxUID = syntax
    describe(data_set, samples, bits)
    data_set.RescaleSlope, data_set.RescaleIntercept = 1, intercept
    for name in ('PixelPaddingValue', 'SmallestImagePixelValue', 'LargestImagePixelValue'):
        if name in data_set:
            del data_set[name]
    if in_fragments:
        item = lambda data: b'\xfe\xff\x00\xe0' + len(data).to_bytes(4, 'little') + data
        even = lambda data: data + b'\0' * (len(data) % 2)
        data_set.PixelData = item(b'') + b''.join(item(even(fragment)) for fragment in pixels)
        data_set['PixelData'].VR = 'OB'
        data_set['PixelData'].is_undefined_length = True
    else:
        data_set.PixelData = pixels
        data_set['PixelData'].VR = 'OW'
    file = io.BytesIO()
    if harm_file is None:
        data_set.save_as(file, enforce_file_format=True)
        return file.getvalue()
    data_set.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data_set.save_as(file, enforce_file_format=True)
    plain = file.getvalue()
    body = pydicom.dcmread(io.BytesIO(plain)).file_meta.FileMetaInformationGroupLength + 132 + 12
    deflate = zlib.compressobj(6, zlib.DEFLATED, -15)
    deflated = deflate.compress(plain[body:]) + deflate.flush()
    data_set.file_meta.TransferSyntaxUID = DeflatedExplicitVRLittleEndian
    meta = io.BytesIO()
    data_set.save_as(meta, enforce_file_format=True)
    head = meta.getvalue()
    start = pydicom.dcmread(io.BytesIO(head), stop_before_pixels=True).file_meta.FileMetaInformationGroupLength
    deflated = harm_file(deflated)
    return head[:start + 132 + 12] + deflated + b'\0' * (len(deflated) % 2)
