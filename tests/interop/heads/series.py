"""The series whose skin is known, as folders or archives of DICOM files."""
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

TOOLS = Path(__file__).resolve().parents[2] / 'tools'
# Real ones of the shared data, by the name of their truth.
REAL = ['imagex_siemens_phantom_2mm', 'ge_hispeed_tilt_variable', 'vismale', 'vhf_head']
HUMAN = 'invesalius_dz075'
# Names of functions in variants.py, and of the folder where they differ.
VARIANTS = [
    'fov_m1000', 'fov_m1024', 'fov_m2000', 'fov_m3024_nopad', 'fovbig_m1000', 'fovbig_m1024', 'fovbig_m2000',
    'fovfit_m1000', 'fovfoam_m1000', 'fovfoam_m2000', 'square_cut', 'cord', 'cannula', 'deface_blank', 'deface_zero',
    'deface_pixel', 'deface_blur', 'noise60', 'noise100', 'noise100_ext', 'thick25', 'thick5', 'clip', 'clip2', 'metal',
    'tilt', 'm1024',
]
FOLDERS = {'clip': 'clip_m1024_pad3024', 'clip2': 'clip_m1000_pad2048', 'tilt': 'tilt20'}


@dataclass
class Series:
    name: str
    path: Path
    truth: Path
    # Voxels that were put or altered on purpose: their mask is of the series `made_of`.
    mask: Path | None = None
    made_of: Path | None = None
    # Radius of the scan circle about the middle of the image, mm.
    circle_mm: float | None = None
    # Points on devices that lie on the skin, mm.
    devices: Path | None = None


def all_of(shared: Path, cache: Path, names: list[str]):
    """One after the other, each made when it is asked for."""
    wanted = lambda name: not names or name in names
    truth = shared / 'data/truth'
    for name in filter(wanted, REAL):
        cords = truth / f'{name}_cords.npy'
        yield Series(
            name, shared / f'data/series/{name}.zip', truth / f'{name}.npz', devices=cords if cords.exists() else None
        )
    human = cache / HUMAN
    if not human.exists():
        run(TOOLS / 'to_dicom.py', cache / 'matrix.dat', human)
    if wanted(HUMAN):
        yield Series(HUMAN, human, truth / f'{HUMAN}.npz')
    for variant in filter(wanted, VARIANTS):
        folder = cache / 'variants' / FOLDERS.get(variant, variant)
        if not folder.exists():
            run(TOOLS / 'variants.py', human, folder.parent, variant)
        mask = folder.parent / f'{folder.name}.mask.npz'
        yield Series(
            variant, folder, truth / f'{HUMAN}.npz', mask if mask.exists() else None, human, circle(variant)
        )


# Pixels of to_dicom.py's series, mm.
PIXEL_MM = 0.9570312 / 2


def circle(variant: str) -> float | None:
    """As variants.py draws it."""
    if variant.startswith(('fov_', 'fovfoam')):
        return 85.0
    if variant.startswith(('fovbig', 'fovfit')):
        return (1.008 if variant.startswith('fovbig') else 0.995) * 200 * PIXEL_MM
    return None


def run(script: Path, *arguments):
    subprocess.run([sys.executable, script, *arguments], check=True, stdout=subprocess.DEVNULL)

