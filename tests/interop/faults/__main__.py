"""python -m faults TRIPLANAR FOLDER KILLS FILLS: a line for each check, "N passed, N failed"."""
import collections, glob, hashlib, os, random, subprocess, sys, threading, time

from .service import Series, Service, data_set, wait_for

triplanar, folder, kills, fills = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
passed = failed = 0


def check(name, ok, seen=''):
    """`seen` says more of a failure."""
    global passed, failed
    passed, failed = passed + bool(ok), failed + (not ok)
    print(f'ok      {name}' if ok else f'FAILED  {name}: {str(seen)[:600]}', flush=True)


class Disk:
    """A small file system; `filler` is somebody else's file on it."""
    path = folder + '/disk'

    def __init__(self, megabytes):
        os.makedirs(self.path, exist_ok=True)
        subprocess.run(['mount', '-t', 'tmpfs', '-o', f'size={megabytes}m', 'tmpfs', self.path], check=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        subprocess.run(['umount', '-l', self.path], check=True)

    def free(self):
        disk = os.statvfs(self.path)
        return disk.f_bavail * disk.f_frsize

    def fill(self, leave=0):
        with open(self.path + '/filler', 'ab', buffering=0) as filler:
            try:
                while self.free() > leave:
                    filler.write(bytes(min(65536, max(4096, self.free() - leave))))
            except OSError:
                pass

    def empty(self):
        os.remove(self.path + '/filler')


def lost(service, acknowledged):
    """Acknowledged instances that are not there with the bytes that were sent."""
    stored = service.stored()
    def is_there(uid, sha):
        try:
            return stored[uid][1] == sha and hashlib.sha256(data_set(open(stored[uid][0], 'rb').read())).hexdigest() == sha
        except (KeyError, OSError):
            return False
    return [uid for uid, sha in acknowledged.items() if not is_there(uid, sha)]


def settled(service, seconds=120):
    final = ('succeeded', 'failed', 'cancelled', 'superseded')
    def rows():
        found = service.reconstructions()
        return found if found and all(row['state'] in final for row in found) else None
    return wait_for(rows, seconds, 0.3)


def full_catalog():
    with Disk(80) as disk:
        service = Service(triplanar, disk.path + '/data').start()
        check('before: a series is taken', set(service.push(Series('before'))) == {0})
        disk.fill()
        codes = [service.expect(number) for number in range(60)]
        check('a full disk is told', codes[-1] == 507, codes[-1])
        time.sleep(5.5)
        check('readyz is 503 while nothing can be written', service.status('/readyz') == 503)
        disk.empty()
        check('room again: a PUT goes through at once', service.expect(99) == 200 or service.expect(99) == 204)
        check('and C-STORE', set(service.push(Series('after'))) == {0})
        check('and an upload', service.upload(Series('upload')) in (200, 202))
        check('readyz is 200 again', wait_for(lambda: service.status('/readyz') == 200, 12))
        service.stop()


def uploads_fill():
    mark = 20 << 20
    with Disk(80) as disk:
        service = Service(triplanar, disk.path + '/data', STORAGE__MIN_FREE_BYTES=mark).start()
        service.push(Series('before'))
        stop, codes, uploads, low = [], collections.Counter(), collections.Counter(), [disk.free()]
        def expect():
            number = 0
            while not stop:
                number += 1
                codes[service.expect(number)] += 1
                low[0] = min(low[0], disk.free())
        def upload():
            while not stop:
                try:
                    uploads[service.request('POST', '/v1/series', b'PK\3\4' + bytes(100 << 20), 'application/zip')[0]] += 1
                except OSError as error:
                    uploads[type(error).__name__] += 1
        threads = [threading.Thread(target=expect)] + [threading.Thread(target=upload) for _ in range(3)]
        [thread.start() for thread in threads]
        time.sleep(8)
        stop.append(1)
        [thread.join() for thread in threads]
        check('uploads stop at the watermark', low[0] > mark - (4 << 20), f'lowest {low[0]} of {mark}, {dict(uploads)}')
        check('they are told', uploads[507] > 0, dict(uploads))
        check('the catalog is written all the while', set(codes) <= {200, 204}, dict(codes))
        check('the service takes series as before', wait_for(lambda: set(service.push(Series('after'))) == {0}, 10))
        service.stop()


def job_full():
    with Disk(60) as disk:
        service = Service(triplanar, disk.path + '/data').start()
        [service.expect(number) for number in range(400)]
        service.push(Series('job'))
        disk.fill()
        time.sleep(15)
        rows = service.reconstructions()
        check('a full disk costs a job no attempt', not rows or rows[0]['state'] in ('queued', 'running'), rows)
        disk.empty()
        rows = settled(service, 90)
        check('with room it succeeds', rows and [row['state'] for row in rows] == ['succeeded'], rows)
        check('and no attempt was counted for the full disk', rows and rows[0]['attempts'] == 1, rows)
        service.stop()


def clock():
    library = next(iter(glob.glob('/usr/lib/*/faketime/libfaketime.so.1')), None)
    if not library:
        print('skipped: the clock: no libfaketime (Debian package faketime)')
        return
    offset = folder + '/offset'
    open(offset, 'w').write('+0')
    environment = {'LD_PRELOAD': library, 'FAKETIME_TIMESTAMP_FILE': offset, 'FAKETIME_NO_CACHE': '1',
                   'DONT_FAKE_MONOTONIC': '1'}
    service = Service(triplanar, folder + '/clock', environment, INTAKE__QUIET_AFTER_ASSOCIATION=2, INTAKE__QUIET=30).start()
    service.push(Series('clock'))
    open(offset, 'w').write('-3600')
    check('a series is complete although the clock was set back by an hour', settled(service, 45))
    service.stop()


class Load:
    """Three senders and two uploads, until `end`. What broke off was sent in part, and not answered."""

    def __init__(self, service, tag):
        self.service, self.tag = service, tag
        self.acknowledged, self.whole = {}, set()
        self.cut, self.instances, self.uploads = [], 0, 0
        self.refused = collections.Counter()
        self.number, self.ended, self.threads = 0, True, []

    def begin(self):
        self.ended = False
        again, self.cut = self.cut, []
        lanes = [self.send] * 3 + [self.upload] * 2
        self.threads = [threading.Thread(target=self.lane, args=(lane, again[number::len(lanes)]))
                        for number, lane in enumerate(lanes)]
        [thread.start() for thread in self.threads]

    def end(self):
        self.ended = True

    def join(self):
        [thread.join() for thread in self.threads]

    def lane(self, send, again):
        """First what was cut, as a sender tries it again."""
        while not self.ended:
            self.number += 1
            send(again.pop() if again else Series(f'{self.tag} {self.number}'))
            time.sleep(random.uniform(0, 0.5))
        self.cut += again

    def send(self, series):
        answers = self.service.push(series, self.acknowledged, pause=lambda: time.sleep(random.uniform(0, 0.1)))
        self.refused.update(answer for answer in answers if isinstance(answer, int) and answer)
        if answers == [0] * len(series.files):
            self.whole.add(series.uid)
        else:
            self.cut.append(series)
            self.instances += answers[-1] == 'unanswered'

    def upload(self, series):
        def body():
            content = series.zip()
            for place in range(0, len(content), 16384):
                begun.append(place)
                yield content[place:place + 16384]
                time.sleep(random.uniform(0, 0.1))
        begun = []
        try:
            status = self.service.upload(series, body())
            if status == 202:
                self.whole.add(series.uid)
                self.acknowledged.update((uid, hashlib.sha256(data_set(file)).hexdigest()) for uid, file in series.files)
                return
            self.refused[status] += 1
        except Exception:  # The service was killed, or answered before the body was whole.
            self.uploads += bool(begun)
        self.cut.append(series)


def one_each(service, load, name):
    rows = settled(service, 1800) or []
    check(f'{name}: every job ended, {len(rows)} of them', rows)
    count = collections.Counter(row['series_instance_uid'] for row in rows if row['instances'] == 12)
    check(f'{name}: {len(load.whole)} series are whole, one reconstruction each of the twelve instances',
          load.whole and all(count[uid] == 1 for uid in load.whole), {uid: count[uid] for uid in load.whole if count[uid] != 1})
    ends = collections.Counter(row['state'] for row in rows if row['series_instance_uid'] in load.whole and row['instances'] == 12)
    check(f'{name}: all of them succeeded', set(ends) == {'succeeded'}, dict(ends))
    attempts = max((row['attempts'] for row in rows), default=0)
    print(f'        {load.instances} instances unanswered, {load.uploads} uploads open as it happened; '
          f'refused: {dict(load.refused)}; most attempts of a job: {attempts}')


def kill():
    random.seed(1)
    service = Service(triplanar, folder + '/kill', INTAKE__QUIET=5, JOBS__MAX_ATTEMPTS=100, JOBS__RETRY_BACKOFF=0.1).start()
    load, gone, jobs, rounds = Load(service, 'kill'), [], 0, collections.Counter()
    for _ in range(kills):
        before = load.instances, load.uploads
        load.begin()
        time.sleep(random.uniform(0.1, 1.2))
        service.kill()
        load.end()
        load.join()
        running = service.running()
        jobs += running
        rounds.update(kind for kind, hit in (('instances', load.instances > before[0]), ('uploads', load.uploads > before[1]),
                                             ('jobs', running)) if hit)
        service.start()
        gone += lost(service, load.acknowledged)
    print(f'        kills that hit an instance in flight: {rounds["instances"]}, an open upload: {rounds["uploads"]}, '
          f'a running job: {rounds["jobs"]} ({jobs} jobs), of {kills}')
    check('kill -9 hit instances, uploads and jobs in flight', min(load.instances, load.uploads, jobs) > 0)
    check(f'kill -9, {kills} rounds: {len(load.acknowledged)} acknowledged instances, none lost', not gone, gone[:3])
    for series in load.cut:
        service.push(series, load.acknowledged)
        load.whole.add(series.uid)
    check('what was cut is taken when it is sent again', not lost(service, load.acknowledged))
    one_each(service, load, 'kill -9')
    service.stop()
    answer = subprocess.run([triplanar, 'check', '--data-dir', service.data], capture_output=True, text=True)
    check('triplanar check finds nothing damaged', answer.returncode == 0, answer.stdout[-300:] + answer.stderr[-300:])


def fill():
    random.seed(2)
    with Disk(800) as disk:
        service = Service(triplanar, disk.path + '/data', INTAKE__QUIET=5).start()
        load, rounds, jobs = Load(service, 'fill'), 0, 0
        load.begin()
        for _ in range(fills):
            time.sleep(0.5)
            jobs += service.running()
            before = sum(load.refused.values()) + load.uploads
            disk.fill()
            time.sleep(1)
            rounds += sum(load.refused.values()) + load.uploads > before
            disk.empty()
        time.sleep(1)
        load.end()
        load.join()
        print(f'        fills that refused something in flight: {rounds} of {fills}; jobs that ran then: {jobs}')
        check('a full disk refused what was in flight', rounds > 0, dict(load.refused))
        gone = lost(service, load.acknowledged)
        check(f'the disk filled and freed {fills} times: {len(load.acknowledged)} acknowledged instances, none lost',
              not gone, gone[:3])
        check('it takes a series afterwards, without a restart', set(service.push(Series('last'))) == {0})
        for series in load.cut:
            service.push(series, load.acknowledged)
            load.whole.add(series.uid)
        one_each(service, load, 'full disk')
        check('the one process all the while', service.starts == 1 and service.process.poll() is None)
        service.stop()
        answer = subprocess.run([triplanar, 'check', '--data-dir', service.data], capture_output=True, text=True)
        check('triplanar check finds nothing damaged', answer.returncode == 0, answer.stdout[-300:] + answer.stderr[-300:])


Series.make(triplanar, folder + '/template')
root = os.geteuid() == 0
for part in (full_catalog, uploads_fill, job_full, fill) if root else ():
    part()
if not root:
    print('skipped: full disks: only root may mount a small file system')
clock()
kill()
print(f'{passed} passed, {failed} failed', flush=True)
sys.exit(bool(failed))
