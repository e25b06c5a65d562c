#!/usr/bin/env bash
# Random JPEG Lossless images against their encoder's own samples, pylibjpeg and GDCM.
#   jpeg_lossless.sh TRIPLANAR [COUNT]
# The program `stored-values` is built in the profile of the program.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
target=$(dirname "$(realpath "$1")")
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
profile=$(basename "$target")
[ "$profile" = debug ] && profile=dev
(cd "$here/../.." && cargo build -q --locked --profile "$profile" --target-dir "$(dirname "$target")" -p triplanar-tests --bin stored-values)
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" -q --disable-pip-version-check install \
  'pydicom>=3,<4' 'pylibjpeg>=2,<3' 'pylibjpeg-libjpeg>=2.5,<3' 'python-gdcm>=3,<4' numpy
"$dir/venv/bin/python" "$here/jpeg_lossless.py" "$target/stored-values" "${@:2}"
