"""Orthanc as a PACS that sends a stored study."""
import json
import subprocess
import time

import requests
from pydicom.uid import ExplicitVRLittleEndian

from .service import AE_TITLE, free_port


def run(checks, service, phantom, work, shared):
    what = 'Orthanc'
    series = phantom.series('orthanc', ExplicitVRLittleEndian)
    http, dicom = free_port(), free_port()
    directory = work / 'orthanc'
    directory.mkdir()
    (directory / 'orthanc.json').write_text(json.dumps({
        'Name': 'interop', 'StorageDirectory': str(directory / 'storage'),
        'IndexDirectory': str(directory / 'storage'), 'HttpPort': http, 'DicomPort': dicom, 'DicomAet': 'ORTHANC',
        'RemoteAccessAllowed': False, 'AuthenticationEnabled': False, 'Plugins': [],
        'DicomModalities': {'triplanar': [AE_TITLE, '127.0.0.1', service.dimse_port]},
    }))
    url = f'http://127.0.0.1:{http}'
    with (directory / 'log').open('wb') as log:
        orthanc = subprocess.Popen(['Orthanc', directory / 'orthanc.json'], stdout=log, stderr=subprocess.STDOUT)
    try:
        await_start(url)
        for path in series.files:
            requests.post(f'{url}/instances', data=path.read_bytes(), timeout=60).raise_for_status()
        [study] = requests.get(f'{url}/studies', timeout=30).json()
        echo = requests.post(f'{url}/modalities/triplanar/echo', json={}, timeout=30)
        checks.equal(f'{what}: C-ECHO', echo.status_code, 200)
        sent = requests.post(f'{url}/modalities/triplanar/store', json={'Resources': [study]}, timeout=300)
        checks.equal(f'{what}: the study is sent', sent.status_code, 200)
        checks.equal(f'{what}: instances that failed', sent.json().get('FailedInstancesCount'), 0)
    finally:
        orthanc.terminate()
        orthanc.wait(60)
    service.check(checks, what, series)


def await_start(url):
    for _ in range(300):
        try:
            if requests.get(f'{url}/system', timeout=5).status_code == 200:
                return
        except requests.ConnectionError:
            pass
        time.sleep(0.1)
    raise TimeoutError('Orthanc does not start')
