"""python make_set.py SHARED CACHE OUT [NAME...]: features and labels of the borders of every head, as it is and with
devices put onto it: OUT/NAME_SET.npz."""
import sys
import time
from pathlib import Path

import numpy as np

import devices
import features
import scan
import truth

HEADS = {
    'invesalius_dz075': 'CACHE/invesalius_dz075', 'vismale': 'SHARED/data/series/vismale.zip',
    'vhf_head': 'SHARED/data/series/vhf_head.zip', 'imagex_siemens_phantom_2mm': 'SHARED/data/series/imagex_siemens_phantom_2mm.zip',
    'ge_hispeed_tilt_variable': 'SHARED/data/series/ge_hispeed_tilt_variable.zip',
}


def place(name, shared, cache):
    return Path(HEADS[name].replace('SHARED', str(shared)).replace('CACHE', str(cache)))


def one(name, number, volume, grid, known, out, site=None):
    begin = time.monotonic()
    device = kind = None
    if number:
        rng = np.random.default_rng([number, sum(map(ord, name))])
        site.clear(volume, rng)
        clean, kinds = devices.SETS[number]
        if clean:
            site.cleaned()
        for k in kinds:
            devices.MAKERS[k](site)
        volume = site.scan
        np.clip(volume.hu, -1024, 3071, out=volume.hu)
    put = time.monotonic() - begin
    hu = grid.resampled(volume)
    shape = features.Shape(hu, grid)
    places = features.borders(volume, shape)
    values = features.measure(volume, shape, places)
    normals = features.normals(volume, places)
    if number:
        cells = np.ascontiguousarray(grid.cells(places))
        device = scan.trilinear(site.device, cells)
        kind = site.kind[tuple(np.rint(cells).astype(int).T)]
        kind = np.where(device < 0.9, kind, 0)
    if number and devices.SETS[number][0]:
        known.devices, kept = None, known.devices
        label, signed, doubt = truth.labels(known, places, device)
        known.devices = kept
    else:
        label, signed, doubt = truth.labels(known, places, device)
    np.savez(
        out / f'{name}_{number}.npz', places=places.astype(np.float32), normals=normals.astype(np.float32), values=values, label=label, signed=signed,
        doubt=doubt, kind=np.zeros(len(label), np.int8) if kind is None else kind.astype(np.int8),
    )
    print(
        name, number, len(label), 'skin', (label == 1).sum(), 'inner', ((label == 0) & (signed < 0)).sum(), 'foreign',
        ((label == 0) & (signed > 0)).sum(), 'kinds', np.bincount(kind[(label == 0)], minlength=9) if number else '',
        'sigma %.2f' % site.sigma if number else '', 'mirror %.2f mm' % shape.mirror.residual, 'put %.0f s' % put, '%.0f s' % (time.monotonic() - begin), flush=True,
    )


def main():
    shared, cache, out = map(Path, sys.argv[1:4])
    out.mkdir(parents=True, exist_ok=True)
    names = [n for n in sys.argv[4:] if n in HEADS] or list(HEADS)
    sets = [int(n) for n in sys.argv[4:] if n.isdigit()] or [0, *devices.SETS]
    for name in names:
        volume = scan.load(place(name, shared, cache))
        known = truth.load(shared / 'data/truth', name)
        grid = scan.around(volume, known.places)
        site = devices.Site(volume, grid, known) if any(sets) else None
        for number in sets:
            one(name, number, volume, grid, known, out, site)


if __name__ == '__main__':
    main()
