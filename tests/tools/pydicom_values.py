#!/usr/bin/env python3
"""Makes tests/it/fixtures/pydicom_values.json and tests/it/fixtures/htj2k/*.dcm.

pydicom (with pylibjpeg's and CharLS' decoders) is the judge of decoded values: for each file, the
SHA-256 of all stored values as little-endian int32, frame by frame, row by row.

    pip install numpy pydicom pylibjpeg pylibjpeg-libjpeg pylibjpeg-openjpeg pylibjpeg-rle pyjpegls imagecodecs
    python3 tests/tools/pydicom_values.py ../shared/data
"""
import hashlib
import json
import pathlib
import sys
import warnings

import imagecodecs
import numpy as np
import pydicom
from pydicom.encaps import encapsulate

warnings.simplefilter("ignore")
FIXTURES = pathlib.Path(__file__).resolve().parent.parent / "it" / "fixtures"
UNCOMPRESSED = "cornerstone3d_CTImage/CTImage.dcm_LittleEndianExplicitTransferSyntax_1.2.840.10008.1.2.1.dcm"


def digest(path):
    values = pydicom.dcmread(path, force=True).pixel_array.astype("<i4")
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()


def make_htj2k(data):
    """A crop of a CT slice in High-Throughput JPEG 2000, encoded by OpenJPH (progression RPCL)."""
    folder = FIXTURES / "htj2k"
    folder.mkdir(parents=True, exist_ok=True)
    whole = pydicom.dcmread(data / "syntax" / UNCOMPRESSED).pixel_array
    crop = np.ascontiguousarray(whole[200:264, 180:276])
    unsigned = (crop.astype("i4") + 2048).clip(0, 4095).astype("u2")
    for name, syntax, pixels, options in [
        ("lossless_signed", "1.2.840.10008.1.2.4.201", crop, {"reversible": True}),
        ("lossless_unsigned_rpcl", "1.2.840.10008.1.2.4.202", unsigned, {"reversible": True}),
        ("lossy_unsigned", "1.2.840.10008.1.2.4.203", unsigned, {"reversible": False, "level": 0.0001}),
    ]:
        source = pydicom.dcmread(data / "syntax" / UNCOMPRESSED)
        dataset = pydicom.Dataset()
        for keyword in [
            "SOPClassUID", "SOPInstanceUID", "StudyInstanceUID", "SeriesInstanceUID", "Modality", "ImageType",
            "ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "RescaleSlope", "RescaleIntercept",
            "SamplesPerPixel", "PhotometricInterpretation",
        ]:
            dataset[keyword] = source[keyword]
        dataset.Rows, dataset.Columns = pixels.shape
        dataset.BitsAllocated = dataset.BitsStored = 16
        dataset.HighBit = 15
        dataset.PixelRepresentation = int(pixels.dtype.kind == "i")
        dataset.PixelData = encapsulate([bytes(imagecodecs.htj2k_encode(pixels, **options))])
        dataset["PixelData"].VR = "OB"
        dataset.file_meta = pydicom.dataset.FileMetaDataset()
        dataset.file_meta.TransferSyntaxUID = syntax
        dataset.save_as(folder / f"{name}.dcm", enforce_file_format=True)
        decoded = pydicom.dcmread(folder / f"{name}.dcm").pixel_array.astype("i4")
        worst = int(abs(decoded - pixels.astype("i4")).max())
        print(name, "differs from the original by at most", worst)
        assert worst == 0 or name.startswith("lossy")


def main():
    data = pathlib.Path(sys.argv[1])
    make_htj2k(data)
    values = {"syntax": {}, "htj2k": {}}
    for path in sorted((data / "syntax").glob("*/*.dcm")):
        try:
            values["syntax"][f"{path.parent.name}/{path.name}"] = digest(path)
        except (NotImplementedError, AttributeError):
            pass  # retired transfer syntaxes; no pixels
    for path in sorted((FIXTURES / "htj2k").glob("*.dcm")):
        values["htj2k"][path.name] = digest(path)
    (FIXTURES / "pydicom_values.json").write_text(json.dumps(values, indent=1) + "\n")


main()
