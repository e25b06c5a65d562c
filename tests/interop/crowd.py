#!/usr/bin/env python3
"""A crowd against a built binary: nobody locks others out.

    crowd.py TRIPLANAR [share]

All at once: 1 000 silent DICOM connections from 50 loopback addresses, 1 000 HTTP connections from 20
that drip a byte a second of a head, 8 uploads that drip a byte a second, 260 listeners of events. All
come again a second after they are closed. Meanwhile, from fresh addresses: an SCU stores 100 slices at no less
than half its quiet rate in the same run, /healthz answers within a second, an upload is taken. `share`
makes the crowd smaller (0.2: a fifth). Python's standard library alone; about a minute.
"""

import glob
import http.client
import io
import json
import multiprocessing
import os
import selectors
import signal
import socket
import sqlite3
import struct
import subprocess
import sys
import tempfile
import time
import zipfile

CT = "1.2.840.10008.5.1.4.1.1.2"
EXPLICIT = "1.2.840.10008.1.2.1"
HTTP, DIMSE = int(os.environ.get("CROWD_HTTP", 21680)), int(os.environ.get("CROWD_DIMSE", 21681))
passed = failed = 0


def check(ok, what):
    global passed, failed
    passed, failed = passed + bool(ok), failed + (not ok)
    print(f"{'ok' if ok else 'FAILED'}: {what}", flush=True)


# ---- DICOM, from PS3.7 and PS3.8


def item(kind, value):
    return struct.pack(">BBH", kind, 0, len(value)) + value


def associate_rq():
    body = struct.pack(">HH", 1, 0) + b"TRIPLANAR".ljust(16) + b"CROWD".ljust(16) + bytes(32)
    body += item(0x10, b"1.2.840.10008.3.1.1.1")
    body += item(0x20, bytes([1, 0, 0, 0]) + item(0x30, CT.encode()) + item(0x40, EXPLICIT.encode()))
    body += item(0x50, item(0x51, struct.pack(">I", 262144)) + item(0x52, b"1.2.3.4"))
    return struct.pack(">BBI", 1, 0, len(body)) + body


def pdata(flags, data):
    return struct.pack(">BBIIBB", 4, 0, len(data) + 6, len(data) + 2, 1, flags) + data


def element(number, value):
    value += b"\0" * (len(value) % 2)
    return struct.pack("<HHI", 0, number, len(value)) + value


def store_rq(instance, message):
    rest = element(2, CT.encode()) + element(0x100, b"\1\0") + element(0x110, struct.pack("<H", message))
    rest += element(0x700, bytes(2)) + element(0x800, bytes(2)) + element(0x1000, instance.encode())
    return element(0, struct.pack("<I", len(rest))) + rest


def receive(sock):
    def exactly(count):
        data = b""
        while len(data) < count:
            more = sock.recv(count - len(data))
            if not more:
                raise EOFError("the connection is closed")
            data += more
        return data

    kind, _, length = struct.unpack(">BBI", exactly(6))
    return kind, exactly(length)


def push(slices, source):
    """Stores the slices in one association; seconds, from the connection to the release."""
    begun = time.monotonic()
    sock = socket.create_connection(("127.0.0.1", DIMSE), 20, source_address=(source, 0))
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.sendall(associate_rq())
    kind, body = receive(sock)
    if kind != 2:
        raise ConnectionError(f"the association is not accepted: PDU {kind} {body[:4].hex()}")
    for number, (instance, _, data) in enumerate(slices, 1):
        sock.sendall(pdata(3, store_rq(instance, number)))
        for at in range(0, len(data), 120_000):
            chunk = data[at : at + 120_000]
            sock.sendall(pdata(2 if at + 120_000 >= len(data) else 0, chunk))
        kind, body = receive(sock)
        at = body.index(struct.pack("<HHI", 0, 0x900, 2)) + 8
        status = struct.unpack("<H", body[at : at + 2])[0]
        if kind != 4 or status:
            raise ConnectionError(f"slice {number} is refused: {status:04X}")
    sock.sendall(struct.pack(">BBII", 5, 0, 4, 0))
    receive(sock)
    sock.close()
    return time.monotonic() - begun


# ---- HTTP


def ask(method, path, body=None, headers=None, source="127.0.0.1", timeout=30):
    connection = http.client.HTTPConnection("127.0.0.1", HTTP, timeout=timeout, source_address=(source, 0))
    try:
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


# ---- the service and its series


class Service:
    def __init__(self, binary, folder):
        self.binary, self.folder = binary, folder
        self.log = open(os.path.join(folder, "log.txt"), "ab")

    def start(self):
        environment = {k: v for k, v in os.environ.items() if not k.startswith("TRIPLANAR_")}
        environment |= {
            "TRIPLANAR_STORAGE__MIN_FREE_BYTES": "1000000",
            "TRIPLANAR_LOG__FILTER": "warn",
            # What is pushed here is not reconstructed: the processor is the senders'.
            "TRIPLANAR_INTAKE__QUIET": "3600",
            "TRIPLANAR_INTAKE__QUIET_AFTER_ASSOCIATION": "3600",
        }
        arguments = ["--http-listen", f"127.0.0.1:{HTTP}", "--dimse-listen", f"127.0.0.1:{DIMSE}"]
        arguments += ["--data-dir", os.path.join(self.folder, "data")]
        self.process = subprocess.Popen(
            [self.binary, "serve", *arguments], stdout=subprocess.PIPE, stderr=self.log, env=environment
        )
        if b"ready" not in self.process.stdout.readline():
            raise RuntimeError(open(self.log.name).read()[-2000:])

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(60)

    def descriptors(self):
        return len(os.listdir(f"/proc/{self.process.pid}/fd"))


def phantom(binary, folder, *options):
    subprocess.run([binary, "phantom", folder, *options], check=True, stdout=subprocess.DEVNULL)
    slices = []
    for path in sorted(glob.glob(folder + "/**/*", recursive=True)):
        if not os.path.isfile(path):
            continue
        with open(path, "rb") as file:
            raw = file.read()
        if raw[128:132] != b"DICM":
            continue
        length = struct.unpack("<I", raw[140:144])[0]
        meta = raw[144 : 144 + length]
        # MediaStorageSOPInstanceUID (0002,0003), explicit VR.
        at = meta.index(b"\x02\x00\x03\x00UI") + 6
        uid = meta[at + 2 : at + 2 + struct.unpack("<H", meta[at : at + 2])[0]].rstrip(b"\0").decode()
        slices.append((uid, raw, raw[144 + length :]))
    return slices


def zipped(slices):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for uid, raw, _ in slices:
            archive.writestr(uid + ".dcm", raw)
    return out.getvalue()


def waiting_reconstruction(service, slices):
    """A reconstruction that stays in the queue, so that its listeners stay."""
    status, body = ask("POST", "/v1/series", zipped(slices), {"Content-Type": "application/zip"})
    assert status == 202, body
    identity = json.loads(body)["series"][0]["reconstruction"]["id"]
    service.stop()
    catalog = sqlite3.connect(os.path.join(service.folder, "data", "catalog.sqlite"))
    later = int((time.time() + 3600) * 1000)
    # It may have begun, and even ended, before the service stopped. A wait that is longer than it was
    # meant to be would count as that of a clock set back.
    catalog.execute(
        "UPDATE reconstructions SET state = 'queued', not_before_ms = ?, wait_ms = 3600000, worker = NULL,"
        " lease_until_ms = NULL",
        (later,),
    )
    catalog.commit()
    catalog.close()
    service.start()
    state = json.loads(ask("GET", f"/v1/reconstructions/{identity}")[1])["state"]
    check(state == "queued", f"the reconstruction to listen to waits ({state})")
    return identity


# ---- the crowd, a process of its own


def crowd(kinds, counts):
    """Keeps so many connections of each kind open, whatever the service does to them."""
    selector = selectors.DefaultSelector()
    open_now, made, closed = [0] * len(kinds), [0] * len(kinds), [0] * len(kinds)
    again = []  # when a connection that was closed comes again: a second later

    def connect(kind):
        name, port, sources, first, _ = kinds[kind]
        sock = socket.socket()
        try:
            sock.bind((sources[made[kind] % len(sources)], 0))
            made[kind] += 1
            sock.setblocking(False)
            sock.connect_ex(("127.0.0.1", port))
        except OSError:
            sock.close()
            return
        open_now[kind] += 1
        selector.register(sock, selectors.EVENT_READ, {"kind": kind, "first": first})

    last = time.monotonic()
    while True:
        for kind, wanted in enumerate(kinds):
            for _ in range(min(wanted[4] - open_now[kind], 100)):
                connect(kind)
        while again and again[0][0] <= time.monotonic():
            open_now[again.pop(0)[1]] -= 1
        for key, _ in selector.select(0.05):
            try:
                gone = not key.fileobj.recv(65536)
            except BlockingIOError:
                gone = False
            except OSError:
                gone = True
            if gone:
                selector.unregister(key.fileobj)
                key.fileobj.close()
                again.append((time.monotonic() + 1, key.data["kind"]))
                closed[key.data["kind"]] += 1
        if time.monotonic() - last > 1:
            last = time.monotonic()
            for key in list(selector.get_map().values()):
                name = kinds[key.data["kind"]][0]
                try:
                    if key.data["first"]:
                        sent = key.fileobj.send(key.data["first"])
                        key.data["first"] = key.data["first"][sent:]
                    elif name in ("heads", "uploads"):
                        key.fileobj.send(b"x")
                except OSError:
                    pass
            for kind in range(len(kinds)):
                counts[2 * kind], counts[2 * kind + 1] = open_now[kind], closed[kind]


def addresses(net, count):
    return [f"127.0.{net}.{1 + number}" for number in range(count)]


def main():
    binary = os.path.realpath(sys.argv[1])
    share = float(sys.argv[2]) if len(sys.argv) > 2 else 1.0
    with tempfile.TemporaryDirectory() as folder:
        slices = phantom(binary, folder + "/ct", "--matrix", "256", "--slices", "100", "--pixel", "0.9", "--step", "2")
        small = phantom(binary, folder + "/small", "--matrix", "64", "--slices", "12", "--pixel", "3.6", "--step", "14", "--seed", "7")
        other = phantom(binary, folder + "/other", "--matrix", "128", "--slices", "60", "--pixel", "1.8", "--step", "3", "--seed", "8")
        service = Service(binary, folder)
        service.start()
        try:
            run(service, slices, small, other, share)
        finally:
            service.process.kill()
    print(f"{passed} passed, {failed} failed")
    return 1 if failed else 0


def push_anew(slices, source):
    """Stores the slices; those of an earlier push are removed before."""
    status, body = ask("GET", "/v1/series", source=source)
    if status != 200:
        raise ConnectionError(f"the list is refused: {status}")
    for series in json.loads(body)["items"]:
        if series["state"] == "receiving":
            ask("DELETE", "/v1/series/" + series["series_instance_uid"], source=source)
    return push(slices, source)


def run(service, slices, small, other, share):
    identity = waiting_reconstruction(service, other)
    quiet = [push_anew(slices, "127.0.0.201") for _ in range(3)]
    print(f"quiet: {len(slices)} slices in {', '.join(f'{it:.2f}' for it in quiet)} s, {service.descriptors()} descriptors")

    def many(count):
        return max(1, round(count * share))

    listen = f"GET /v1/reconstructions/{identity}/events HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
    upload = b"POST /v1/series HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/zip\r\nContent-Length: 4000000000\r\n\r\nPK\x03\x04"
    kinds = [
        ("silent", DIMSE, addresses(1, 50), b"", many(1000)),
        ("heads", HTTP, addresses(2, 20), b"GET /v1/series HTTP/1.1\r\nHost: localhost\r\nX-Drip: ", many(1000)),
        ("uploads", HTTP, addresses(3, 2), upload, 8),
        ("listeners", HTTP, addresses(4, 5), listen, many(260)),
    ]
    counts = multiprocessing.Array("q", 2 * len(kinds))
    attackers = multiprocessing.Process(target=crowd, args=(kinds, counts), daemon=True)
    attackers.start()
    time.sleep(6)

    def told():
        return ", ".join(f"{counts[2 * k]} {kind[0]} ({counts[2 * k + 1]} closed)" for k, kind in enumerate(kinds))

    print(f"crowd: {told()}, {service.descriptors()} descriptors")
    crowded, refused, slowest, answers = [], [], 0.0, 0
    for round_ in range(3):
        try:
            crowded.append(push_anew(slices, "127.0.0.202"))
        except (OSError, EOFError) as error:
            refused.append(repr(error))
        for source in ("127.0.0.203", "127.0.2.1", "127.0.3.1", "127.0.4.1"):
            begun = time.monotonic()
            try:
                status, _ = ask("GET", "/healthz", source=source, timeout=10)
            except OSError as error:
                status = repr(error)
            took = time.monotonic() - begun
            slowest, answers = max(slowest, took), answers + (status == 200)
            if status != 200:
                print(f"   /healthz from {source}: {status}")
    rates = [len(slices) / min(quiet), len(slices) / min(crowded) if crowded else 0.0]
    check(not refused, f"an SCU from a fresh address is served in each of 3 rounds {refused}")
    check(rates[1] >= rates[0] / 2, f"{rates[1]:.1f} slices a second in the crowd, {rates[0]:.1f} without: {rates[1] / rates[0]:.2f}")
    check(answers == 12, f"/healthz is answered in {answers} of 12, from fresh and from crowded addresses")
    check(slowest <= 1, f"/healthz within a second: {slowest:.3f} s at most")
    try:
        status, body = ask("POST", "/v1/series", zipped(small), {"Content-Type": "application/zip"}, "127.0.0.204")
    except OSError as error:
        status, body = repr(error), b""
    check(status == 202, f"an upload from a fresh address is taken: {status} {body[:120] if status != 202 else ''}")
    status, _ = ask("GET", "/v1/series", source="127.0.0.205")
    check(status == 200, f"a list is answered to a fresh address: {status}")
    print(f"crowd: {told()}, {service.descriptors()} descriptors")
    check(service.process.poll() is None, "the service lives")
    attackers.terminate()
    attackers.join()
    time.sleep(3)
    after = min(push_anew(slices, "127.0.0.206") for _ in range(3))
    check(len(slices) / after >= rates[0] / 2, f"when they are gone: {len(slices) / after:.1f} slices a second")
    print(f"{service.descriptors()} descriptors")


if __name__ == "__main__":
    sys.exit(main())
