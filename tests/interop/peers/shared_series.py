"""A scanner's series, where the shared data are: pushed by storescu as it is."""
import zipfile

from .dcmtk import storescu
from .series import Series


def run(checks, service, phantom, work, shared):
    name = 'imagex_siemens_phantom_2mm'
    directory = work / 'series' / name
    with zipfile.ZipFile(shared / 'series' / f'{name}.zip') as archive:
        archive.extractall(directory)
    series = Series(directory)
    done = storescu(service, series.files, '-R')
    checks.that(f'storescu, {name}: exit code 0', done.returncode == 0, done.stdout[-1500:])
    service.check(checks, f'storescu, {name}', series)
