#!/usr/bin/env bash
# Damaged series of every codec: whatever gets through without an error and without a doubt must give
# the cloud of the unharmed series, within 1 mm.
#   damage.sh TRIPLANAR [SHARED] [ROUNDS]
# For each codec ROUNDS series (40; a quarter of an hour on two cores with all codecs; 5 in the interop run) with one to three slices
# truncated, zeroed from a row on, with a lost or swapped fragment, or with flipped bytes: phantoms and
# human heads (where the shared data are), small ones and ones with 512 columns. Seeded: a failure names
# what to repeat; DAMAGE_KEEP=DIR keeps the damaged files that passed quietly, DAMAGE_VERBOSE=1 tells every
# round. HTJ2K needs ojph_compress (openjph-tools), JPEG-LS dcmcjpls (dcmtk) and a build with `jpegls`. `damage.sh --unharmed TRIPLANAR DIR…` holds that no folder of DIR… raises that doubt.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
if [ -n "${DAMAGE_PYTHON:-}" ]; then
  python=$DAMAGE_PYTHON
else
  python3 -m venv "$dir/venv"
  python=$dir/venv/bin/python
  "$python" -m pip -q install numpy scipy pydicom pylibjpeg pylibjpeg-libjpeg pylibjpeg-openjpeg pylibjpeg-rle python-gdcm
fi
export OPENBLAS_NUM_THREADS=1 PYTHONPATH=$here
if [ "${1:-}" = --unharmed ]; then
  triplanar=$(realpath "$2")
  shift 2
  "$python" -m damage.unharmed "$triplanar" "$dir" "$@"
else
  triplanar=$(realpath "${1:-target/release/triplanar}")
  shared=${2:-${TRIPLANAR_TEST_DATA:+$(dirname "$TRIPLANAR_TEST_DATA")}}
  "$python" -m damage "$triplanar" "$dir" "${shared:-$here/../../../shared}" "${3:-40}"
fi
