"""python -m heads TRIPLANAR SHARED CACHE WORK [NAME...]: see heads.sh."""
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from . import series
from .places import Places

sys.path.insert(0, str(series.TOOLS))
import score_real  # noqa: E402
from score import read_ply  # noqa: E402

# A device's own points, and the skin under it: mm from the device, mm from the true skin.
ON_DEVICE_MM, OFF_SKIN_MM = 1.0, 1.0
# Points of the scan circle, mm.
ON_CIRCLE_MM = 2.0
SIDES = ('anterior', 'right', 'left', 'posterior', 'superior', 'inferior')


def reconstruct(triplanar, path, work):
    """The cloud and report of one series; seconds and peak memory (MB) of the process."""
    cloud, report = work / 'cloud.ply', work / 'report.json'
    for file in (cloud, report):
        file.unlink(missing_ok=True)
    begin = time.monotonic()
    process = subprocess.Popen(
        [triplanar, 'reconstruct', path, '-o', cloud, '--report', report, '--profile', 'precise'],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )
    # The kernel's own figure of a child begins with its parent's memory, and starts anew when the program does:
    # the last one asked for while it ran.
    peak = 0
    while process.poll() is None:
        peak = memory_mb(process.pid) or peak
        time.sleep(0.05)
    said = process.stderr.read()
    seconds = time.monotonic() - begin
    told = json.loads(report.read_text()) if report.exists() else {}
    if process.returncode != 0 or not cloud.exists():
        return None, told, said.strip().splitlines()[-1] if said.strip() else f'exit status {process.returncode}', seconds, 0
    vertices = read_ply(str(cloud))
    points = np.stack([vertices['x'], vertices['y'], vertices['z']], 1).astype(float)
    return points, told, '', seconds, peak


def memory_mb(pid):
    try:
        peak = [line for line in Path(f'/proc/{pid}/status').read_text().splitlines() if line.startswith('VmHWM')]
    except OSError:
        return 0
    return int(peak[0].split()[1]) / 1024 if peak else 0


def share_near(points, off_skin, places, within):
    """Share of the points within some mm of places and farther than [OFF_SKIN_MM] from the true skin."""
    if len(points) == 0:
        return 0.0
    near = cKDTree(places).query(points, distance_upper_bound=within)[0] <= within
    return float((near & off_skin).mean())


def measure(one: series.Series, triplanar, work):
    points, report, said, seconds, memory = reconstruct(triplanar, one.path, work)
    row = {'name': one.name, 'seconds': round(seconds, 1), 'memory_mb': round(memory)}
    if points is None:
        return row | {'error': said}
    truth = score_real.load_gt(str(one.truth))
    row |= score_real.score(points, truth)
    quality = report['quality']
    row |= {
        'stated': quality['coverage'], 'verdict': quality['verdict'], 'doubts': quality['doubts'],
        'stated_by_side': {side['side']: side['coverage'] for side in quality['sides']},
    }
    distance = np.abs(score_real.signed_distance(points, *truth[:3])[0])
    off_skin = distance > OFF_SKIN_MM
    if one.devices:
        row['on_device'] = share_near(points, np.ones(len(points), bool), np.load(one.devices), ON_DEVICE_MM)
    if one.mask:
        places = Places(one.made_of).of_mask(one.mask)
        if one.name.startswith('deface'):
            # Stray away from what was altered.
            away = cKDTree(places).query(points, distance_upper_bound=5.0)[0] > 5.0
            row['stray_away'] = float((away & (distance > 2.0)).mean())
        else:
            row['on_device'] = share_near(points, off_skin, places, ON_DEVICE_MM)
    if one.circle_mm:
        middle = Places(one.path).middle()
        across = np.hypot(points[:, 0] - middle[0], points[:, 1] - middle[1])
        row['on_circle'] = float(((np.abs(across - one.circle_mm) < ON_CIRCLE_MM) & off_skin).mean())
    return row


def percent(value, digits=2):
    return '' if value is None else f'{100 * value:.{digits}f}'


def line(row):
    if 'error' in row:
        return f"| {row['name']} | {row['error']} |" + ' |' * 13
    sides = ' '.join(f"{row['coverage_by_side'].get(side, float('nan')):.2f}" for side in SIDES)
    number = lambda key, digits: '' if row.get(key) is None else f'{row[key]:.{digits}f}'
    return ' | '.join(
        (
            f"| {row['name']}", number('coverage', 3), number('stated', 3), sides, percent(row['stray'], 3),
            number('rms_certain_mm', 3), number('bias_certain_mm', 3), percent(row.get('on_device'), 3),
            percent(row.get('on_circle'), 3), percent(row.get('stray_away'), 3), str(row['points']),
            f"{row['verdict']}: {' '.join(row['doubts'])}", number('seconds', 1), f"{row['memory_mb']} |",
        )
    )


def main() -> int:
    triplanar, shared, cache, work = map(Path, sys.argv[1:5])
    print(
        '| series | coverage | stated | ' + ' '.join(SIDES) + ' | stray % | rms mm | bias mm | on device % |'
        ' on circle % | stray away % | points | verdict | s | MB |\n|' + '---|' * 14,
        flush=True,
    )
    results = cache / 'heads.json'
    rows = []
    for one in series.all_of(shared, cache, sys.argv[5:]):
        rows.append(measure(one, triplanar, work))
        print(line(rows[-1]), flush=True)
        results.write_text(json.dumps(rows, indent=1))
    return 0


if __name__ == '__main__':
    sys.exit(main())
