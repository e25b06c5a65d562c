"""dicomweb-client: STOW-RS."""
from dicomweb_client.api import DICOMwebClient
from pydicom.uid import ExplicitVRLittleEndian, JPEG2000Lossless


def run(checks, service, phantom, work, shared):
    for name, syntax in [('uncompressed', ExplicitVRLittleEndian), ('JPEG 2000', JPEG2000Lossless)]:
        what = f'dicomweb-client, STOW-RS, {name}'
        series = phantom.series(f'dicomweb-{name.replace(" ", "")}', syntax)
        client = DICOMwebClient(url=f'{service.url}/dicom-web')
        answer = client.store_instances(series.datasets(), study_instance_uid=series.study_uid)
        stored = answer.get('ReferencedSOPSequence', [])
        checks.equal(f'{what}: instances referenced', len(stored), len(series.files))
        checks.equal(f'{what}: instances failed', len(answer.get('FailedSOPSequence', [])), 0)
        service.check(checks, what, series)
