#!/usr/bin/env bash
# The API's description against the rules of Redocly and Spectral (npm, pinned by
# openapi/package-lock.json; no rule is switched off, a warning is a failure, too), and a client that
# openapi-python-client generates from it against a running service.
#   openapi.sh TRIPLANAR
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
triplanar=$(realpath "$1")
dir=$(mktemp -d)
service=
trap '[ -n "$service" ] && kill "$service" 2>/dev/null && wait "$service" 2>/dev/null; rm -rf "$dir"' EXIT
passed=0 failed=0
check() { # what, command…
  local what=$1
  shift
  if "$@" >"$dir/said" 2>&1; then
    echo "ok: $what" && passed=$((passed + 1))
  else
    cat "$dir/said" && echo "FAILED: $what" && failed=$((failed + 1))
  fi
}
no_warning() { "$@" | tee "$dir/lint" && ! grep -qE '^ +[0-9]+:[0-9]+ +warning' "$dir/lint"; }

cp "$here"/openapi/{package.json,package-lock.json,redocly.yaml,spectral.yaml} "$dir/"
"$triplanar" openapi >"$dir/openapi.json" || exit 2
cd "$dir" || exit 2
npm ci --ignore-scripts --no-audit --no-fund >npm.log 2>&1 || { tail -5 npm.log; exit 2; }
export REDOCLY_TELEMETRY=off REDOCLY_SUPPRESS_UPDATE_NOTICE=true
check "no error and no warning by Redocly's recommended rules" \
  no_warning node_modules/.bin/redocly lint --config redocly.yaml --format stylish --max-problems 1000 openapi.json
check "no error and no warning by Spectral's rules for OpenAPI" \
  node_modules/.bin/spectral lint --ruleset spectral.yaml --fail-severity warn openapi.json

python3 -m venv venv
venv/bin/pip -q install -r "$here/openapi/requirements.txt" || exit 2
export PATH=$dir/venv/bin:$PATH
mkdir client
check "openapi-python-client makes a client" \
  openapi-python-client generate --path openapi.json --output-path client/generated --meta none

token=interop
hash=$(printf %s $token | sha256sum | cut -d' ' -f1)
export TRIPLANAR_HTTP__TOKENS="[{ name = \"interop\", role = \"operate\", sha256 = \"$hash\" }]"
"$triplanar" serve --http-listen 127.0.0.1:0 --dimse-listen 127.0.0.1:0 --data-dir "$dir/data" >ready 2>log &
service=$!
"$triplanar" phantom series --matrix 256 --pixel 0.9 --slices 95 --step 2 >/dev/null || exit 2
for _ in $(seq 100); do grep -q 'is ready' ready && break; sleep 0.1; done
url=$(sed -n 's/.*\(http:[^ ]*\).*/\1/p' ready)
PYTHONPATH=client PYTHONDONTWRITEBYTECODE=1 python "$here/openapi/client.py" "$url" $token series | tee calls
read -r p f < <(sed -nE 's/^([0-9]+) passed, ([0-9]+) failed$/\1 \2/p' calls | tail -n 1)
[ -n "${p:-}" ] || { tail -5 log; echo "FAILED: the client did not come to its end"; }
echo "$((passed + ${p:-0})) passed, $((failed + ${f:-1})) failed"
[ $((failed + ${f:-1})) -eq 0 ]
