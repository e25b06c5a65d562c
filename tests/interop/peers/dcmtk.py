"""DCMTK: echoscu, storescu, dcmsend."""
import subprocess

from pydicom.uid import ExplicitVRLittleEndian, ImplicitVRLittleEndian, JPEG2000Lossless

from .service import AE_TITLE


def call(service, tool, *arguments, called=AE_TITLE):
    command = [tool, '-v', '-aet', 'DCMTK', '-aec', called, *map(str, arguments)]
    return command, subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300)


def storescu(service, files, *options):
    _, done = call(service, 'storescu', *options, '127.0.0.1', service.dimse_port, *files)
    return done


def run(checks, service, phantom, work, shared):
    _, echo = call(service, 'echoscu', '127.0.0.1', service.dimse_port)
    checks.that('echoscu: success', echo.returncode == 0 and 'Success' in echo.stdout, echo.stdout)
    _, wrong = call(service, 'echoscu', '127.0.0.1', service.dimse_port, called='SOMEONE')
    checks.that('echoscu: a wrong called AE title is rejected',
                wrong.returncode != 0 and 'Called AE Title Not Recognized' in wrong.stdout, wrong.stdout)

    pushes = [
        ('uncompressed', phantom.series('dcmtk-explicit', ExplicitVRLittleEndian), []),
        ('implicit VR only', phantom.series('dcmtk-implicit', ImplicitVRLittleEndian), ['-xi']),
        ('big endian', phantom.converted('dcmtk-big', 'dcmconv', '+tb'), ['-xb']),
        ('JPEG Lossless', phantom.converted('dcmtk-jpeg', 'dcmcjpeg', '+e1'), ['-xs']),
        ('JPEG 2000', phantom.series('dcmtk-j2k', JPEG2000Lossless), ['-xv']),
        ('RLE', phantom.converted('dcmtk-rle', 'dcmcrle'), ['-xr']),
        ('deflated', phantom.converted('dcmtk-deflated', 'dcmconv', '+td'), ['-xd']),
    ]
    for name, series, options in pushes:
        done = storescu(service, series.files, *options)
        stored = done.stdout.count('Received Store Response (Success)')
        checks.that(f'storescu, {name}: {len(series.files)} × 0x0000',
                    done.returncode == 0 and stored == len(series.files), done.stdout[-1500:])
    for name, series, _ in pushes:
        sent = {dataset.file_meta.TransferSyntaxUID for dataset in series.datasets()}
        checks.equal(f'storescu, {name}: stored as it came', service.stored_syntaxes(series), sent)
        service.check(checks, f'storescu, {name}', series)

    # One series over four associations at once: still one series, one reconstruction.
    series = phantom.series('dcmtk-parallel', ExplicitVRLittleEndian)
    senders = []
    for part in range(4):
        command = ['storescu', '-aet', f'DCMTK{part}', '-aec', AE_TITLE, '127.0.0.1', str(service.dimse_port)]
        senders.append(subprocess.Popen([*command, *map(str, series.files[part::4])]))
    checks.equal('storescu, four associations at once: exit codes', [s.wait(300) for s in senders], [0] * 4)
    service.check(checks, 'storescu, four associations at once', series)

    series = phantom.series('dcmtk-dcmsend', ExplicitVRLittleEndian)
    _, done = call(service, 'dcmsend', '127.0.0.1', service.dimse_port, *series.files)
    checks.equal('dcmsend: exit code', done.returncode, 0)
    service.check(checks, 'dcmsend', series)
