#!/usr/bin/env bash
# Memory and time to stop, as a user sees them, against a running service.
#   bounds.sh TRIPLANAR [full]
# `full`: as many readers and series as the release is held to; without it a shortened run.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
triplanar=$(realpath "$1")
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 "$here/bounds/bounds.py" "$triplanar" "$dir" "${2:-short}"
