#!/usr/bin/env bash
# Makes the README's pictures again:
#   docs/pictures.sh target/release/triplanar [SERIES_DIR]
# The phantom is the program's own; the second series (imagex_siemens_phantom_2mm.zip) is taken from
# SERIES_DIR, default ../shared/data/series, and left out where that is not there.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
triplanar=$(realpath "$1")
series=${2:-$here/../../shared/data/series}
dir=$(mktemp -d)
server=
trap '[ -z "$server" ] || kill "$server"; rm -rf "$dir"' EXIT

clouds() { # name, input, colour limit in mm
  for profile in paper precise; do
    "$triplanar" reconstruct "$2" --profile $profile -o "$dir/$1_$profile.ply" >/dev/null 2>&1
  done
  for colour in error plane; do
    "$triplanar" render "$dir/$1_paper.ply" "$dir/$1_precise.ply" --caption paper --caption precise \
      --colour $colour --max-error "$3" --height 440 -o "$here/$1_$colour.png"
  done
}

"$triplanar" phantom "$dir/phantom" --pitch -6 --yaw 8 --slices 180 --step 1.0 >/dev/null
clouds phantom "$dir/phantom" 0.2
if [ -f "$series/imagex_siemens_phantom_2mm.zip" ]; then
  clouds imagex "$series/imagex_siemens_phantom_2mm.zip" 0.3
fi

# One slice of each plane, as the service draws it.
input=$series/imagex_siemens_phantom_2mm.zip
[ -f "$input" ] || { (cd "$dir/phantom" && tar cf "$dir/phantom.tar" .) && input=$dir/phantom.tar; }
printf '[http]\nlisten = "127.0.0.1:18480"\n[dimse]\nlisten = "127.0.0.1:18481"\n[storage]\ndata_dir = "%s/data"\n' \
  "$dir" >"$dir/config.toml"
"$triplanar" serve --config "$dir/config.toml" >"$dir/log" 2>&1 &
server=$!
url=http://127.0.0.1:18480
for _ in $(seq 100); do curl -sf $url/readyz >/dev/null && break || sleep 0.1; done
id=$(curl -sf -F "file=@$input" $url/v1/series | python3 -c '
import json, sys
def find(value):
    if isinstance(value, dict):
        if "instances_sha256" in value: return value["id"]
        value = list(value.values())
    if isinstance(value, list):
        return next(filter(None, map(find, value)), None)
print(find(json.load(sys.stdin)))')
for _ in $(seq 600); do
  state=$(curl -sf $url/v1/reconstructions/$id | python3 -c 'import json, sys; print(json.load(sys.stdin)["state"])')
  case $state in queued | running) sleep 0.2 ;; *) break ;; esac
done
curl -sf $url/v1/reconstructions/$id/slices/axial/60.png -o "$here/slice_axial.png"
curl -sf $url/v1/reconstructions/$id/slices/sagittal/255.png -o "$here/slice_sagittal.png"
curl -sf $url/v1/reconstructions/$id/slices/coronal/280.png -o "$here/slice_coronal.png"
ls -l "$here"/*.png
