"""What the service takes of memory, and how soon it stops: slow readers of a big cloud beside uploads of
series that are left incomplete, deflated slices that inflate a thousandfold, cancelling a job in each
stage. Python's standard library alone. usage: bounds.py TRIPLANAR DIR short|full [readers|inflation|cancelling …]"""
import glob, http.client, io, json, os, socket, struct, subprocess, sys, threading, time, zipfile, zlib

BINARY, DIR, FULL = sys.argv[1], sys.argv[2], sys.argv[3] == "full"
passed = failed = 0


def expect(name, holds, figure):
    global passed, failed
    passed, failed = passed + bool(holds), failed + (not holds)
    print(f"{'ok    ' if holds else 'FAILED'} {name}: {figure}", flush=True)


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Service:
    def __init__(self, name, config=""):
        self.port, dimse = free_port(), free_port()
        base = os.path.join(DIR, name)
        os.makedirs(base)
        with open(base + "/config.toml", "w") as f:
            f.write(config)
        self.log = open(base + "/log", "w")
        self.process = subprocess.Popen(
            [BINARY, "serve", "--config", base + "/config.toml", "--data-dir", base + "/data", "--http-listen",
             f"127.0.0.1:{self.port}", "--dimse-listen", f"127.0.0.1:{dimse}"], stdout=self.log, stderr=self.log)
        wait(lambda: self.get("/readyz")[0] == 200, 60, "the service is ready")

    def request(self, method, path, body=None, headers=None, timeout=300):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
        try:
            connection.request(method, path, body, headers or {})
            response = connection.getresponse()
            return response.status, response.read()
        finally:
            connection.close()

    def get(self, path):
        return self.request("GET", path)

    def json(self, path):
        return json.loads(self.get(path)[1])

    def rss(self):
        with open(f"/proc/{self.process.pid}/status") as f:
            return next(int(line.split()[1]) for line in f if line.startswith("VmRSS")) / 1024

    def upload(self, body):
        return self.request("POST", "/v1/series", body, {"content-type": "application/zip"})

    def ended(self, seconds=600):
        def all_final():
            items = self.json("/v1/reconstructions")["items"]
            return items if items and all(i["state"] not in ("queued", "running") for i in items) else None
        return wait(all_final, seconds, "the jobs end")

    def stop(self):
        self.process.terminate()
        try:
            self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
        self.log.close()


def wait(condition, seconds, what):
    end = time.time() + seconds
    while time.time() < end:
        try:
            found = condition()
            if found:
                return found
        except OSError:
            pass
        time.sleep(0.05)
    raise SystemExit(f"FAILED: waited {seconds} s in vain: {what}\n{passed} passed, {failed + 1} failed")


def phantom(name, *args):
    folder = os.path.join(DIR, "series-" + name)
    subprocess.run([BINARY, "phantom", folder, *map(str, args)], check=True, stdout=subprocess.DEVNULL)
    return [open(f, "rb").read() for f in sorted(glob.glob(folder + "/*"))]


def zipped(files):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for i, data in enumerate(files):
            archive.writestr(f"{i}.dcm", data)
    return out.getvalue()


class Peak:
    """The service's largest resident memory while this is open, MB."""
    def __init__(self, service):
        self.service, self.mb, self.over = service, 0, False

    def __enter__(self):
        self.thread = threading.Thread(target=self.watch)
        self.thread.start()
        return self

    def watch(self):
        while not self.over:
            try:
                self.mb = max(self.mb, self.service.rss())
            except (OSError, StopIteration):
                return
            time.sleep(0.02)

    def __exit__(self, *_):
        self.over = True
        self.thread.join()


def readers_and_incomplete_uploads():
    """Readers that take nothing of a cloud of some 20 MB, each in another form, while uploads come that
    stop in mid-body."""
    readers, uploads = (120, 20) if FULL else (60, 6)
    files = phantom("head") if FULL else phantom("head", "--matrix", 256, "--pixel", 0.9)
    service = Service("readers", '[intake]\nquiet_after_association = 0.2\n[http]\nmax_uploads = 32\n')
    service.upload(zipped(files))
    series = service.json("/v1/series")["items"][0]
    uid = series.get("series_instance_uid") or series["uid"]
    service.ended()
    service.request("POST", f"/v1/series/{uid}/reconstructions", json.dumps({"leaf_mm": 0.08}),
                    {"content-type": "application/json"})
    fine = [i for i in service.ended() if abs(i["parameters"]["leaf_mm"] - 0.08) < 1e-6][0]
    cloud = fine["links"]["cloud"]
    size = len(service.get(cloud + "?format=ply_ascii")[1]) / 1e6
    # Idle: a service of the same data that has done nothing since its start.
    service.process.terminate()
    service.process.wait(30)
    name = os.path.join(DIR, "readers")
    service.process = subprocess.Popen(
        [BINARY, "serve", "--config", name + "/config.toml", "--data-dir", name + "/data", "--http-listen",
         f"127.0.0.1:{service.port}", "--dimse-listen", f"127.0.0.1:{free_port()}"],
        stdout=service.log, stderr=service.log)
    wait(lambda: service.get("/readyz")[0] == 200, 60, "the service is ready again")
    time.sleep(1)
    idle, sockets = service.rss(), []
    forms = ["format=ply_ascii", "", "format=pcd&frame=ras", "format=ply_ascii&frame=ras&max_error_mm=900"]
    other = phantom("other", "--seed", 7, "--matrix", 256, "--pixel", 0.9)
    body = zipped(other[:len(other) // 2])
    with Peak(service) as peak:
        for i in range(readers):
            s = socket.socket()
            s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            s.connect(("127.0.0.1", service.port))
            coding = "Accept-Encoding: gzip\r\n" if i % 5 == 4 else ""
            s.sendall(f"GET {cloud}?{forms[i % 4]} HTTP/1.1\r\nHost: 127.0.0.1\r\n{coding}\r\n".encode())
            sockets.append(s)
        for _ in range(uploads):
            s = socket.create_connection(("127.0.0.1", service.port))
            s.sendall(f"POST /v1/series HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/zip\r\n"
                      f"Content-Length: {len(body) + 1000}\r\n\r\n".encode())
            s.settimeout(20)
            try:
                s.sendall(body)
            except OSError:
                pass
            sockets.append(s)
        end = time.time() + 12
        while time.time() < end:
            for s in sockets[:readers]:
                s.setblocking(False)
                try:
                    s.recv(4000)
                except OSError:
                    pass
            time.sleep(1)
    expect(f"{readers} readers of a {size:.1f} MB cloud and {uploads} uploads left incomplete, at once",
           peak.mb - idle <= 300, f"resident {idle:.0f} -> {peak.mb:.0f} MB (+{peak.mb - idle:.0f}, limit 300)")
    expect("health probe meanwhile", service.get("/healthz")[0] == 200, "200")
    for s in sockets:
        s.close()
    service.stop()


def deflated(files, extra):
    """The slices in Deflated Explicit VR Little Endian, each with `extra` zeros in a private element."""
    out = []
    for file in files:
        length = struct.unpack("<I", file[140:144])[0]
        meta, data = file[144:144 + length], file[144 + length:]
        at = data.rindex(b"\xe0\x7f\x10\x00OW")
        pack = zlib.compressobj(9, zlib.DEFLATED, -15)
        head = data[:at] + struct.pack("<HH2sHI", 0x6001, 0x1010, b"OB", 0, extra)
        body = [pack.compress(head)]
        for _ in range(extra >> 20):
            body.append(pack.compress(bytes(1 << 20)))
        body += [pack.compress(data[at:]), pack.flush()]
        old, new = b"1.2.840.10008.1.2.1\x00", b"1.2.840.10008.1.2.1.99"
        old = struct.pack("<HH2sH", 2, 0x10, b"UI", len(old)) + old
        assert old in meta, "the phantom is explicit little endian"
        meta = meta.replace(old, struct.pack("<HH2sH", 2, 0x10, b"UI", len(new)) + new)
        out.append(file[:140] + struct.pack("<I", len(meta)) + meta + b"".join(body))
    return out


def inflation():
    """12 slices that inflate to 300 MB each on 6 threads, with a budget of 512 MiB."""
    files = phantom("small", "--matrix", 64, "--slices", 12, "--pixel", 3.6, "--step", 14)
    service = Service("inflation", "[intake]\nquiet_after_association = 0.2\n[jobs]\nthreads = 6\nmax_attempts = 1\n"
                      "[memory]\nbudget_bytes = 536870912\n")
    with Peak(service) as peak:
        service.upload(zipped(deflated(files, 300 << 20)))
        items = service.ended()
    codes = [(i["error"] or {}).get("code") for i in items]
    expect("12 deflated slices of 300 MB on 6 threads, budget 512 MiB", peak.mb <= 800, f"peak {peak.mb:.0f} MB")
    wrong = {"out_of_memory_budget", "too_large_for_memory", "internal", "worker_died"} & set(codes)
    expect("they are read one after the other", not wrong, f"{[i['state'] for i in items]} {codes}")
    service.stop()


def cancelling():
    """How long a job runs on after it was told to stop, in each profile, at moments all over its run."""
    files = phantom("whole") if FULL else phantom("half", "--matrix", 384, "--pixel", 0.6)
    service = Service("cancelling", "[intake]\nquiet_after_association = 0.2\n")
    service.upload(zipped(files))
    series = service.json("/v1/series")["items"][0]
    uid = series.get("series_instance_uid") or series["uid"]
    service.ended()
    for profile, more in (("precise", {}), ("paper", {"radius_outlier": {"radius_mm": 100, "min_neighbours": 4000}})):
        slowest, stages = (0, None), set()
        for i in range(12 if FULL else 6):
            ask = {"profile": profile, "leaf_mm": round(0.3 + 0.01 * i, 3), **more}
            made = json.loads(service.request("POST", f"/v1/series/{uid}/reconstructions", json.dumps(ask),
                                              {"content-type": "application/json"})[1])
            path = "/v1/reconstructions/" + made["id"]
            wait(lambda: service.json(path)["state"] != "queued", 60, "it runs")
            time.sleep(0.15 + 0.3 * i)
            before = service.json(path)
            if before["state"] != "running":
                continue
            begun = time.time()
            service.request("DELETE", path)
            while service.json(path).get("state") == "running":
                time.sleep(0.005)
            slowest = max(slowest, (time.time() - begun, before["stage"]))
            stages.add(before["stage"])
        # Asking, the row and the poll are in it too.
        limit = 1.0
        expect(f"cancelled in {profile}", stages and slowest[0] <= limit,
               f"{len(stages)} stages, slowest {1000 * slowest[0]:.0f} ms in {slowest[1]} (limit {1000 * limit:.0f})")
    made = service.request("POST", f"/v1/series/{uid}/reconstructions",
                           json.dumps({"profile": "paper", "radius_outlier": {"radius_mm": 1000, "min_neighbours": 1}}),
                           {"content-type": "application/json"})
    expect("a radius of 1000 mm is refused with its limit", made[0] in (400, 422) and b"100 mm" in made[1], made[0])
    service.stop()


PARTS = {"readers": readers_and_incomplete_uploads, "inflation": inflation, "cancelling": cancelling}
for part in sys.argv[4:] or PARTS:
    PARTS[part]()
print(f"{passed} passed, {failed} failed")
sys.exit(failed > 0)
