"""python rods.py DUMP [TRUTH_POINTS.npy]: the rods among what stands out of the head, in a folder that
`triplanar reconstruct --dump DUMP` has written. A rod is where what stands out within 10 mm spreads along one axis;
`high` is the share of a rod's cells that stand out further than the edge of a thick thing can. With the points of a device
also how far the rods are from them."""
import sys
from pathlib import Path

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

BALL, OUT, HIGH, AROUND, MOST_MM3, LONG, ACROSS, LINK, LEAST = 5.0, 0.6, 1.6, 10.0, 400.0, 3.5, 0.4, 4.0, 25.0
ENCLOSED, PATIENT, ATTACHED = 2, 3, 5


def labels(path):
    raw = path.read_bytes()
    end = raw.index(b'\n\n')
    head = dict(line.split(': ', 1) for line in raw[:end].decode().split('\n') if ': ' in line)
    numbers = lambda text: [float(v) for v in text.strip('() ').split(',')]
    sizes = [int(v) for v in head['sizes'].split()]
    cells = np.frombuffer(raw[end + 2:], np.uint8).reshape(sizes[::-1])
    return cells, np.array(numbers(head['space origin'])), numbers(head['space directions'].split()[0])[0]


def main():
    cells, origin, edge = labels(Path(sys.argv[1]) / 'labels.nrrd')
    solid = np.isin(cells, (ENCLOSED, PATIENT, ATTACHED))
    inner = ndimage.distance_transform_edt(np.pad(solid, 8, mode='edge'))[8:-8, 8:-8, 8:-8] * edge > BALL
    pieces, _ = ndimage.label(inner)
    core = pieces == np.bincount(pieces[inner]).argmax()
    height = ndimage.distance_transform_edt(~core) * edge - BALL
    at = np.argwhere((height > OUT) & np.isin(cells, (PATIENT, ATTACHED)))
    height, places = height[tuple(at.T)], at[:, ::-1] * edge + origin
    tree = cKDTree(places)
    rods, local = [], []
    for i, around in enumerate(tree.query_ball_point(places, AROUND)):
        if 6 < len(around) and len(around) * edge**3 < MOST_MM3:
            spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(places[around].T)), 0))
            if spread[2] > LONG and spread[1] < ACROSS * spread[2]:
                rods.append(i)
                local.append((height[around] > HIGH).mean())
    rods, local = np.array(rods, int), np.array(local)
    pairs = cKDTree(places[rods]).query_pairs(LINK, output_type='ndarray')
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(rods),) * 2)
    count, piece = connected_components(graph)
    device = cKDTree(np.load(sys.argv[2])) if len(sys.argv) > 2 else None
    print(f'{len(places)} cells of {edge:.2f} mm stand out, {len(rods)} of them of rods; rods longer than {LEAST:.0f} mm:')
    for number in range(count):
        of = places[rods[piece == number]]
        long = np.linalg.norm(np.ptp(of, 0))
        if long > LEAST:
            beside = f', {np.median(device.query(of)[0]):.1f} mm from the device' if device else ''
            high = (height[rods[piece == number]] > HIGH).mean()
            most = local[piece == number].max()
            print(f'  {long:.0f} mm, {len(of)} cells, high {high:.2f}, at most {most:.2f} around a cell, at {of.mean(0).round()}{beside}')


if __name__ == '__main__':
    main()
