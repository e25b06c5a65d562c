"""Runs the program, reads its clouds."""
import json
import subprocess

import numpy as np
from scipy.spatial import cKDTree

TYPES = {'float': '<f4', 'double': '<f8', 'uchar': 'u1', 'ushort': '<u2', 'int': '<i4', 'uint': '<u4'}


def points(path):
    data = path.read_bytes()
    end = data.index(b'end_header\n') + len(b'end_header\n')
    header = [line.split() for line in data[:end].decode().splitlines()]
    count = next(int(words[2]) for words in header if words[:2] == ['element', 'vertex'])
    fields = np.dtype([(words[2], TYPES[words[1]]) for words in header if words[0] == 'property'])
    cloud = np.frombuffer(data, fields, count, end)
    return np.stack([cloud[axis] for axis in 'xyz'], 1).astype(float)


# What tells of damage: everything else may be told of an unharmed series just as well.
OF_DAMAGE = {'inconsistent_levels', 'trailing_zeros', 'unused_bits'}


class Run:
    """What the program made of a folder."""

    def __init__(self, triplanar, folder, work, *arguments):
        cloud, report = work / 'cloud.ply', work / 'report.json'
        for file in (cloud, report):
            file.unlink(missing_ok=True)
        command = [triplanar, 'reconstruct', folder, '-o', cloud, '--report', report, *arguments]
        done = subprocess.run(command, capture_output=True, text=True)
        self.code = done.returncode
        self.output = done.stdout + done.stderr
        self.points = points(cloud) if done.returncode == 0 else None
        found = json.loads(report.read_text()) if report.exists() else {}
        told = {warning['code'] for warning in found.get('warnings', [])}
        self.doubts = OF_DAMAGE & (told | set((found.get('quality') or {}).get('doubts', [])))
        self.rows = [row for warning in found.get('warnings', []) for row in warning.get('rows', [])]


# Exit codes: a cloud, or the series was read and shows no skin.
READ = (0, 5)


def read(triplanar, folder, work):
    """Reads a folder as every profile does, by the one that is done soonest."""
    return Run(triplanar, folder, work, '--profile', 'paper', '--min-neighbours', '0')


def farthest(a, b):
    """The distance from b of the point of a that is farthest from it, mm."""
    return float(cKDTree(b).query(a)[0].max()) if len(a) else 0.0
