"""python quick.py SETS: the first pass alone, leave one head out, on few rows."""
import sys
from pathlib import Path

import numpy as np

import train

train.TREES, train.PER_SET = 60, 12000
sets = train.load(Path(sys.argv[1]))
for head in sorted({o['head'] for o in sets.values()}):
    model = train.fit([o for o in sets.values() if o['head'] != head])
    for name, one in sets.items():
        if one['head'] == head:
            p = model.predict_proba(one['x'])[:, 1]
            f = train.figures(one, p)
            kinds = {train.KINDS[k - 1]: round(float((p[(one['kind'] == k) & (one['label'] == 0)] >= 0.5).mean()), 3) for k in range(1, 9) if ((one['kind'] == k) & (one['label'] == 0)).sum() > 50}
            known = one['label'] >= 0
            order = np.array_split(np.argsort(p[known]), 10)
            print(name, {k: round(float(v), 4) for k, v in f.items()}, kinds, [f'{p[known][i].mean():.2f}/{one["label"][known][i].mean():.2f}' for i in order], flush=True)
