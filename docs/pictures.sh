#!/usr/bin/env bash
# Makes the pictures of README and docs/measured.md again:
#   docs/pictures.sh target/release/triplanar [SERIES_DIR]
# The phantom is the program's own. The second series is imagex_siemens_phantom_2mm.zip of SERIES_DIR,
# default ../shared/data/series. Where that is not there, or is another series than the README speaks
# of, its pictures and the slices' stay as they are. No picture is touched before all are made.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
triplanar=$(realpath "${1:?the program, e.g. target/release/triplanar}")
series=${2:-$here/../../shared/data/series}
imagex=$series/imagex_siemens_phantom_2mm.zip
# The Series Instance UID of the anthropomorphic phantom that the README describes.
imagex_uid=1.3.12.2.1107.5.1.4.95502.30000022092600392886700001045
dir=$(mktemp -d)
mkdir "$dir/pictures"
server=
trap '[ -z "$server" ] || kill "$server"; rm -rf "$dir"' EXIT

clouds() { # name, input, colour limit in mm
  for profile in paper precise; do
    "$triplanar" reconstruct "$2" --profile $profile -o "$dir/$1_$profile.ply" >"$dir/$1_$profile.txt" 2>&1 || {
      cat "$dir/$1_$profile.txt" >&2
      exit 1
    }
  done
  for colour in error plane; do
    "$triplanar" render "$dir/$1_paper.ply" "$dir/$1_precise.ply" --caption paper --caption precise \
      --colour $colour --max-error "$3" --height 440 -o "$dir/pictures/$1_$colour.png"
  done
}

slices() { # input: one slice of each plane, as a service of our own draws it
  "$triplanar" serve --http-listen 127.0.0.1:0 --dimse-listen 127.0.0.1:0 --data-dir "$dir/data" \
    >"$dir/ready" 2>"$dir/log" &
  server=$!
  for _ in $(seq 100); do grep -q 'is ready' "$dir/ready" && break || sleep 0.1; done
  url=$(sed -n 's/.*\(http:[^ ]*\).*/\1/p' "$dir/ready")
  [ -n "$url" ] || { cat "$dir/log" >&2; exit 1; }
  curl -sf -F "file=@$1" "$url/v1/series" >/dev/null
  id= state=
  for _ in $(seq 600); do
    curl -sf "$url/v1/reconstructions?series=$imagex_uid" >"$dir/rows"
    read -r id state < <(python3 -c '
import json, sys
rows = next(value for value in json.load(sys.stdin).values() if isinstance(value, list))
print(*(rows[0]["id"], rows[0]["state"]) if rows else ("", ""))' <"$dir/rows") || true
    case $state in succeeded) break ;; failed) exit 1 ;; *) sleep 0.2 ;; esac
  done
  for slice in axial/60 sagittal/255 coronal/280; do
    curl -sf "$url/v1/reconstructions/$id/slices/$slice.png" -o "$dir/pictures/slice_${slice%/*}.png"
  done
}

"$triplanar" phantom "$dir/phantom" --pitch -6 --yaw 8 --slices 180 --step 1.0 >/dev/null
clouds phantom "$dir/phantom" 0.2
if [ ! -f "$imagex" ]; then
  echo "imagex_*.png and slice_*.png stay as they are: no $imagex" >&2
else
  clouds imagex "$imagex" 0.3
  uid=$(sed -n 's/^series *//p' "$dir/imagex_precise.txt")
  [ "$uid" = "$imagex_uid" ] || { echo "$imagex holds the series $uid, not $imagex_uid: no picture is changed" >&2; exit 1; }
  slices "$imagex"
fi
cp "$dir"/pictures/*.png "$here/"
(cd "$dir/pictures" && ls -l ./*.png)
