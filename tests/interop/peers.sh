#!/usr/bin/env bash
# Real DICOM peers push a head CT into a running service; the cloud that HTTP then serves is the
# one that `triplanar reconstruct` makes of the same files, byte for byte.
#   peers.sh TRIPLANAR [SHARED]
# Needs the Debian packages dcmtk and orthanc (see run.sh); Python packages go to a venv of its own.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
triplanar=$(realpath "$1")
shared=${2:-}
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" -q --disable-pip-version-check install \
  'pydicom>=3,<4' 'pynetdicom>=3,<4' 'dicomweb-client>=0.59,<1' 'pylibjpeg>=2,<3' 'pylibjpeg-openjpeg>=2,<3' numpy requests
cd "$dir"
PYTHONPATH=$here PYTHONDONTWRITEBYTECODE=1 "$dir/venv/bin/python" -m peers "$triplanar" "$dir" ${shared:+"$shared"}
