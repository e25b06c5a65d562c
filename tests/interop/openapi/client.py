"""Every operation of a running service but STOW and the events, by the client that openapi-python-client
generates from api/openapi.json (the package `generated`, on the path):

    client.py URL TOKEN PHANTOM_DIR

An answer must have a documented status, and must read back as what was sent: the generated classes give
the same JSON. An operation of the description that is not called here is a failure.
"""
import datetime
import importlib
import io
import json
import pathlib
import pkgutil
import sys
import time
import uuid
import zipfile

import generated.api
from generated.client import AuthenticatedClient
from generated.models.chosen_reconstruction import ChosenReconstruction
from generated.models.expected_instances import ExpectedInstances
from generated.models.parameters import Parameters
from generated.models.upload_form import UploadForm
from generated.types import File

# dicomweb-client does STOW (peers/dicomweb.py); the client can't read server-sent events.
LEFT_OUT = {"store_instances", "store_instances_of_study", "watch_reconstruction"}

url, token, folder = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
client = AuthenticatedClient(base_url=url, token=token, timeout=60)
operations = {}
for group in pkgutil.iter_modules(generated.api.__path__, "generated.api."):
    package = importlib.import_module(group.name)
    for module in pkgutil.iter_modules(package.__path__, group.name + "."):
        operations[module.name.rsplit(".", 1)[1]] = importlib.import_module(module.name)
called = set()
passed = failed = 0


def check(what, ok):
    global passed, failed
    passed, failed = passed + bool(ok), failed + (not ok)
    print(f"{'ok' if ok else 'FAILED'}: {what}", flush=True)


def plain(value):
    """JSON, or a parsed answer as JSON; times as times, for they can be written in several ways."""
    if hasattr(value, "to_dict"):
        value = value.to_dict()
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    if isinstance(value, str) and value[4:5] == "-" and value[10:11] == "T":
        return datetime.datetime.fromisoformat(value)
    return value


def difference(a, b, at=""):
    """Where two JSON values differ first."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in {**a, **b}:
            if found := difference(a.get(key, "absent"), b.get(key, "absent"), f"{at}.{key}"):
                return found
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for index, pair in enumerate(zip(a, b)):
            if found := difference(*pair, f"{at}[{index}]"):
                return found
    elif a != b:
        return f"{at}: {a!r} is read of {b!r}"


def call(operation, *args, status=200, **kwargs):
    called.add(operation)
    answer = operations[operation].sync_detailed(*args, client=client, **kwargs)
    check(f"{operation} {[str(a)[-12:] for a in args]} answers {status}", answer.status_code == status)
    if answer.headers.get("content-type", "").endswith("json"):
        wrong = difference(plain(answer.parsed), plain(json.loads(answer.content)))
        check(f"{operation}: the answer is what the description says{wrong or ''}", not wrong)
    return answer


def zipped():
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for path in sorted(folder.iterdir()):
            archive.write(path, path.name)
    return buffer.getvalue()


def enum(module, name):
    """A value of a parameter's class: `GetCloudFormat` of `get_cloud`."""
    found = [value for key, value in vars(operations[module]).items() if key.lower().endswith(name)]
    return found[0]


check("the client has no operation that is not in the description", operations)
call("health")
call("readiness")
call("openapi")

form = UploadForm(files=[File(payload=io.BytesIO(zipped()), file_name="series.zip", mime_type="application/zip")])
uploaded = call("upload_series", body=form, status=202).parsed
series = uploaded.series[0].series.series_instance_uid
call("list_series")
call("get_series", series)
call("expect_instances", series, body=ExpectedInstances(instances=len(list(folder.iterdir()))))
call("complete_series", series, status=202)

for _ in range(600):
    rows = operations["list_reconstructions"].sync(client=client, series=series)
    if rows.items and rows.items[0].state.value not in ("queued", "running"):
        break
    time.sleep(0.2)
call("list_reconstructions", series=series)
row = rows.items[0]
check("the reconstruction succeeded", row.state.value == "succeeded")
call("get_reconstruction", row.id)
call("get_report", row.id)
call("get_latest_report", series)
for operation, of in (("get_cloud", row.id), ("get_latest_cloud", series)):
    sizes = {}
    for form in enum(operation, "format"):
        answer = call(operation, of, format_=form, frame=enum(operation, "frame")("ras"))
        sizes[form.value] = len(answer.content)
    check(f"{operation}: a cloud in every format", min(sizes.values()) > 1000 and sizes["ply"] == sizes["ply_binary"])
    problem = call(operation, of, max_error_mm=0.000001, status=422).parsed
    check(f"{operation}: an empty cloud is a problem", problem.type_ == "urn:triplanar:problem:empty-cloud")
picture = call("get_slice_picture", row.id, enum("get_slice_picture", "plane")("axial"), "60.png")
check("a slice's picture is a PNG", picture.content.startswith(b"\x89PNG"))
call("start_reconstruction", series, status=202)
other = call("start_reconstruction", series, body=Parameters.from_dict({"leaf_mm": 2.0}), status=202).parsed
check("other parameters are another reconstruction", other.id != row.id)
chosen = call("choose_clinical_reconstruction", series, body=ChosenReconstruction(id=row.id)).parsed
check("the chosen reconstruction is the clinical one", chosen.chosen and chosen.reconstruction == row.id)
call("get_reconstruction", uuid.uuid4(), status=404)
check("metrics are text", b"triplanar_" in call("metrics").content)
removed = operations["remove_reconstruction"].sync_detailed(row.id, client=client)
called.add("remove_reconstruction")
check("remove_reconstruction answers 202 or 204", removed.status_code in (202, 204))
call("delete_series", series, status=204)

missing = set(operations) - called - LEFT_OUT
check(f"every operation was called{': ' + ', '.join(sorted(missing)) if missing else ''}", not missing)
print(f"{passed} passed, {failed} failed")
sys.exit(failed > 0)
