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


class Run:
    """What the program made of a folder."""

    def __init__(self, triplanar, folder, work, *arguments):
        cloud, report = work / 'cloud.ply', work / 'report.json'
        for file in (cloud, report):
            file.unlink(missing_ok=True)
        command = [triplanar, 'reconstruct', folder, '-o', cloud, '--report', report, *arguments]
        done = subprocess.run(command, capture_output=True, text=True)
        self.output = done.stdout + done.stderr
        self.failed = done.returncode != 0
        self.points = None if self.failed else points(cloud)
        found = json.loads(report.read_text()) if report.exists() else {}
        self.warnings = {warning['code'] for warning in found.get('warnings', [])}
        self.doubts = set((found.get('quality') or {}).get('doubts', []))
        self.rows = [row for warning in found.get('warnings', []) for row in warning.get('rows', [])]

    def told(self):
        return self.warnings | self.doubts


def farthest(a, b):
    """The distance from b of the point of a that is farthest from it, mm."""
    return float(cKDTree(b).query(a)[0].max()) if len(a) else 0.0
