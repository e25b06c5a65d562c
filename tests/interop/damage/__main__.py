"""Damages series of every codec: python -m damage TRIPLANAR WORK SHARED ROUNDS [CODEC…]."""
import os
import shutil
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

from . import base, cloud, codecs, harm

# No point may lie farther than this from the unharmed cloud, mm.
MOST_MM = 1.0


class Clouds:
    """The clouds of unharmed voxels, each made once: lossless codecs have the same."""

    def __init__(self, triplanar, work):
        self.triplanar, self.work, self.known = triplanar, work, {}

    def of(self, key, folder):
        if key not in self.known:
            run = cloud.Run(self.triplanar, folder, self.work)
            # Every crossing: a harm may change which one stands for its leaf.
            fine = cloud.Run(self.triplanar, folder, self.work, '--leaf', '0.1')
            assert run.code == 0 and fine.code == 0, run.output + fine.output
            self.known[key] = run.points, np.concatenate([fine.points, run.points])
        return self.known[key]


class Unharmed:
    """A base series in one codec, and its files."""

    def __init__(self, work, series, codec, signed):
        self.name, self.syntax, self.encode, self.in_fragments = codec
        self.series, self.folder = series, work / 'unharmed'
        self.samples, self.bits, self.intercept = codecs.stored(series.hu, signed)
        self.pixels = [self.encode(slice, self.bits) for slice in self.samples]
        shutil.rmtree(self.folder, ignore_errors=True)
        self.write(self.folder, self.pixels, {})

    def file(self, z, pixels, harm_file=None):
        pixels = [pixels] if self.in_fragments else pixels
        return codecs.part10(
            self.series.headers[z], self.samples[z], self.bits, self.intercept, self.syntax, pixels, self.in_fragments,
            harm_file,
        )

    def write(self, folder, pixels, of_files, only=None):
        folder.mkdir(exist_ok=True)
        for z, data in enumerate(pixels):
            if only is None or z in only:
                (folder / f'{z:04}.dcm').write_bytes(self.file(z, data, of_files.get(z)))

    def round(self, rng):
        """One damaged series: what was done, and which pixels and files it changed."""
        count = len(self.pixels)
        harmed = sorted(int(z) for z in rng.choice(count, int(rng.integers(1, 4)), replace=False))
        if rng.random() < 0.3:  # side by side
            first = int(rng.integers(0, count - 3))
            harmed = list(range(first, first + len(harmed)))
        pixels, of_files, done = list(self.pixels), {}, []
        kinds = list(harm.COMPRESSED if self.in_fragments else harm.NATIVE) + [harm.EXCHANGED, harm.REPEATED]
        kind = kinds[int(rng.integers(len(kinds)))]
        in_stream = self.name == 'deflated' and rng.random() < 0.5
        if in_stream:
            kind = harm.STREAM[int(rng.integers(len(harm.STREAM)))]
        touched = set(harmed)
        for z in harmed:
            if kind in (harm.EXCHANGED, harm.REPEATED):
                other = int(rng.integers(count))
                if rng.random() < 0.5:
                    other = min(count - 1, max(0, z + int(rng.choice([-2, -1, 1, 2]))))
                if kind == harm.EXCHANGED:
                    pixels[z], pixels[other] = pixels[other], pixels[z]
                    touched.add(other)
                else:
                    pixels[z] = self.pixels[other]
                done.append(f'{z}: {kind} ({other})')
            elif in_stream:
                of_files[z] = lambda data, rng=rng: kind(data, rng)
                done.append(f'{z}: {kind.__name__} in the deflated stream')
            else:
                pixels[z] = kind(pixels[z], rng)
                done.append(f'{z}: {kind.__name__}')
        return ', '.join(done), pixels, of_files, touched


def ending(triplanar, work, unharmed, clouds):
    """How a damaged series ended, whether that will do, and what is to be said of it. `clouds` makes those of
    the unharmed series, in whose place its files are then."""
    # A doubt is known once the series is read; only what is read without one is worth the whole computation.
    run = cloud.read(triplanar, unharmed.folder, work)
    if run.code not in cloud.READ:
        return 'error', True, run.output
    if run.doubts:
        return 'doubt', True, f'{sorted(run.doubts)} {run.rows}'
    run = cloud.Run(triplanar, unharmed.folder, work)
    if run.code != 0:
        return 'error', True, run.output
    leaves, crossings = clouds()
    off, missing = cloud.farthest(run.points, crossings), cloud.farthest(leaves, run.points)
    if off > MOST_MM:
        return 'quiet and wrong', False, f'quiet, and a point {off:.2f} mm off'
    end = 'the same within 1 mm' if missing <= 2 else 'the same within 1 mm, with points missing'
    return end, True, f'{off:.2f} mm, {missing:.2f} mm missing'


def main() -> int:
    triplanar, work, shared, rounds = Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4])
    only = sys.argv[5:]
    told = os.environ.get('DAMAGE_VERBOSE')
    # The damaged series that passed quietly are left here, to be looked at.
    keep = os.environ.get('DAMAGE_KEEP')
    bases = base.all_of(triplanar, work, shared)
    clouds = Clouds(triplanar, work)
    passed = failed = 0
    for number, codec in enumerate(codecs.ALL):
        name, begin = codec[0], time.monotonic()
        if only and name not in only:
            continue
        print(f'-- {name}', flush=True)
        ended = Counter()
        for part, series in enumerate(bases):
            share = len(range(part, rounds, len(bases)))
            if share == 0:
                continue
            signed = (number + part) % 2 == 1 and codec[2] is not codecs.htj2k
            try:
                unharmed = Unharmed(work, series, codec, signed)
            except (ImportError, FileNotFoundError) as error:
                print(f'skipped: no encoder: {error}')
                break
            run = cloud.read(triplanar, unharmed.folder, work)
            if run.code not in cloud.READ and 'transfer syntax' in run.output.replace('-', ' '):
                print('skipped: the program is built without this codec')
                break
            if run.code not in cloud.READ or run.doubts:
                print(f'FAILED: {series.name}: the unharmed series: {sorted(run.doubts)} {run.output}', flush=True)
                failed += 1
                continue
            key = (part, signed, name if name in codecs.LOSSY else '')
            for round_of in range(share):
                seed = [number, part, round_of]
                done, pixels, of_files, touched = unharmed.round(np.random.default_rng(seed))
                unharmed.write(unharmed.folder, pixels, of_files, touched)
                to = Path(keep or work / 'kept', '_'.join(map(str, seed)))
                shutil.rmtree(to, ignore_errors=True)
                to.mkdir(parents=True)
                for z in touched:
                    shutil.copy(unharmed.folder / f'{z:04}.dcm', to)

                def restore():
                    unharmed.write(unharmed.folder, unharmed.pixels, {}, touched)

                def of_unharmed():
                    restore()
                    return clouds.of(key, unharmed.folder)

                end, holds, why = ending(triplanar, work, unharmed, of_unharmed)
                restore()
                if keep and end not in ('error', 'doubt'):
                    unharmed.write(to / 'unharmed', unharmed.pixels, {}, touched)
                else:
                    shutil.rmtree(to)
                ended[end] += 1
                passed, failed = passed + holds, failed + (not holds)
                if told or not holds:
                    print(f'{"" if holds else "FAILED: "}{series.name}, seed {seed}: {done}: {end}: {why[-300:]}', flush=True)
        counts = '; '.join(f'{count} {end}' for end, count in sorted(ended.items()))
        print(f'{counts}; {time.monotonic() - begin:.0f} s', flush=True)
    print(f'{passed} passed, {failed} failed')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
