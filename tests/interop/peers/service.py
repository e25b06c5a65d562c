"""The service under test."""
import os
import socket
import subprocess
import time
from pathlib import Path

import pydicom
import requests

from .series import Series

AE_TITLE = 'TRIPLANAR'


def free_port():
    with socket.socket() as s:
        s.bind(('127.0.0.1', 0))
        return s.getsockname()[1]


class Service:
    """`triplanar serve` on free loopback ports over a data directory of its own."""

    def __init__(self, triplanar: Path, directory: Path):
        self.triplanar = triplanar
        self.directory = directory
        self.http_port, self.dimse_port = free_port(), free_port()
        self.url = f'http://127.0.0.1:{self.http_port}'
        self.log = directory / 'log'

    def __enter__(self):
        self.directory.mkdir()
        settings = {
            'TRIPLANAR_INTAKE__QUIET_AFTER_ASSOCIATION': '1.5',
            'TRIPLANAR_LOG__FILTER': 'debug',
        }
        with self.log.open('wb') as log:
            self.process = subprocess.Popen(
                [self.triplanar, 'serve', '--http-listen', f'127.0.0.1:{self.http_port}',
                 '--dimse-listen', f'127.0.0.1:{self.dimse_port}', '--data-dir', self.directory / 'data'],
                stdout=log, stderr=subprocess.STDOUT, env={**os.environ, **settings})
        self.until(lambda: self.get('/readyz').status_code == 200, 30, 'the service is not ready')
        return self

    def __exit__(self, *_):
        self.process.terminate()
        try:
            self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def get(self, path, **arguments):
        return requests.get(self.url + path, timeout=30, **arguments)

    def until(self, condition, seconds, otherwise):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if self.process.poll() is not None:
                raise RuntimeError(f'the service ended: {self.log.read_text()[-2000:]}')
            try:
                if condition():
                    return
            except requests.ConnectionError:
                pass
            time.sleep(0.1)
        raise TimeoutError(f'{otherwise} after {seconds} s')

    def series(self, series: Series):
        answer = self.get(f'/v1/series/{series.uid}')
        return answer.json() if answer.status_code == 200 else None

    def finished(self, series: Series):
        """The series with its reconstruction, once that has come to an end."""
        def ended():
            view = self.series(series)
            reconstruction = view and view['reconstruction']
            return reconstruction and reconstruction['state'] not in ('queued', 'running')
        self.until(ended, 180, f'series {series.uid} has no finished reconstruction')
        return self.series(series)

    def cloud(self, series: Series):
        answer = self.get(f'/v1/series/{series.uid}/cloud')
        answer.raise_for_status()
        return answer.content

    def reconstructed(self, series: Series):
        """What the command line makes of the same files."""
        cloud = self.directory / f'{series.uid}.ply'
        subprocess.run([self.triplanar, 'reconstruct', series.directory, '-o', cloud], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return cloud.read_bytes()

    def stored_syntaxes(self, series: Series):
        """Transfer syntaxes of the stored files of a series: they are kept as they came."""
        headers = (pydicom.dcmread(path, specific_tags=['SeriesInstanceUID'], stop_before_pixels=True)
                   for path in (self.directory / 'data' / 'instances').rglob('*') if path.is_file())
        return {header.file_meta.TransferSyntaxUID for header in headers if header.SeriesInstanceUID == series.uid}

    def reconstructions(self, series: Series):
        answer = self.get('/v1/reconstructions', params={'series': series.uid})
        answer.raise_for_status()
        return answer.json()['items']

    def check(self, checks, what, series: Series):
        """All instances arrived, one reconstruction was made, and its cloud is the right one."""
        view = self.finished(series)
        checks.equal(f'{what}: all instances are stored', view['instances'], len(series.files))
        checks.equal(f'{what}: the reconstruction succeeded', view['reconstruction']['state'], 'succeeded')
        checks.equal(f'{what}: one reconstruction', len(self.reconstructions(series)), 1)
        if view['reconstruction']['state'] == 'succeeded':
            cloud = self.cloud(series)
            same = cloud == self.reconstructed(series)
            checks.that(f'{what}: the cloud ({len(cloud)} bytes) is that of `triplanar reconstruct`', same,
                        'the bytes differ')

    def log_names(self, identities):
        text = self.log.read_text(errors='replace')
        return any(identity and identity in text for identity in identities)
