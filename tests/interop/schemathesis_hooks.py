"""What schemathesis can't know by itself of our API: how a multipart/related body is written, and
which series and reconstructions there are."""

import os
import random

import requests
import schemathesis

BASE = os.environ["TRIPLANAR_BASE"]
HEADERS = {"Authorization": "Bearer " + os.environ["TRIPLANAR_TOKEN"]}


@schemathesis.serializer("multipart/related")
def multipart_related(ctx, value):
    """One part; what it holds is the fuzzer's business."""
    part = value if isinstance(value, bytes) else str(value).encode()
    return b"--fuzz\r\nContent-Type: application/dicom\r\n\r\n" + part + b"\r\n--fuzz--\r\n"


def first(path, key):
    items = requests.get(BASE + path, headers=HEADERS, timeout=30).json()["items"]
    return [item[key] for item in items[:20]]


KNOWN = {"series": first("/v1/series", "series_instance_uid"), "id": first("/v1/reconstructions", "id")}


@schemathesis.hook
def map_path_parameters(context, path_parameters):
    """Half of the made-up ids become ones that exist; what is removed stays made up."""
    operation = context.operation
    if path_parameters and (operation is None or operation.method.upper() != "DELETE"):
        for name, known in KNOWN.items():
            if name in path_parameters and known and random.random() < 0.5:
                path_parameters[name] = random.choice(known)
    return path_parameters
