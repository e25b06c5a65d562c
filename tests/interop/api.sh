#!/usr/bin/env bash
# Starts a service with one finished series and checks it against its own description.
#   api.sh TRIPLANAR
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
triplanar=$(realpath "$1")
dir=$(mktemp -d)
service=
trap '[ -n "$service" ] && kill "$service" 2>/dev/null && wait "$service" 2>/dev/null; rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" -q install schemathesis || exit 2

ports=$(python3 -c 'import socket
a, b = socket.socket(), socket.socket(); a.bind(("127.0.0.1", 0)); b.bind(("127.0.0.1", 0))
print(a.getsockname()[1], b.getsockname()[1])')
url=http://127.0.0.1:${ports% *}
# The description asks for tokens: only a service that has some does what it says.
export TOKEN=interop
hash=$(printf %s "$TOKEN" | sha256sum | cut -d' ' -f1)
export TRIPLANAR_HTTP__TOKENS="[{ name = \"interop\", role = \"operate\", sha256 = \"$hash\" }]"
"$triplanar" serve --http-listen "127.0.0.1:${ports% *}" --dimse-listen "127.0.0.1:${ports#* }" \
  --data-dir "$dir/data" >"$dir/log" 2>&1 &
service=$!
"$triplanar" phantom "$dir/series" >/dev/null 2>&1 && (cd "$dir/series" && python3 -m zipfile -c ../series.zip ./*)
for _ in $(seq 100); do curl -fs "$url/readyz" >/dev/null && break; sleep 0.1; done
curl -fs -H "Authorization: Bearer $TOKEN" -F "file=@$dir/series.zip" "$url/v1/series" >/dev/null || { tail -5 "$dir/log"; echo "FAILED: the upload was refused"; echo "0 passed, 1 failed"; exit 1; }

cd "$dir" || exit 2
if PATH=$dir/venv/bin:$PATH "$here/schemathesis.sh" "$url" >schemathesis.log 2>&1; then
  tail -n 25 schemathesis.log
  echo "1 passed, 0 failed"
else
  tail -n 120 schemathesis.log
  echo "0 passed, 1 failed"
  exit 1
fi
