#!/usr/bin/env bash
# Faults of the machine against a running service: disks that run full, a clock that is set back,
# kill -9 under load. Nothing acknowledged may be lost, and no restart may be needed.
#   faults.sh TRIPLANAR [KILLS [FILLS]]
# KILLS rounds of kill -9 (default 5; the full run is 100) and FILLS of a full disk (default 3; 20).
# Small disks are tmpfs, which only root may mount; the clock needs the Debian package faketime.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
triplanar=$(realpath "$1")
dir=$(mktemp -d)
trap 'mountpoint -q "$dir/disk" && umount -l "$dir/disk"; rm -rf "$dir"' EXIT
cd "$dir"
PYTHONPATH=$here PYTHONDONTWRITEBYTECODE=1 python3 -m faults "$triplanar" "$dir" "${2:-5}" "${3:-3}"
