"""python rules.py DUMP TRUTH_DIR NAME [CORD_MASK_SERIES]: what each rule of `precise` takes, of skin and of other
borders, and how much of the true skin its borders would cover. DUMP: rows of 12 float32 (place, normal, rule, axis,
ascending, measured, limit, 0)."""
import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import truth

RULES = {
    0: 'accepted', 1: 'far from outside air', 4: 'no clear tissue behind', 5: 'not own tissue', 6: 'canal', 7: 'inside',
    8: 'blur of a slice', 10: 'foreign', 11: 'field of view', 12: 'touching', 13: 'unresolved', 14: 'unresolved edge',
    15: 'unresolved between', 16: 'covered', 17: 'scrap', 18: 'cut',
}


def main():
    rows = np.fromfile(sys.argv[1], np.float32).reshape(-1, 12)
    known = truth.load(Path(sys.argv[2]), sys.argv[3])
    places = rows[:, :3].astype(float)
    low, high = known.places.min(0) - 40, known.places.max(0) + 40
    held = ((places > low) & (places < high)).all(1)
    rows, places = rows[held], places[held]
    rule = rows[:, 6].astype(int)
    # One border of each rule a mm cube.
    _, one = np.unique(np.c_[rule, np.floor(places).astype(int)], axis=0, return_index=True)
    places, rule = places[one], rule[one]
    label, signed, _ = truth.labels(known, places)
    certain = known.certain()
    trees = {r: cKDTree(places[rule == r]) for r in np.unique(rule)}
    near = {r: trees[r].query(certain, distance_upper_bound=1.0)[0] < 1.0 for r in trees}
    accepted = near.get(0, np.zeros(len(certain), bool))
    every = np.any(list(near.values()), 0)
    print(f'{sys.argv[3]}: coverage accepted {accepted.mean():.4f}, with all borders {every.mean():.4f}')
    print('| rule | borders (1 mm) | skin | inner | foreign | unknown | coverage with it | lost without it alone |\n|' + '---|' * 8)
    for r in sorted(trees):
        m = rule == r
        others = np.any([near[q] for q in near if q != r], 0) if len(near) > 1 else accepted
        print(
            f"| {RULES.get(r, r)} | {m.sum()} | {(label[m] == 1).sum()} | {((label[m] == 0) & (signed[m] < 0)).sum()} | "
            f"{((label[m] == 0) & (signed[m] > 0)).sum()} | {(label[m] < 0).sum()} | {(accepted | near[r]).mean():.4f} | "
            f'{every.mean() - others.mean():.4f} |'
        )


if __name__ == '__main__':
    main()
