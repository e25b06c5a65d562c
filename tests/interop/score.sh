#!/usr/bin/env bash
# Scores the clouds of both profiles against the known skin of a phantom that is made here by an
# independent program, and, where the shared series are, those of `precise` against the independently
# made skin of two of them; nothing is registered.
#   score.sh TRIPLANAR [SHARED]
set -euo pipefail
triplanar=$(realpath "$1")
shared=$(realpath -m "${2:-../shared}")
tools=$(realpath "$(dirname "$0")/../tools")
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" -q install numpy scipy numba pydicom scikit-image
# Seed 4, as the shared series phantom_4.
"$dir/venv/bin/python" "$tools/phantom.py" "$dir/phantom_4" --gt "$dir/phantom_4_gt.npy" --seed 4 --pitch -8 \
  --dz 1.25 --nz 145 --noise 8 >/dev/null
score() { # name, input of the score
  "$dir/venv/bin/python" "$tools/score.py" "$dir/$1.ply" \
    "$dir/phantom_4.json" "$dir/phantom_4_gt.npy" --json | tee "$dir/$1.json"
}
for plane in triplanar axial sagittal coronal; do
  for profile in paper precise; do
    "$triplanar" reconstruct "$dir/phantom_4" -o "$dir/$profile-$plane.ply" --plane $plane \
      --profile $profile >/dev/null
    score $profile-$plane
  done
done
real=
[ ! -d "$shared/data/series" ] || real=1
[ -n "$real" ] || echo "ignored: real series: no $shared/data"
for name in ${real:+imagex_siemens_phantom_2mm ge_hispeed_tilt_variable}; do
  "$triplanar" reconstruct "$shared/data/series/$name.zip" -o "$dir/$name.ply" --profile precise >/dev/null
  "$dir/venv/bin/python" "$tools/score_real.py" "$dir/$name.ply" "$shared/data/truth/$name.npz" --json |
    tee "$dir/$name.json"
done
for name in ${real:+philips_phantom_5mm philips_phantom_tilt_m18}; do
  ! "$triplanar" reconstruct "$shared/data/series/$name.zip" -o "$dir/$name.ply" --profile precise >"$dir/$name.txt" 2>&1
  grep -o 'no_head' "$dir/$name.txt"
done
"$dir/venv/bin/python" - "$dir" <<'PY'
import json, os, sys
load = lambda name: json.load(open(f'{sys.argv[1]}/{name}.json'))
planes = ('axial', 'sagittal', 'coronal')
paper, precise = load('paper-triplanar'), load('precise-triplanar')
biases = {profile: [load(f'{profile}-{p}')['bias_mm'] for p in planes] for profile in ('paper', 'precise')}
real = os.path.exists(f'{sys.argv[1]}/ge_hispeed_tilt_variable.json')
# what, measured, limit, whether more is better
checks = [
    ('paper: rms, mm', paper['rms_mm'], 0.70, False),
    ('paper: stray share', paper['stray'], 0.003, False),
    ("paper: spread of the planes' biases, mm", max(biases['paper']) - min(biases['paper']), 0.12, False),
    ('precise: rms, mm', precise['rms_mm'], 0.06, False),
    ('precise: bias, mm', abs(precise['bias_mm']), 0.015, False),
    ('precise: p99, mm', precise['p99_mm'], 0.2, False),
    ('precise: stray share', precise['stray'], 0.0, False),
    ('precise: coverage', precise['coverage'], 0.995, True),
    ("precise: largest of the planes' biases, mm", max(map(abs, biases['precise'])), 0.03, False),
]
if real:
    imagex, ge = load('imagex_siemens_phantom_2mm'), load('ge_hispeed_tilt_variable')
    checks += [
        ('precise, imagex: certain rms, mm', imagex['rms_certain_mm'], 0.25, False),
        ('precise, imagex: certain bias, mm', abs(imagex['bias_certain_mm']), 0.05, False),
        ('precise, imagex: stray share', imagex['stray'], 0.003, False),
        ('precise, imagex: coverage', imagex['coverage'], 0.98, True),
        ('precise, GE: certain rms, mm', ge['rms_certain_mm'], 1.0, False),
        ('precise, GE: stray share', ge['stray'], 0.01, False),
        ('precise, GE: coverage within 1.5 mm', ge['coverage_1p5'], 0.95, True),
    ]
failed = 0
for what, value, limit, more in checks:
    ok = value >= limit if more else value <= limit
    failed += not ok
    print(f"{'ok' if ok else 'FAILED'}: {what}: {value:.4f}, limit {limit}")
print(f'{len(checks) - failed} passed, {failed} failed')
sys.exit(failed > 0)
PY
