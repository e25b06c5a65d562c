#!/usr/bin/env bash
# Every series whose skin is known, scored: real heads, what hospitals do to one of them
# (tests/tools/variants.py), the shared phantom. A row of a Markdown table for each; nothing is registered.
#   heads.sh TRIPLANAR SHARED [NAME...]
# SHARED: a folder with data/series and data/truth. Needs the Debian package invesalius-examples (fetched by
# apt-get) for the head that the variants are made of. HEADS_CACHE: a folder that keeps the series made.
# All of it takes some 15 minutes on two cores.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
triplanar=$(realpath "$1") shared=$(realpath "$2")
shift 2
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cache=$(realpath -m "${HEADS_CACHE:-$dir/cache}")
mkdir -p "$cache"
if [ ! -e "$cache/matrix.dat" ]; then
  (cd "$dir" && apt-get download -qq invesalius-examples && dpkg -x invesalius-examples_*.deb package) 2>/dev/null ||
    { echo "apt-get download invesalius-examples failed" >&2; exit 2; }
  tar -xf "$(find "$dir/package" -name '*.inv3' | head -n 1)" -C "$dir" --wildcards --no-anchored matrix.dat
  mv "$(find "$dir" -name matrix.dat | head -n 1)" "$cache/matrix.dat"
fi
if [ -n "${HEADS_PYTHON:-}" ]; then
  python=$HEADS_PYTHON
else
  python3 -m venv "$dir/venv"
  python=$dir/venv/bin/python
  "$python" -m pip -q install numpy scipy numba pydicom scikit-image
fi
PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=$here "$python" -m heads "$triplanar" "$shared" "$cache" "$dir" "$@"
