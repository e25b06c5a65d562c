"""The service as a process, a sender that speaks the DICOM upper layer itself, and small series."""
import glob, hashlib, http.client, io, json, os, re, signal, socket, sqlite3, struct, subprocess, time, zipfile

CT, LITTLE_ENDIAN = '1.2.840.10008.5.1.4.1.1.2', '1.2.840.10008.1.2.1'


def free_ports():
    sockets = [socket.socket() for _ in range(2)]
    for s in sockets:
        s.bind(('127.0.0.1', 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


class Service:
    def __init__(self, triplanar, data, environment=(), **settings):
        self.triplanar, self.data, self.log = triplanar, data, data.rstrip('/').replace('/', '_') + '.log'
        self.http, self.dimse = free_ports()
        given = {'STORAGE__MIN_FREE_BYTES': 0, 'INTAKE__QUIET_AFTER_ASSOCIATION': 0.3, 'INTAKE__QUIET': 2,
                 'JOBS__RETRY_BACKOFF': 0.5, **settings}
        self.environment = dict(os.environ, **dict(environment),
                                **{f'TRIPLANAR_{name}': str(value) for name, value in given.items()})
        self.process, self.starts = None, 0

    def start(self):
        self.starts += 1
        log = open(self.log, 'a')
        self.process = subprocess.Popen(
            [self.triplanar, 'serve', '--http-listen', f'127.0.0.1:{self.http}',
             '--dimse-listen', f'127.0.0.1:{self.dimse}', '--data-dir', self.data],
            stdout=log, stderr=log, env=self.environment)
        wait_for(lambda: self.process.poll() is not None or self.status('/healthz') == 200, 60)
        if self.process.poll() is not None:
            raise RuntimeError(f'it does not start: {open(self.log).read()[-600:]}')
        return self

    def kill(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self):
        if self.process and self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(40)
            except subprocess.TimeoutExpired:
                self.kill()

    def request(self, method, path, body=None, kind=None, timeout=60):
        connection = http.client.HTTPConnection('127.0.0.1', self.http, timeout=timeout)
        try:
            connection.request(method, path, body, {'content-type': kind} if kind else {})
            answer = connection.getresponse()
            return answer.status, answer.read()
        finally:
            connection.close()

    def status(self, path):
        try:
            return self.request('GET', path, timeout=10)[0]
        except (OSError, http.client.HTTPException):
            return None

    def expect(self, number):
        return self.request('PUT', f'/v1/series/1.2.{number}/expected-instances', '{"instances":3}',
                            'application/json')[0]

    def upload(self, series, body=None):
        """`body` gives the zip in parts."""
        return self.request('POST', '/v1/series', body or series.zip(), 'application/zip')[0]

    def reconstructions(self):
        rows, path = [], '/v1/reconstructions?limit=200'
        while path:
            page = json.loads(self.request('GET', path)[1])
            rows += page['items']
            path = page.get('next_cursor') and f'/v1/reconstructions?limit=200&cursor={page["next_cursor"]}'
        return rows

    def push(self, series, acknowledged=None, pause=None):
        """Statuses of all instances; last of them "unanswered" if the association broke within one,
        or what broke it. `pause` is called before the last part of each."""
        statuses, sent = [], False
        try:
            sender = Sender(self.dimse)
            for uid, file in series.files:
                sent = True
                statuses.append(sender.store(uid, data_set(file), pause))
                sent = False
                if statuses[-1] == 0 and acknowledged is not None:
                    acknowledged[uid] = hashlib.sha256(data_set(file)).hexdigest()
        except (OSError, EOFError, ConnectionError) as error:
            statuses.append('unanswered' if sent else repr(error))
            return statuses
        try:
            sender.release()
        except (OSError, EOFError):
            pass
        return statuses

    def running(self):
        """How many jobs the catalog says are at work."""
        catalog = sqlite3.connect(f'file:{self.data}/catalog.sqlite?mode=ro', uri=True)
        try:
            return catalog.execute("select count(*) from reconstructions where state = 'running'").fetchone()[0]
        finally:
            catalog.close()

    def stored(self):
        catalog = sqlite3.connect(f'file:{self.data}/catalog.sqlite?mode=ro', uri=True)
        try:
            return {uid: (self.data + '/' + blob, sha.hex()) for uid, blob, sha in
                    catalog.execute('select sop_uid, blob, data_set_sha256 from instances')}
        finally:
            catalog.close()


def wait_for(condition, seconds, step=0.05):
    end = time.time() + seconds
    while time.time() < end:
        try:
            found = condition()
            if found:
                return found
        except (OSError, http.client.HTTPException, ValueError):
            pass
        time.sleep(step)
    return None


def data_set(file):
    return file[144 + struct.unpack('<I', file[140:144])[0]:]


class Series:
    """A phantom under UIDs of its own: each UID is exchanged for one of the same length."""
    template = None

    def __init__(self, tag):
        def other(match):
            uid = match[0]
            digits = str(int(hashlib.sha512(tag.encode() + uid).hexdigest(), 16))
            return b'2.25.1' + digits[:len(uid) - 6].encode()
        self.files = []
        for file in Series.template:
            file = re.sub(rb'2\.25\.\d{10,}', other, file[:6000]) + file[6000:]
            uid = re.search(rb'\x08\x00\x18\x00UI..([0-9.]+)', file, re.S)[1].decode()
            self.files.append((uid, file))
        self.uid = re.search(rb'\x20\x00\x0e\x00UI..([0-9.]+)', file, re.S)[1].decode()

    def zip(self):
        out = io.BytesIO()
        with zipfile.ZipFile(out, 'w', zipfile.ZIP_STORED) as archive:
            for uid, file in self.files:
                archive.writestr(uid + '.dcm', file)
        return out.getvalue()

    @classmethod
    def make(cls, triplanar, folder):
        subprocess.run([triplanar, 'phantom', folder, '--matrix', '64', '--slices', '12', '--pixel', '3.6', '--step', '14'],
                       check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        cls.template = [open(path, 'rb').read() for path in sorted(glob.glob(folder + '/*'))]


class Sender:
    """An SCU of one context (PS3.8 9.3)."""

    def __init__(self, port):
        self.socket = socket.create_connection(('127.0.0.1', port), 60)
        item = lambda kind, body: struct.pack('>BBH', kind, 0, len(body)) + body
        context = bytes([1, 0, 0, 0]) + item(0x30, CT.encode()) + item(0x40, LITTLE_ENDIAN.encode())
        body = struct.pack('>HH', 1, 0) + b'TRIPLANAR'.ljust(16) + b'FAULTS'.ljust(16) + bytes(32)
        body += item(0x10, b'1.2.840.10008.3.1.1.1') + item(0x20, context)
        body += item(0x50, item(0x51, struct.pack('>I', 262144)) + item(0x52, b'1.2.3.4'))
        self.send(1, body)
        if self.receive()[0] != 2:
            raise ConnectionError('the association was refused')
        self.message = 0

    def send(self, kind, body):
        self.socket.sendall(struct.pack('>BBI', kind, 0, len(body)) + body)

    def receive(self):
        def exactly(count):
            data = b''
            while len(data) < count:
                more = self.socket.recv(count - len(data))
                if not more:
                    raise EOFError('closed')
                data += more
            return data
        head = exactly(6)
        return head[0], exactly(struct.unpack('>I', head[2:])[0])

    def store(self, uid, content, pause=None):
        self.message += 1
        even = lambda text: text.encode() + b'\0' * (len(text) % 2)
        element = lambda number, value: struct.pack('<HHI', 0, number, len(value)) + value
        short = lambda value: struct.pack('<H', value)
        command = element(2, even(CT)) + element(0x100, short(1)) + element(0x110, short(self.message))
        command += element(0x700, short(0)) + element(0x800, short(0)) + element(0x1000, even(uid))
        command = element(0, struct.pack('<I', len(command))) + command
        pdv = lambda flags, data: struct.pack('>IBB', len(data) + 2, 1, flags) + data
        self.send(4, pdv(3, command))
        if pause:
            self.send(4, pdv(0, content[:2048]))
            content = content[2048:]
            pause()
        self.send(4, pdv(2, content))
        kind, body = self.receive()
        if kind != 4:
            raise ConnectionError(f'PDU {kind}')
        place = 6
        while place < len(body):
            _, number, length = struct.unpack('<HHI', body[place:place + 8])
            if number == 0x900:
                return struct.unpack('<H', body[place + 8:place + 10])[0]
            place += 8 + length
        raise ConnectionError('no status')

    def release(self):
        self.send(5, bytes(4))
        self.receive()
        self.socket.close()
