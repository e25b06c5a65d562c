"""python train.py SETS OUT: trees from the sets of make_set.py, leave one head out and leave one kind of device out;
OUT/report.md, OUT/weights.json."""
import json
import sys
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.metrics import roc_auc_score

from devices import KINDS
from features import NAMES

TREES, LEAVES = 80, 15
PER_SET = 20000
DROP = set()


def load(folder):
    sets = {}
    for path in sorted(folder.glob('*_?.npz')):
        stored = np.load(path)
        one = {key: stored[key] for key in stored.files}
        one['head'], one['number'] = path.stem.rsplit('_', 1)[0], int(path.stem[-1])
        one['columns'] = [i for i, n in enumerate(NAMES) if n not in DROP]
        one['x'] = one['values'][:, one['columns']]
        sets[path.stem] = one
    return sets


def trees(seed=0):
    return HistGradientBoostingClassifier(
        max_iter=TREES, max_leaf_nodes=LEAVES, learning_rate=0.1, min_samples_leaf=200, l2_regularization=1.0,
        early_stopping=False, random_state=seed,
    )


def rows(one, rng, without=None):
    """Of each class so many: skin, inner, foreign."""
    label, signed, kind = one['label'], one['signed'], one['kind']
    classes = [label == 1, (label == 0) & (signed < 0), (label == 0) & (signed > 0)]
    if without is not None:
        classes[2] = classes[2] & (kind != without)
    share = [PER_SET // 2, PER_SET // 8, PER_SET // 2]
    take = [np.nonzero(c)[0] for c in classes]
    return np.concatenate([rng.choice(t, min(n, len(t)), replace=False) for t, n in zip(take, share)])


def fit(parts, key='x', without=None):
    rng = np.random.default_rng(1)
    x, y = [], []
    for one in parts:
        if without is not None and not (one['kind'] > 0).any() and one['number']:
            continue
        i = rows(one, rng, without)
        x.append(one[key][i])
        y.append(one['label'][i])
    return trees().fit(np.concatenate(x), np.concatenate(y))


def near_features(one, p):
    """What the first pass says of the neighbours: on the same sheet within 2 and 5 mm, and on the sheets before and
    behind."""
    places, normals = one['places'].astype(float), one['normals']
    if 'links' not in one:
        tree = cKDTree(places)
        links = {}
        for reach in (2.0, 5.0):
            # One of the points a 2 mm cube stands for the rest in the wider ring.
            if reach > 3:
                _, some = np.unique(np.floor(places / 1.5).astype(int), axis=0, return_index=True)
            else:
                some = np.arange(len(places))
            pairs = tree.sparse_distance_matrix(cKDTree(places[some]), reach, output_type='coo_matrix')
            i, j = pairs.row, some[pairs.col]
            same = (normals[i] * normals[j]).sum(1) > 0.3
            links[reach] = (i[same].astype(np.int32), j[same].astype(np.int32))
        sheet = {}
        to490, gap, front = (one['values'][:, NAMES.index(n)] for n in ('to490', 'gap', 'front'))
        for name, step, there in (
            ('behind', -(to490 + gap), (to490 < 20) & (to490 + gap < 20)), ('front', front, front < 15),
        ):
            d, k = tree.query(places + step[:, None] * normals, distance_upper_bound=1.5)
            sheet[name] = np.where(there & np.isfinite(d), k, -1)
        one['links'], one['sheet'] = links, sheet
    new = [p]
    for i, j in one['links'].values():
        count = np.maximum(np.bincount(i, minlength=len(p)), 1)
        new.append(np.bincount(i, p[j], minlength=len(p)) / count)
        low = np.ones(len(p))
        np.minimum.at(low, i, p[j])
        new.append(low)
    for k in one['sheet'].values():
        new.append(np.where(k >= 0, p[k], -1))
    return np.stack(new, 1).astype(np.float32)


NEAR_NAMES = ['p', 'p2', 'p2_least', 'p5', 'p5_least', 'p_behind', 'p_front']


def second(parts, first_of, without=None):
    """The second pass from predictions of a first that has not seen their head."""
    for one in parts:
        p = first_of(one).predict_proba(one['x'])[:, 1]
        one['x2'] = np.c_[one['x'], near_features(one, p)]
    return fit(parts, 'x2', without)


def both(parts, without=None):
    """First and second pass; the second learns from firsts that left its head out."""
    heads = sorted({one['head'] for one in parts})
    inner = {h: fit([o for o in parts if o['head'] != h], without=without) for h in heads}
    two = second(parts, lambda one: inner[one['head']], without)
    return fit(parts, without=without), two


def predict(one, first, two):
    p = first.predict_proba(one['x'])[:, 1]
    return p, two.predict_proba(np.c_[one['x'], near_features(one, p)])[:, 1]


def figures(one, p, cut=0.5):
    """Of known borders: AUC; share of skin kept; of what is kept the share that is inner and foreign."""
    label, signed = one['label'], one['signed']
    known = label >= 0
    kept = p >= cut
    auc = roc_auc_score(label[known], p[known]) if len(np.unique(label[known])) == 2 else float('nan')
    outer = known & ((label == 1) | (signed > 0))
    auc_outer = roc_auc_score(label[outer], p[outer]) if len(np.unique(label[outer])) == 2 else float('nan')
    all_kept = max((kept & known).sum(), 1)
    return {
        'auc': auc, 'auc_foreign': auc_outer, 'skin_kept': kept[label == 1].mean(),
        'inner': ((label == 0) & (signed < 0) & kept).sum() / all_kept,
        'foreign': ((label == 0) & (signed > 0) & kept).sum() / all_kept,
        'devices_kept': kept[(label == 0) & (one['kind'] > 0)].mean() if one['number'] else float('nan'),
    }


def table(f, rows_):
    f.write('| set | AUC | AUC of skin and foreign | skin kept | inner, % of kept | foreign, % of kept | devices kept |\n|' + '---|' * 7 + '\n')
    for name, r in rows_:
        f.write(
            f"| {name} | {r['auc']:.4f} | {r['auc_foreign']:.4f} | {r['skin_kept']:.4f} | {100 * r['inner']:.2f} | "
            f"{100 * r['foreign']:.2f} | {r['devices_kept']:.3f} |\n"
        )
    f.flush()


def main():
    folder, out = Path(sys.argv[1]), Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    sets = load(folder)
    begin = time.monotonic()
    heads = sorted({o['head'] for o in sets.values()})
    with open(out / 'report.md', 'w') as f:
        results = {1: [], 2: []}
        bins = []
        kinds = {k: [[], []] for k in range(1, len(KINDS) + 1)}
        for head in heads:
            first, two = both([o for o in sets.values() if o['head'] != head])
            for name, one in sets.items():
                if one['head'] != head:
                    continue
                p1, p2 = predict(one, first, two)
                results[1].append((name, figures(one, p1)))
                results[2].append((name, figures(one, p2)))
                np.save(out / f'{name}_p.npy', np.stack([p1, p2]).astype(np.float32))
                known = one['label'] >= 0
                bins.append((name, p2[known], one['label'][known]))
                for k in kinds:
                    m = (one['kind'] == k) & (one['label'] == 0)
                    kinds[k][0].append(p2[m])
            print(head, '%.0f s' % (time.monotonic() - begin), flush=True)
        for n in (1, 2):
            f.write(f'\n## Leave one head out, pass {n}\n\n')
            table(f, results[n])
        f.write('\n## Calibration, pass 2 (all borders of heads left out): ten equal-count bins\n\n| heads | ' + ' | '.join(map(str, range(10))) + ' |\n|' + '---|' * 11 + '\n')
        for what, held in (('as they are', '_0'), ('with devices', '')):
            p = np.concatenate([b[1] for b in bins if b[0].endswith(held) and (held or not b[0].endswith('_0'))])
            y = np.concatenate([b[2] for b in bins if b[0].endswith(held) and (held or not b[0].endswith('_0'))])
            order = np.argsort(p)
            cells = [f'{p[i].mean():.3f} / {y[i].mean():.3f}' for i in np.array_split(order, 10)]
            f.write(f'| {what} (said / true) | ' + ' | '.join(cells) + ' |\n')
        f.write('\n## Kept of each kind of device, its head left out\n\n| kind | borders | kept |\n|---|---|---|\n')
        for k, (p, _) in kinds.items():
            p = np.concatenate(p)
            f.write(f'| {KINDS[k - 1]} | {len(p)} | {(p >= 0.5).mean():.3f} |\n')
        print('kinds', flush=True)
        if '--kinds' in sys.argv:
            f.write('\n## The kind left out as well\n\n| kind | AUC | kept |\n|---|---|---|\n')
            for k in kinds:
                said, truths = [], []
                for head in heads:
                    first, two = both([o for o in sets.values() if o['head'] != head], without=k)
                    for one in sets.values():
                        m = (one['kind'] == k) & (one['label'] == 0)
                        if one['head'] != head or m.sum() < 50:
                            continue
                        p = predict(one, first, two)[1]
                        skin = one['label'] == 1
                        said += [p[m], p[skin]]
                        truths += [np.zeros(m.sum()), np.ones(skin.sum())]
                y, p = np.concatenate(truths), np.concatenate(said)
                f.write(f'| {KINDS[k - 1]} | {roc_auc_score(y, p):.4f} | {(p[y == 0] >= 0.5).mean():.3f} |\n')
                f.flush()
                print(KINDS[k - 1], '%.0f s' % (time.monotonic() - begin), flush=True)
        first, two = both(list(sets.values()))
        columns = [NAMES[i] for i in next(iter(sets.values()))['columns']]
        size = write(out / 'weights.json', first, two, columns)
        f.write(f'\nweights.json: {size} bytes\n')


def write(path, first, two, columns):
    """Trees as flat lists of nodes: [feature, threshold, left, right] goes left where value <= threshold; [value] is a leaf."""

    def of(model):
        all_trees = []
        for (one,) in model._predictors:
            nodes = []
            for n in one.nodes:
                if n['is_leaf']:
                    nodes.append([round(float(n['value']), 5)])
                else:
                    nodes.append([int(n['feature_idx']), float(f"{n['num_threshold']:.6g}"), int(n['left']), int(n['right'])])
            all_trees.append(nodes)
        return {'bias': float(model._baseline_prediction.ravel()[0]), 'trees': all_trees}

    text = json.dumps({'features': columns, 'near': NEAR_NAMES, 'first': of(first), 'second': of(two)}, separators=(',', ':'))
    path.write_text(text)
    return len(text)


if __name__ == '__main__':
    main()
