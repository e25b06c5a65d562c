"""The known skin of a head (see score_real.py)."""
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree


@dataclass
class Truth:
    places: np.ndarray
    normals: np.ndarray
    uncertain: np.ndarray
    sides: list
    # Points on devices that lie on this very head.
    devices: np.ndarray | None

    def scored(self, places):
        ok = np.ones(len(places), bool)
        for side in self.sides:
            ok &= (places - np.array(side['point'])) @ np.array(side['normal']) > 0
        return ok

    def signed(self, places):
        """Signed distance, positive outside, and distance to the nearest vertex, mm."""
        distance, nearest = cKDTree(self.places).query(places)
        height = ((places - self.places[nearest]) * self.normals[nearest]).sum(1)
        signed = np.where(distance < 1.5, height, np.sign(height) * np.maximum(np.abs(height), 0.9 * distance))
        return signed, distance

    def certain(self):
        return self.places[~self.uncertain & self.scored(self.places)]


def load(folder: Path, name: str) -> Truth:
    stored = np.load(folder / f'{name}.npz')
    meta = json.loads(str(stored['meta']))
    cords = folder / f'{name}_cords.npy'
    return Truth(
        stored['verts'].astype(float), stored['normals'].astype(float), stored['uncertain'].astype(bool),
        meta['scored_side'], np.load(cords).astype(float) if cords.exists() else None,
    )


def labels(truth: Truth, places, device=None):
    """1 skin, 0 not, -1 nobody knows; signed distance; whether within 3 mm of uncertain truth. `device` tells the
    distance (mm) of each place to a device that was put there (positive outside of it)."""
    signed, distance = truth.signed(places)
    scored = truth.scored(places)
    doubt = cKDTree(truth.places[truth.uncertain]).query(places, distance_upper_bound=3.0)[0] <= 3.0
    known = scored & ~doubt
    label = np.full(len(places), -1, np.int8)
    label[known & (distance < 1.0)] = 1
    label[known & (distance > 2.0)] = 0
    if truth.devices is not None:
        on = cKDTree(truth.devices).query(places, distance_upper_bound=1.0)[0] <= 1.0
        label[on & scored] = 0
    if device is not None:
        # On a device, and farther from the skin than the edge is blurred.
        label[scored & (device < 0.7) & (signed > 1.2)] = 0
        label[scored & (device < 0.7) & (signed > 0.5) & (signed <= 1.2)] = -1
    return label, signed.astype(np.float32), doubt
