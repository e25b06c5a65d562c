#!/usr/bin/env bash
# `triplanar evaluate` gives CloudCompare's RMS after ICP within 5 %, with the paper's settings, on
# three pairs that have a cloud, a mesh and a real misalignment as their truth.
#   evaluate.sh TRIPLANAR
# Needs the Debian package cloudcompare (run.sh installs it).
set -uo pipefail
triplanar=$(realpath "$1")
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir" || exit 1
export QT_QPA_PLATFORM=offscreen XDG_RUNTIME_DIR=$dir
chmod 700 "$dir"
passed=0 failed=0

# RMS of CloudCompare's ICP of a cloud onto a cloud or mesh: all points, 90 % overlap.
cloudcompare_rms() {
  timeout 300 CloudCompare -SILENT -NO_TIMESTAMP -C_EXPORT_FMT ASC -O "$1" -O "$2" -ICP -OVERLAP 90 \
    -FARTHEST_REMOVAL -MIN_ERROR_DIFF 1e-4 -RANDOM_SAMPLING_LIMIT 100000000 >cloudcompare.log 2>&1
  sed -nE 's/^.*RMS: ([0-9.]+).*$/\1/p' cloudcompare.log | tail -n 1
}
our_rms() {
  "$triplanar" evaluate "$1" --truth "$2" --json - 2>triplanar.log |
    python3 -c 'import json,sys; print(json.load(sys.stdin)["registration"]["rms_mm"])'
}
check() { # what, cloud, truth
  local ours theirs verdict
  ours=$(our_rms "$2" "$3") theirs=$(cloudcompare_rms "$2" "$3")
  verdict=$(python3 -c '
import sys
ours, theirs = float(sys.argv[1]), float(sys.argv[2])
off = abs(ours / theirs - 1)
print("ok" if off <= 0.05 else "FAILED", f"{100 * off:.3f} % apart")' "${ours:-nan}" "${theirs:-nan}" 2>&1 | tail -n 1)
  echo "${verdict%% *}: $1: rms ${ours:-none} mm, CloudCompare ${theirs:-none} mm, ${verdict#* }"
  if [ "${verdict%% *}" = ok ]; then passed=$((passed + 1)); else
    failed=$((failed + 1))
    tail -n 5 triplanar.log cloudcompare.log
  fi
}

"$triplanar" phantom series >phantom.log 2>&1 || { cat phantom.log; exit 1; }
"$triplanar" reconstruct series -o skin.ply >reconstruct.log 2>&1 || { cat reconstruct.log; exit 1; }
# The true skin as PLY; the head as a mesh with a nose, an ear, and a cloud on it that is noisy, has
# stray points and is 5 degrees and 8 mm off.
python3 - <<'PY'
import ast, math, random, struct

def write(path, points, faces=None):
    with open(path, 'wb') as out:
        head = f'ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n'
        head += ''.join(f'property float {c}\n' for c in 'xyz')
        if faces:
            head += f'element face {len(faces)}\nproperty list uchar int vertex_indices\n'
        out.write((head + 'end_header\n').encode())
        out.write(b''.join(struct.pack('<3f', *p) for p in points))
        out.write(b''.join(struct.pack('<B3i', 3, *f) for f in faces or []))

with open('series.skin.npy', 'rb') as file:
    file.read(8)
    shape = ast.literal_eval(file.read(struct.unpack('<H', file.read(2))[0]).decode())['shape']
    write('truth.ply', list(struct.iter_unpack('<3f', file.read(12 * shape[0]))))

def surface(a, b):
    u = (math.sin(a) * math.cos(b), math.sin(a) * math.sin(b), math.cos(a))
    bump = lambda at, height: height * math.exp(-30 * (1 - sum(p * q for p, q in zip(u, at))))
    r = 1 + bump((0, -1, 0), 0.25) + bump((0.98, 0.2, 0), 0.15) + 0.1 * u[2] * u[1]
    return (75 * r * u[0], 95 * r * u[1], 110 * r * u[2])

rows, columns = 150, 300
points = [surface(math.pi * i / rows, 2 * math.pi * j / columns) for i in range(rows + 1) for j in range(columns)]
faces = []
for i in range(rows):
    for j in range(columns):
        a, b = i * columns + j, i * columns + (j + 1) % columns
        faces += [(a, a + columns, b + columns)] * (i < rows - 1) + [(a, b + columns, b)] * (i > 0)
write('mesh.ply', points, faces)

chance = random.Random(1)
def spot():
    p = surface(math.acos(chance.uniform(-1, 1)), chance.uniform(0, 2 * math.pi))
    f = 1 + chance.gauss(-0.5, 0.4) / math.hypot(*p)
    return tuple(c * f + (chance.gauss(0, 8) if chance.random() < 0.02 else 0) for c in p)
cloud = [spot() for _ in range(20000)]
write('near.ply', cloud)

axis, angle, shift = (1, 2, -1.5), math.radians(5), (5, -4, 4.8)
k = [c / math.hypot(*axis) for c in axis]
def moved(p):
    cross = (k[1] * p[2] - k[2] * p[1], k[2] * p[0] - k[0] * p[2], k[0] * p[1] - k[1] * p[0])
    along = sum(a * b for a, b in zip(k, p)) * (1 - math.cos(angle))
    return tuple(p[i] * math.cos(angle) + cross[i] * math.sin(angle) + k[i] * along + shift[i] for i in range(3))
write('far.ply', [moved(p) for p in cloud])
PY

check "reconstructed skin, cloud as truth" skin.ply truth.ply
check "noisy cloud, mesh as truth" near.ply mesh.ply
check "cloud 5 degrees and 8 mm off, mesh as truth" far.ply mesh.ply
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
