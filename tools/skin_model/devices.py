"""Devices put onto a head: their edge is blurred as the scan's, their noise is that of the air they replace.

Each is a signed distance (mm, negative inside) over places and over how far these lie from the head closed by a ball
(what is stretched over a head does not follow its folds). Sizes: EEG cup electrodes are 10 mm across and 2 to 3 mm high,
ECG leads and fiducial cords 2.5 to 5 mm, adhesive markers for navigation 15 mm with a hole, thermoplastic masks 2 to
3.2 mm (perforated 1.6 mm and more) with holes of 2 to 5 mm, straps 8 to 25 mm, oxygen tubing 4 to 7 mm.
"""
import numpy as np
from scipy import ndimage
from scipy.special import ndtr
from scipy.spatial import cKDTree

from features import distance
from scan import Grid, Scan, trilinear
from truth import Truth

KINDS = ['closed_mask', 'perforated_mask', 'pad', 'strap', 'cushion', 'board', 'cord', 'marker']
CLOSED_BY = (4, 10, 20)
# Farther from the skin the distance need not be exact, mm.
BAND_MM = 4.0


class Site:
    """A head with room for devices."""

    def __init__(self, scan: Scan, grid: Grid, truth: Truth):
        self.grid, self.truth = grid, truth
        tree = cKDTree(truth.places)

        def signed(places):
            d, i = tree.query(places)
            s = ((places - truth.places[i]) * truth.normals[i]).sum(1)
            return np.where(d < 2, s, np.sign(s) * d)

        shape = grid.shape
        occupied = np.ones(shape, bool)
        at = np.rint(grid.cells(truth.places)).astype(int)
        held = ((at >= 0) & (at < np.array(shape))).all(1)
        occupied[tuple(at[held].T)] = False
        off = distance(occupied)
        band = off < BAND_MM
        near = np.argwhere(band)
        lowest = int(np.clip(np.ceil(truth.places[:, 2].min() + 2 - grid.low[2]), 0, shape[0] - 1))
        free = ~band
        free[:lowest] = False
        pieces, _ = ndimage.label(free)
        sides = [pieces[:, 0], pieces[:, -1], pieces[:, :, 0], pieces[:, :, -1]]
        outside = np.isin(pieces, np.setdiff1d(np.concatenate([s.ravel() for s in sides]), [0]))
        # Cavities are inside.
        sd = np.where(outside, off, -off).astype(np.float32)
        sd[tuple(near.T)] = signed(grid.places(near))
        # Below the lowest known skin the head goes on as it is there: else air and cavities would meet through its cut.
        sd[:lowest] = sd[lowest]
        self.sd = sd
        inside = np.pad(self.sd < 0, ((45, 45), (0, 0), (0, 0)), mode='edge')
        self.off = {}
        for r in CLOSED_BY:
            closed = distance(distance(~inside) <= r) > r
            off = distance(~closed)[45:-45] - 0.5
            # Where closing changes nothing, the exact distance.
            same = np.abs(off - self.sd) < 1.2
            self.off[r] = np.where(same, self.sd, off).astype(np.float32)
        scored = truth.certain()
        self.skin, self.middle = scored, scored.mean(0)
        on = truth.scored(truth.places)
        self.spots, self.spot_normals = truth.places[on], truth.normals[on]
        self.room = (self.sd > -3) & (self.sd < 50)
        self.room_places = grid.places(np.argwhere(self.room))
        # Edge spread of the scan.
        some = np.random.default_rng(0).choice(np.nonzero(on & ~truth.uncertain)[0], 3000)
        t = np.arange(-4, 4.01, 0.25)
        profile = np.stack([scan.sample(truth.places[some] + v * truth.normals[some]) for v in t], 1).astype(float)
        step = profile[:, :6].mean(1) - profile[:, -6:].mean(1)
        slope = (-np.diff(profile, axis=1) / 0.25).max(1)
        ok = step > 600
        self.sigma = float(np.median(step[ok] / slope[ok]) / np.sqrt(2 * np.pi)) * 0.85
        # Native voxels around.
        index = scan.index(grid.places(np.array([[k, j, i] for k in (0, 1) for j in (0, 1) for i in (0, 1)]) * (np.array(shape) - 1)))
        self.first = np.maximum(np.floor(index.min(0)).astype(int), 0)
        self.last = np.minimum(np.ceil(index.max(0)).astype(int) + 1, scan.hu.shape)

    def clear(self, scan: Scan, rng):
        """Begins anew."""
        self.rng, self.hu = rng, scan.hu.copy()
        self.scan = Scan(self.hu, scan.origins, scan.along_columns, scan.along_rows, scan.spacing)
        self.device = np.full(self.grid.shape, 9, np.float32)
        self.kind = np.zeros(self.grid.shape, np.int8)

    def spot(self):
        i = self.rng.integers(len(self.spots))
        return self.spots[i], self.spot_normals[i]

    def cleaned(self):
        """Without what lies on the head beyond 0.9 mm."""
        for part, index in self._voxels(np.ones(self.grid.shape, bool)):
            places = self.scan.lps(index)
            cells = np.ascontiguousarray(self.grid.cells(places))
            inside = ((cells >= 0) & (cells <= np.array(self.grid.shape) - 1)).all(1)
            sd = trilinear(self.sd, cells)
            take = inside & (sd > 0.9) & (sd < 80) & self.truth.scored(places)
            air = -1000 + np.where(sd < 1.6, 100, 0) + self.rng.normal(0, 12, len(sd))
            flat = self.hu[part].reshape(-1)
            flat[take] = np.minimum(flat[take], air[take])
            self.hu[part] = flat.reshape(self.hu[part].shape)

    def _voxels(self, cells):
        """Slabs of the native voxels around marked cells, with their indices."""
        at = np.argwhere(cells)
        if not len(at):
            return
        low, high = at.min(0) - 2, at.max(0) + 2
        corner = np.array([[k, j, i] for k in (0, 1) for j in (0, 1) for i in (0, 1)])
        index = self.scan.index(self.grid.places(low + corner * (high - low)))
        low = np.maximum(np.floor(index.min(0)).astype(int), self.first)
        high = np.minimum(np.ceil(index.max(0)).astype(int) + 1, self.last)
        for k in range(low[0], high[0]):
            j, i = np.meshgrid(np.arange(low[1], high[1]), np.arange(low[2], high[2]), indexing='ij')
            yield (
                (slice(k, k + 1), slice(low[1], high[1]), slice(low[2], high[2])),
                np.stack([np.full(j.size, k), j.ravel(), i.ravel()], 1).astype(float),
            )

    def put(self, body, hu, kind, by):
        """`body(places, off)`: its signed distance; `off` that from the head closed by a ball of `by` mm."""
        off = self.off[by]
        here = np.full(self.grid.shape, 9, np.float32)
        # What lies in the head is no device.
        here[self.room] = np.maximum(body(self.room_places, off[self.room]), -self.sd[self.room])
        self.kind[here < np.minimum(self.device, 1.0)] = 1 + KINDS.index(kind)
        self.device = np.minimum(self.device, here)
        for part, index in self._voxels(here < 2):
            places = self.scan.lps(index)
            cells = np.ascontiguousarray(self.grid.cells(places))
            sd = body(places, trilinear(off, cells))
            share = ndtr(-sd / self.sigma)
            # It goes no deeper than it touches.
            share *= ndtr((trilinear(self.sd, cells) + 1.5) / 0.5)
            held = share > 0.005
            flat = self.hu[part].reshape(-1)
            old = flat[held]
            air = np.clip((40 - old) / 1040, 0, 1)
            flat[held] = old + share[held] * air * (hu + 1000)
            self.hu[part] = flat.reshape(self.hu[part].shape)

    def smooth_noise(self, scale, sd):
        size = [int(n / scale) + 3 for n in self.grid.shape]
        field = ndimage.zoom(self.rng.standard_normal(size), scale, order=1)[tuple(slice(0, n) for n in self.grid.shape)]
        return (field * sd / field.std()).astype(np.float32)


def slab(off, low, high):
    return np.maximum(low - off, off - high)


def closed_by(rng):
    return int(rng.choice([4, 10]))


def cord(s: Site, dia=None):
    r = s.rng
    dia = dia or r.choice([r.uniform(2.5, 5), r.uniform(2.5, 4), r.uniform(4, 7)])
    c, _ = s.spot()
    u = r.standard_normal(3)
    u /= np.linalg.norm(u)
    length, gap = r.uniform(60, 200), r.uniform(0, 0.4)

    def body(p, off):
        d = p - c
        return np.maximum(np.hypot(off - dia / 2 - gap, d @ u) - dia / 2, np.linalg.norm(d, axis=1) - length)

    s.put(body, r.uniform(-50, 250), 'cord', 4)


def disc(s: Site, kind, radius, thick, hu, by, hole=0.0, gap=0.0):
    r = s.rng
    c, n = s.spot()
    u = np.cross(n, r.standard_normal(3))
    u /= np.linalg.norm(u)
    v = np.cross(n, u)
    square = kind == 'pad' and r.random() < 0.6
    aspect = r.uniform(0.6, 1.6)

    def body(p, off):
        d = p - c
        up, a, b = d @ n, d @ u, d @ v
        rad = np.maximum(np.abs(a), np.abs(b) * aspect) if square else np.hypot(a, b)
        sd = np.maximum(np.maximum(rad - radius, slab(off, gap - 1.0 * (gap == 0), thick + gap)), np.abs(up) - max(radius, 12))
        return np.maximum(sd, hole - rad) if hole else sd

    s.put(body, hu, kind, by)


def pad(s: Site):
    r = s.rng
    gap = r.uniform(0.2, 0.8) * (r.random() < 0.4)
    disc(s, 'pad', r.uniform(5, 40), r.uniform(2.5, 10), r.uniform(-350, 250), closed_by(r), gap=gap)


def marker(s: Site):
    r = s.rng
    disc(s, 'marker', r.uniform(4, 8), r.uniform(2, 4), r.uniform(0, 1200), 4, hole=r.choice([0, 1.5, 2.5]))


def strap(s: Site):
    r = s.rng
    c, _ = s.spot()
    u = r.standard_normal(3)
    u /= np.linalg.norm(u)
    width, thick, length = r.uniform(8, 25), r.uniform(1.7, 3), r.uniform(70, 250)

    def body(p, off):
        d = p - c
        return np.maximum(np.maximum(slab(off, -1, thick), np.abs(d @ u) - width / 2), np.linalg.norm(d, axis=1) - length)

    s.put(body, r.uniform(-100, 150), 'strap', closed_by(r))


def mask(s: Site, perforated):
    r = s.rng
    thick = r.uniform(1.6, 3.2)
    by = int(r.choice([10, 20]))
    gap = np.maximum(s.smooth_noise(24, 1.3) + r.uniform(-0.3, 1.2), 0)
    back = s.middle[1] + r.uniform(-25, 15)
    lowest = s.skin[:, 2].min() + r.uniform(-5, 40)
    pitch, hole = r.uniform(6, 9), r.uniform(1.2, 2.6)

    def body(p, off):
        g = trilinear(gap, np.ascontiguousarray(s.grid.cells(p)))
        sd = np.maximum(np.maximum(slab(off - g, 0, thick), p[:, 1] - back), lowest - p[:, 2])
        if perforated:
            across = 80 * np.arctan2(p[:, 0] - s.middle[0], s.middle[1] - p[:, 1])
            row = np.floor(p[:, 2] / pitch)
            a = across / pitch + 0.5 * (row % 2)
            a = (a - np.floor(a) - 0.5) * pitch
            b = (p[:, 2] / pitch - row - 0.5) * pitch
            sd = np.maximum(sd, hole - np.hypot(a, b))
        return sd

    s.put(body, r.uniform(-100, 150), 'perforated_mask' if perforated else 'closed_mask', by)


def cushion(s: Site):
    r = s.rng
    for side in (-1, 1):
        aside, front, thick, gap = r.uniform(35, 60), s.middle[1] - r.uniform(-10, 30), r.uniform(8, 45), r.uniform(-1, 1.5)
        low, high = s.skin[:, 2].min() + r.uniform(0, 40), s.skin[:, 2].max() - r.uniform(10, 60)

        def body(p, off):
            sd = np.maximum(slab(off, gap, thick), aside - side * (p[:, 0] - s.middle[0]))
            return np.maximum(np.maximum(sd, front - p[:, 1]), np.maximum(low - p[:, 2], p[:, 2] - high))

        s.put(body, r.uniform(-420, -60), 'cushion', closed_by(r))


def board(s: Site):
    r = s.rng
    y = s.skin[:, 1].max() - r.uniform(-1, 3)
    thick, half = r.uniform(5, 20), r.uniform(60, 110)
    s.put(
        lambda p, off: np.maximum(slab(p[:, 1], y, y + thick), np.abs(p[:, 0] - s.middle[0]) - half),
        r.uniform(-300, 200), 'board', 4,
    )


MAKERS = {
    'closed_mask': lambda s: mask(s, False), 'perforated_mask': lambda s: mask(s, True), 'pad': pad, 'strap': strap,
    'cushion': cushion, 'board': board, 'cord': cord, 'marker': marker,
}
# What lies on a head at once; the first entry tells whether its own devices are taken off before.
SETS = {
    1: (False, ['cord', 'cord', 'pad', 'pad', 'strap', 'marker', 'marker']),
    2: (True, ['perforated_mask', 'cord', 'pad']),
    3: (True, ['closed_mask', 'marker', 'pad']),
    4: (True, ['cushion', 'board', 'cord', 'cord', 'pad', 'marker', 'strap']),
    5: (True, ['cord', 'cord', 'pad', 'pad', 'pad', 'strap', 'strap', 'marker', 'marker', 'marker']),
    6: (True, ['perforated_mask', 'cushion', 'marker']),
}
