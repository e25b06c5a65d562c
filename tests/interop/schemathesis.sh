#!/bin/sh
# Checks a running service against its own description with schemathesis (PyPI): no 5xx, no answer
# that openapi.json does not promise, odd methods, headers and bodies included.
#
#   TOKEN=… tests/interop/schemathesis.sh http://127.0.0.1:8080 [further options of schemathesis]
#
# TOKEN is one of the role operate: the service must have tokens configured, or the description,
# which asks for them, is not what it does. It sends PUT and DELETE: not to data that matters.
#
# Left out: positive_data_acceptance. A made-up cursor, or random bytes as an archive, fit the
# schema and are refused all the same.
set -eu
base=${1:?base URL of the service}
shift
TRIPLANAR_BASE=$base
TRIPLANAR_TOKEN=${TOKEN:?a token of the role operate}
SCHEMATHESIS_HOOKS=schemathesis_hooks
PYTHONPATH=$(dirname "$0")${PYTHONPATH:+:$PYTHONPATH}
export TRIPLANAR_BASE TRIPLANAR_TOKEN SCHEMATHESIS_HOOKS PYTHONPATH
exec schemathesis run "$base/openapi.json" \
    --header "Authorization: Bearer $TRIPLANAR_TOKEN" \
    --checks all \
    --exclude-checks positive_data_acceptance \
    --max-examples "${EXAMPLES:-50}" \
    --seed 1 \
    --request-timeout 30 \
    --max-response-time 30 \
    --suppress-health-check all \
    --continue-on-failure \
    "$@"
