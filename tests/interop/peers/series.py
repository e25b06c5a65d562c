"""Copies of the phantom, each a series of its own, in the transfer syntax that a check wants."""
import hashlib
import shutil
import subprocess
from pathlib import Path

import pydicom
from pydicom.uid import ExplicitVRLittleEndian, ImplicitVRLittleEndian, JPEG2000Lossless


def uid(*parts):
    """A UID that is the same on every run."""
    digest = hashlib.sha256('/'.join(map(str, parts)).encode()).digest()
    return f'2.25.{int.from_bytes(digest[:15], "big")}'


class Series:
    """Files of one series."""

    def __init__(self, directory: Path):
        self.directory = directory
        self.files = sorted(path for path in directory.rglob('*') if path.is_file())
        header = pydicom.dcmread(self.files[0], stop_before_pixels=True)
        self.uid = str(header.SeriesInstanceUID)
        self.study_uid = str(header.StudyInstanceUID)

    def datasets(self):
        return [pydicom.dcmread(path) for path in self.files]


class Phantom:
    """The synthetic head that `triplanar phantom` writes."""

    def __init__(self, triplanar: Path, work: Path):
        self.triplanar = triplanar
        self.work = work
        self.original = work / 'phantom'
        subprocess.run([triplanar, 'phantom', self.original], check=True, stdout=subprocess.DEVNULL)
        self.files = sorted(path for path in self.original.rglob('*') if is_dicom(path))

    def patient_identity(self):
        header = pydicom.dcmread(self.files[0], stop_before_pixels=True)
        return [str(header.get(name, '')) for name in ('PatientName', 'PatientID')]

    def series(self, name, syntax=None) -> Series:
        """A copy with new study, series and instance UIDs; `syntax` is a pydicom UID or None."""
        directory = self.work / 'series' / name
        directory.mkdir(parents=True)
        for index, path in enumerate(self.files):
            dataset = pydicom.dcmread(path)
            dataset.StudyInstanceUID = uid(name, 'study')
            dataset.SeriesInstanceUID = uid(name, 'series')
            dataset.SOPInstanceUID = uid(name, 'instance', index)
            dataset.file_meta.MediaStorageSOPInstanceUID = dataset.SOPInstanceUID
            target = directory / f'{index:04}.dcm'
            if syntax == JPEG2000Lossless:
                dataset.compress(JPEG2000Lossless, encoding_plugin='pylibjpeg')
                dataset.save_as(target)
            elif syntax in (ImplicitVRLittleEndian, ExplicitVRLittleEndian):
                dataset.file_meta.TransferSyntaxUID = syntax
                dataset.save_as(target, implicit_vr=syntax == ImplicitVRLittleEndian, little_endian=True)
            else:
                dataset.save_as(target)
        return Series(directory)

    def converted(self, name, *command) -> Series:
        """A copy that a converter of DCMTK rewrites: `command` IN OUT."""
        series = self.series(f'{name}-source')
        directory = self.work / 'series' / name
        directory.mkdir(parents=True)
        for path in series.files:
            subprocess.run([*command, path, directory / path.name], check=True)
        shutil.rmtree(series.directory)
        return Series(directory)


def is_dicom(path: Path):
    if not path.is_file():
        return False
    with path.open('rb') as file:
        return file.read(132)[128:] == b'DICM'
