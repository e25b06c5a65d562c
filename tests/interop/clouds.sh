#!/usr/bin/env bash
# PCL's tools and CloudCompare open our PLY and PCD of both profiles and count the same points; PCL finds
# every field under its own name and with its value.
#   clouds.sh TRIPLANAR
# Needs the Debian packages pcl-tools and cloudcompare (run.sh installs them).
set -uo pipefail
triplanar=$(realpath "$1")
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir" || exit 1
export QT_QPA_PLATFORM=offscreen XDG_RUNTIME_DIR=$dir
passed=0 failed=0

check() { # what, expected, got
  if [ -n "$2" ] && [ "$2" = "$3" ]; then
    echo "ok: $1: $3 points"
    passed=$((passed + 1))
  else
    echo "FAILED: $1: expected $2 points, got ${3:-none}"
    failed=$((failed + 1))
  fi
}
same() { # what, expected, got
  if [ -n "$2" ] && [ "$2" = "$3" ]; then
    echo "ok: $1: ${2#FIELDS }"
    passed=$((passed + 1))
  else
    echo "FAILED: $1: expected $2, got $3"
    failed=$((failed + 1))
  fi
}
# What a second PCD holds of the first one's points. PCL fills its files up to a page with zeros.
pcd_data() { python3 -c 'import sys
ours, theirs = (open(f, "rb").read().split(b"DATA binary\n", 1)[1] for f in sys.argv[1:])
print("the same" if theirs.startswith(ours) and not theirs[len(ours):].strip(b"\0") else "others")' "$1" "$2"; }
# The header's count, in a PLY and in a PCD.
ply_points() { LC_ALL=C grep -a -m1 '^element vertex' "$1" | cut -d' ' -f3 | tr -d '\r'; }
pcd_points() { LC_ALL=C grep -a -m1 '^POINTS' "$1" | cut -d' ' -f2 | tr -d '\r'; }
# What CloudCompare read: it writes one line a point.
cloudcompare_points() {
  rm -f asc/*
  mkdir -p asc && cp "$1" asc/ || return
  timeout 120 CloudCompare -SILENT -NO_TIMESTAMP -C_EXPORT_FMT ASC -O "asc/$1" -SAVE_CLOUDS >cloudcompare.log 2>&1
  cat asc/*.asc 2>/dev/null | wc -l
}

"$triplanar" phantom series >phantom.log 2>&1 || { cat phantom.log; exit 1; }
for profile in paper precise; do
  echo "profile $profile"
  for name in binary.ply:ply_binary ascii.ply:ply_ascii binary.pcd:pcd cloud.npy:npy; do
    file=${name%%:*}
    "$triplanar" reconstruct series -o "$file" --profile $profile --format "${name##*:}" >reconstruct.log 2>&1 || { cat reconstruct.log; exit 1; }
  done
  points=$(python3 -c 'import ast,sys
f=open("cloud.npy","rb"); f.read(8); n=int.from_bytes(f.read(2),"little"); print(ast.literal_eval(f.read(n).decode())["shape"][0])')

  check "PLY binary header" "$points" "$(ply_points binary.ply)"
  check "PLY ascii header" "$points" "$(ply_points ascii.ply)"
  check "PCD header" "$points" "$(pcd_points binary.pcd)"
  pcl_ply2pcd binary.ply from_binary.pcd >pcl.log 2>&1
  check "pcl_ply2pcd, PLY binary" "$points" "$(pcd_points from_binary.pcd)"
  pcl_ply2pcd ascii.ply from_ascii.pcd >>pcl.log 2>&1
  check "pcl_ply2pcd, PLY ascii" "$points" "$(pcd_points from_ascii.pcd)"
  pcl_pcd2ply binary.pcd from_pcd.ply >>pcl.log 2>&1
  check "pcl_pcd2ply, PCD" "$points" "$(ply_points from_pcd.ply)"
  # Every field under PCL's own name, and every value: what PCL makes of our PLY is our PCD.
  ours=$(grep -a -m1 '^FIELDS' binary.pcd)
  for file in from_binary.pcd from_ascii.pcd; do
    same "PCL's fields, $file" "$ours" "$(grep -a -m1 '^FIELDS' "$file")"
    same "PCL's values, $file" "the same" "$(pcd_data binary.pcd "$file")"
  done
  # Debian's CloudCompare opens no PCD: it gets what PCL made of ours.
  for file in binary.ply ascii.ply from_pcd.ply; do
    check "CloudCompare, $file" "$points" "$(cloudcompare_points "$file")"
  done
done
echo "$passed passed, $failed failed"
[ "$failed" -eq 0 ]
