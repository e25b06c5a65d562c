#!/usr/bin/env bash
# Everything that other people's software has a say in, against a built binary:
#   tests/interop/run.sh target/release/triplanar
# A line for each check, "N passed, N failed" at the end; exit code 0 if none failed. As root it
# installs the Debian packages that are missing; Python packages go to a temporary folder.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
triplanar=$(realpath "${1:-target/release/triplanar}")
[ -x "$triplanar" ] || { echo "no binary at $triplanar: cargo build --release" >&2; exit 2; }
shared=${TRIPLANAR_TEST_DATA:+$(dirname "$TRIPLANAR_TEST_DATA")}
shared=${shared:-$here/../../../shared}
log=$(mktemp)
trap 'rm -f "$log"' EXIT
passed=0 failed=0

run() { # name, command…: its last line says "N passed, N failed"
  printf '\n-- %s\n' "$1"
  shift
  "$@" 2>&1 | tee "$log"
  local status=${PIPESTATUS[0]} p f
  read -r p f < <(sed -nE 's/^([0-9]+) passed, ([0-9]+) failed$/\1 \2/p' "$log" | tail -n 1)
  passed=$((passed + ${p:-0})) failed=$((failed + ${f:-0}))
  if [ "$status" -ne 0 ] && [ "${f:-0}" -eq 0 ]; then
    echo "FAILED: ended with exit code $status"
    failed=$((failed + 1))
  fi
}

missing=()
for package in dcmtk openjph-tools orthanc pcl-tools cloudcompare python3-venv curl; do
  dpkg -s "$package" >/dev/null 2>&1 || missing+=("$package")
done
command -v npm >/dev/null || missing+=(nodejs npm)
if [ ${#missing[@]} -gt 0 ]; then
  apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" ||
    { echo "install ${missing[*]} first" >&2; exit 2; }
fi

run "DICOM peers" "$here/peers.sh" "$triplanar" "$shared"
run "JPEG Lossless against its encoder, pylibjpeg and GDCM" "$here/jpeg_lossless.sh" "$triplanar"
run "damaged series of every codec" "$here/damage.sh" "$triplanar" "$shared" 5
run "the API against its description" "$here/api.sh" "$triplanar"
run "the API's description by Redocly and Spectral, and a client made from it" "$here/openapi.sh" "$triplanar"
run "point-cloud tools" "$here/clouds.sh" "$triplanar"
run "CloudCompare's registration" "$here/evaluate.sh" "$triplanar"
run "score against the known skin" "$here/score.sh" "$triplanar" "$shared"
run "full disks and kill -9" "$here/faults.sh" "$triplanar" 3 1

printf '\n%d passed, %d failed\n' "$passed" "$failed"
[ "$failed" -eq 0 ]
