"""python -m faults TRIPLANAR FOLDER KILLS FILLS: a line for each check, "N passed, N failed"."""
import collections, glob, hashlib, os, random, subprocess, sys, threading, time

from .service import Series, Service, data_set, wait_for

triplanar, folder, kills, fills = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
passed = failed = 0


def check(name, ok, seen=''):
    global passed, failed
    passed, failed = passed + bool(ok), failed + (not ok)
    print(('ok      ' if ok else 'FAILED  ') + name + ('' if ok and not seen else f': {seen}'), flush=True)


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


def load(service, tag, stop, acknowledged, uploaded):
    """Senders and uploads, until `stop`."""
    def send(lane):
        for number in range(10_000):
            if stop:
                return
            service.push(Series(f'{tag} {lane} {number}'), acknowledged)
    def upload(lane):
        for number in range(10_000):
            if stop:
                return
            series = Series(f'{tag} u{lane} {number}')
            try:
                if service.upload(series) == 202:
                    uploaded.append(series.uid)
                    acknowledged.update((uid, hashlib.sha256(data_set(file)).hexdigest()) for uid, file in series.files)
            except Exception:  # The service was killed.
                time.sleep(0.02)
    threads = [threading.Thread(target=send, args=(lane,)) for lane in range(3)]
    threads += [threading.Thread(target=upload, args=(lane,)) for lane in range(2)]
    [thread.start() for thread in threads]
    return threads


def one_each(service, name):
    rows = settled(service, 600) or []
    whole = collections.Counter(row['series_instance_uid'] for row in rows if row['instances'] == 12)
    check(f'{name}: every job ended, {len(rows)} of them', rows)
    check(f'{name}: one reconstruction each of {len(whole)} whole series', whole and set(whole.values()) == {1},
          [uid for uid, count in whole.items() if count > 1][:3])


def kill():
    random.seed(1)
    service, acknowledged, uploaded = Service(triplanar, folder + '/kill', INTAKE__QUIET=5).start(), {}, []
    gone = []
    for number in range(kills):
        stop = []
        threads = load(service, f'kill {number}', stop, acknowledged, uploaded)
        time.sleep(random.uniform(0.05, 1.2))
        stop.append(1)
        service.kill()
        [thread.join() for thread in threads]
        service.start()
        gone += lost(service, acknowledged)
    check(f'kill -9, {kills} rounds: {len(acknowledged)} acknowledged instances, none lost', not gone, gone[:3])
    one_each(service, 'kill -9')
    service.stop()
    answer = subprocess.run([triplanar, 'check', '--data-dir', service.data], capture_output=True, text=True)
    check('triplanar check finds nothing damaged', answer.returncode == 0, answer.stdout[-300:] + answer.stderr[-300:])


def fill():
    with Disk(200) as disk:
        service, acknowledged, uploaded, stop = Service(triplanar, disk.path + '/data', INTAKE__QUIET=5).start(), {}, [], []
        threads = load(service, 'fill', stop, acknowledged, uploaded)
        for _ in range(fills):
            time.sleep(0.5)
            disk.fill()
            time.sleep(1)
            disk.empty()
        time.sleep(1)
        stop.append(1)
        [thread.join() for thread in threads]
        check(f'the disk filled and freed {fills} times: {len(acknowledged)} acknowledged instances, none lost',
              not lost(service, acknowledged), lost(service, acknowledged)[:3])
        check('it takes a series afterwards, without a restart', set(service.push(Series('last'))) == {0} and service.starts == 1)
        one_each(service, 'full disk')
        service.stop()


Series.make(triplanar, folder + '/template')
root = os.geteuid() == 0
for part in (full_catalog, uploads_fill, job_full, fill) if root else ():
    part()
if not root:
    print('skipped: full disks: only root may mount a small file system')
clock()
kill()
print(f'{passed} passed, {failed} failed')
sys.exit(bool(failed))
