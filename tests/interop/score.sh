#!/usr/bin/env bash
# Scores the cloud that `paper` gives of the shared phantom against its known skin; nothing is registered.
#   score.sh TRIPLANAR [SHARED]
# rms ≤ 0.70 mm, stray ≤ 0.3 %, single-plane biases no more than 0.12 mm apart.
set -euo pipefail
triplanar=$(realpath "$1")
shared=$(realpath "${2:-../shared}")
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" -q install numpy scipy numba
for plane in triplanar axial sagittal coronal; do
  "$triplanar" reconstruct "$shared/data/series/phantom_4.zip" -o "$dir/$plane.ply" --plane $plane --profile paper
  "$dir/venv/bin/python" "$shared/tools/score.py" "$dir/$plane.ply" \
    "$shared/data/phantom_4.json" "$shared/data/phantom_4_gt.npy" --json | tee "$dir/$plane.json"
done
"$dir/venv/bin/python" - "$dir" <<'PY'
import json, sys
score = {p: json.load(open(f'{sys.argv[1]}/{p}.json')) for p in ('triplanar', 'axial', 'sagittal', 'coronal')}
biases = [score[p]['bias_mm'] for p in ('axial', 'sagittal', 'coronal')]
checks = [('rms of the cloud, mm', score['triplanar']['rms_mm'], 0.70), ('stray share', score['triplanar']['stray'], 0.003),
          ('spread of the planes\' biases, mm', max(biases) - min(biases), 0.12)]
failed = 0
for what, value, limit in checks:
    failed += value > limit
    print(f"{'ok' if value <= limit else 'FAILED'}: {what}: {value:.4f}, limit {limit}")
print(f'{len(checks) - failed} passed, {failed} failed')
sys.exit(failed > 0)
PY
