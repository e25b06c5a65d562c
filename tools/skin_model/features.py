"""What is measured at a border of tissue to air: the evidence for skin.

All lengths in mm, all values in HU; HU are clipped where the name is a level, so that metal and bone weigh alike.
LEVEL parts tissue from air. `n` is the outward unit normal: minus the gradient over +-1.5 mm.
"""
import edt as _edt
import numpy as np
from scipy import ndimage

from scan import Grid, Scan, trilinear

LEVEL = -490.0
NAMES = [
    'hu2', 'hu3', 'hu4', 'hu6', 'to490', 'to250', 'to160', 'gap', 'min3', 'min8', 'max3', 'max8', 'dip4', 'dip8', 'dip12',
    'to_bone', 'fat', 'front', 'front_thick', 'h2', 'h3', 'h5', 'H8', 'H12', 'H20', 'H40', 'deep10', 'deep20', 'depth',
    'log2', 'log4', 'log8', 'dens3', 'sym', 'sym_abs', 'sym_H12',
]


def distance(inside):
    """From each cell inside to the nearest one outside, mm; the outside does not go on beyond the sides."""
    return _edt.edt(np.ascontiguousarray(inside), parallel=1)


def distance_on(inside, more=41):
    """The same, as if the first and the last slice went on."""
    return distance(np.pad(inside, ((more, more), (0, 0), (0, 0)), mode='edge'))[more:-more]


def from_sides(air):
    """Air that hangs together with a side, the front or the back."""
    pieces, _ = ndimage.label(air)
    sides = [pieces[:, 0], pieces[:, -1], pieces[:, :, 0], pieces[:, :, -1]]
    open_ = np.unique(np.concatenate([s.ravel() for s in sides]))
    return np.isin(pieces, open_[open_ > 0])


def body_of(hu):
    """The body (opened by 5 mm, with what of the tissue lies within 25 mm), and the body with all that a ball of 3 mm
    can't enter."""
    solid = np.pad(hu > LEVEL, 1)
    core = distance(solid) > 5
    pieces, _ = ndimage.label(core)
    core = pieces == np.bincount(pieces.ravel())[1:].argmax() + 1
    opened = distance(~core) <= 5
    pieces, _ = ndimage.label(solid & (distance(~opened) <= 25))
    own = np.unique(pieces[opened & solid])
    body = np.isin(pieces, own[own > 0])
    closed = (distance(distance(~body) <= 3) > 3) | body
    filled = ~from_sides(~closed)
    return body[1:-1, 1:-1, 1:-1], filled[1:-1, 1:-1, 1:-1]


class Shape:
    """What the grid of 1 mm tells."""

    def __init__(self, hu, grid: Grid):
        self.grid = grid
        self.body, self.filled = body_of(hu)
        self.depth = distance_on(self.filled)
        body, filled = self.body, self.filled
        fields = {}
        for r in (2, 3, 5):
            fields[f'h{r}'] = distance_on(~(distance_on(~(distance_on(body, r + 2) > r), r + 2) <= r), 2)
        for r in (8, 12, 20, 40):
            core = self.depth > r
            if core.sum() < 2000:
                core = self.depth > 0.7 * self.depth.max()
            fields[f'H{r}'] = np.maximum(distance_on(~core, 25) - r, 0)
        for r in (10, 20):
            fields[f'deep{r}'] = np.maximum(distance_on(distance_on(~filled, r) <= r, r) - r, 0)
        fields['depth'] = self.depth
        solid = filled.astype(np.float32)
        for s in (2, 4, 8):
            fields[f'log{s}'] = 10 * s * ndimage.gaussian_laplace(solid, s)
        fields['dens3'] = ndimage.gaussian_filter(body.astype(np.float32), 3)
        self.fields = {name: field.astype(np.float32) for name, field in fields.items()}
        self.signed = np.where(filled, -self.depth, distance_on(~filled, 15)).astype(np.float32)
        self.mirror = Mirror(hu, self.depth)


class Mirror:
    """The plane of symmetry of the bone."""

    def __init__(self, hu, depth):
        from scipy.optimize import minimize

        bone = ndimage.binary_opening((hu > 280) & (depth > 3))
        pieces, count = ndimage.label(bone)
        if count == 0:
            bone = depth > 3
            pieces, _ = ndimage.label(bone)
        largest = pieces == np.bincount(pieces.ravel())[1:].argmax() + 1
        at = np.argwhere(largest).astype(float)
        at = at[at[:, 0] > at[:, 0].max() - 130]
        rng = np.random.default_rng(0)
        some = at[rng.choice(len(at), min(6000, len(at)), replace=False)]
        off = np.minimum(distance(~largest), 12).astype(np.float32)
        x = np.percentile(at[:, 2], [1, 99]).mean()
        self.centre = np.array([np.median(at[:, 0]), np.median(at[:, 1]), x])
        cost = lambda v: trilinear(off, self.of(some, v)).mean()
        starts = [[[0, 0, a], [4, 0, a], [0, 0.06, a], [0, 0, a + 0.06]] for a in (-0.1, 0.1)]
        fits = [minimize(cost, s[0], method='Nelder-Mead', options={'initial_simplex': s, 'maxiter': 150}) for s in starts]
        best = min(fits, key=lambda f: f.fun)
        self.plane, self.residual = best.x, best.fun

    def of(self, cells, plane=None):
        shift, a, b = self.plane if plane is None else plane
        normal = np.array([np.sin(a), np.sin(b), 1.0])
        normal /= np.linalg.norm(normal)
        return np.ascontiguousarray(cells - 2 * ((cells - self.centre) @ normal - shift)[:, None] * normal)


def normals(scan: Scan, places, reach=1.5):
    both = np.array([-reach, reach])
    gradient = np.stack(
        [np.diff(scan.rays(places, np.tile(e, (len(places), 1)), both), axis=1)[:, 0] for e in np.eye(3)], 1
    ).astype(float)
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    return -gradient / np.maximum(length, 1e-6)


def first(values, at, hit, start, cap):
    hit = hit & (at >= start)
    return np.where(hit.any(1), at[hit.argmax(1)], cap).astype(np.float32)


def measure(scan: Scan, shape: Shape, places):
    """A row of NAMES for each place."""
    rows = [_measure(scan, shape, places[i : i + 100000]) for i in range(0, len(places), 100000)]
    return np.concatenate(rows)


def _measure(scan, shape, places):
    n = normals(scan, places)
    step = 0.5
    inward = np.arange(0, 20.01, step)
    outward = np.arange(0, 15.01, step)
    ins, out = scan.rays(places, -n, inward), scan.rays(places, n, outward)
    f = {f'hu{d}': ins[:, 2 * d].clip(-1000, 400) for d in (2, 3, 4, 6)}
    f['to490'] = first(ins, inward, ins < LEVEL, 1.0, 25)
    f['to250'] = first(ins, inward, ins < -250, 1.5, 25)
    f['to160'] = first(ins, inward, ins < -160, 2.0, 25)
    # The first run of air inward, no more.
    behind = (ins < LEVEL) & (inward >= f['to490'][:, None])
    ended = np.maximum.accumulate((ins >= LEVEL) & (inward > f['to490'][:, None]), 1)
    f['gap'] = (behind & ~ended).sum(1) * step
    f['min3'], f['min8'] = ins[:, 2:7].min(1), ins[:, 2:17].min(1)
    f['max3'], f['max8'] = ins[:, :7].max(1).clip(-1000, 1500), ins[:, :17].max(1).clip(-1000, 1500)
    near = ins[:, :25].clip(-1000, 50)
    before = np.maximum.accumulate(near, 1)
    after = np.maximum.accumulate(near[:, ::-1], 1)[:, ::-1]
    dip = np.minimum(before, after) - near
    f['dip4'], f['dip8'], f['dip12'] = dip[:, :9].max(1), dip[:, :17].max(1), dip.max(1)
    f['to_bone'] = first(ins, inward, ins > 250, 0.5, 22)
    f['fat'] = ((ins[:, 3:20] < -30) & (ins[:, 3:20] > -160)).mean(1)
    f['front'] = first(out, outward, out > LEVEL, 1.0, 16)
    f['front_thick'] = ((out > LEVEL) & (outward >= f['front'][:, None])).sum(1) * step
    cells = np.ascontiguousarray(shape.grid.cells(places))
    for name, field in shape.fields.items():
        f[name] = trilinear(field, cells)
    mirrored = shape.mirror.of(cells)
    f['sym'] = trilinear(shape.signed, mirrored).clip(-15, 15)
    f['sym_abs'] = np.abs(f['sym'])
    f['sym_H12'] = (trilinear(shape.fields['H12'], mirrored) - f['H12']).clip(-15, 15)
    return np.stack([f[name] for name in NAMES], 1).astype(np.float32)


def borders(scan: Scan, shape: Shape, deepest=20.0):
    """Where tissue of the body meets air on a grid line, no deeper than so, one place a mm cube; also the normals' rough
    side: the voxel of air."""
    hu, found = scan.hu, []
    low = np.floor(scan.index(shape.grid.low[None])[0]).astype(int).clip(0)
    for axis in range(3):
        a, b = [slice(None)] * 3, [slice(None)] * 3
        a[axis], b[axis] = slice(0, -1), slice(1, None)
        va, vb = hu[tuple(a)], hu[tuple(b)]
        at = np.argwhere((va > LEVEL) != (vb > LEVEL))
        first_, second = va[tuple(at.T)], vb[tuple(at.T)]
        index = at.astype(float)
        index[:, axis] += (LEVEL - first_) / (second - first_)
        found.append(index)
    places = scan.lps(np.concatenate(found))
    cells = shape.grid.cells(places)
    held = ((cells > 1) & (cells < np.array(shape.grid.shape) - 2)).all(1)
    places, cells = places[held], np.rint(cells[held]).astype(int)
    # Within a cell of the body, and not deep in it.
    if not hasattr(shape, 'near_body'):
        shape.near_body = ndimage.binary_dilation(shape.body, np.ones((3, 3, 3)))
    ok = shape.near_body[tuple(cells.T)] & (shape.depth[tuple(cells.T)] < deepest)
    places = places[ok]
    _, one = np.unique(np.floor(places).astype(np.int64), axis=0, return_index=True)
    return places[one]
