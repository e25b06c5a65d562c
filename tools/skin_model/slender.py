"""python slender.py DUMP: pieces of the patient's cells that stand out of what a ball of 5 mm enters, how much of them lies
within 10 mm of their cells, and which are cords (see src/pipeline/precise/slender.rs). DUMP.kinds and DUMP.open: eight
float64 (origin, edge, shape x y z, 0), then a byte a cell."""
import sys
from pathlib import Path

import edt
import numpy as np
from scipy import ndimage

BALL, SLENDER, AROUND, CORD_MM3, CORD, LARGEST, WIDTH = 5.0, 0.6, 10.0, 400.0, 30.0, 110.0, 0.2


def cells(path):
    raw = path.read_bytes()
    head = np.frombuffer(raw[:64], np.float64)
    return head[:3], head[3], np.frombuffer(raw[64:], np.uint8).reshape(head[4:7].astype(int)[::-1])


def extent(box, edge):
    return np.linalg.norm([s.stop - s.start - 1 for s in box]) * edge


def main():
    dump = Path(sys.argv[1])
    origin, edge, kinds = cells(dump.with_suffix('.kinds'))
    _, _, open_ = cells(dump.with_suffix('.open'))
    # Patient and what hangs on him; enclosed air.
    patient = (kinds == 1) | (kinds == 3)
    solid = patient | (open_ == 3)
    inner = edt.edt(np.pad(solid, 12, mode='edge'))[12:-12, 12:-12, 12:-12] * edge > BALL
    pieces, _ = ndimage.label(inner)
    core = pieces == np.bincount(pieces[inner]).argmax()
    slender = (edt.edt(~core) * edge > BALL + SLENDER) & patient
    reach = int(AROUND / edge)
    steps = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 3, indexing='ij'), -1).reshape(-1, 3)
    steps = steps[(steps**2).sum(1) <= reach * reach]
    padded = np.pad(slender, reach)
    thread = np.zeros_like(slender)
    pieces, _ = ndimage.label(slender)
    print(f'{dump.stem}: cells of {edge:.2f} mm, {slender.sum()} slender')
    for number, box in enumerate(ndimage.find_objects(pieces), 1):
        if extent(box, edge) <= CORD:
            continue
        at = np.argwhere(pieces[box] == number) + [s.start for s in box]
        around = np.zeros(len(at), int)
        for step in steps:
            around += padded[tuple((at + step + reach).T)]
        volume = around * edge**3
        is_thread = volume < CORD_MM3
        thread[tuple(at[is_thread].T)] = True
        print(
            f'  slender: {len(at)} cells, {extent(box, edge):.0f} mm, mm³ around (5, 50, 95 %)',
            np.percentile(volume, [5, 50, 95]).astype(int), f'thread {is_thread.mean():.2f}, at',
            (origin + edge * at.mean(0)[::-1]).round(),
        )
    pieces, _ = ndimage.label(thread)
    for number, box in enumerate(ndimage.find_objects(pieces), 1):
        if extent(box, edge) <= CORD:
            continue
        at = np.argwhere(pieces[box] == number) + [s.start for s in box]
        axes = np.sqrt(np.linalg.eigvalsh(np.cov(at.T)).clip(0))[::-1] * edge
        cord = extent(box, edge) > LARGEST or axes[1] < WIDTH * axes[0]
        print(f'  thread: {len(at)} cells, {extent(box, edge):.0f} mm, axes', axes.round(1), 'cord' if cord else 'no cord', 'at', (origin + edge * at.mean(0)[::-1]).round())


if __name__ == '__main__':
    main()
