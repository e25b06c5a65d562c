"""Damages series of every codec: python -m damage TRIPLANAR WORK SHARED ROUNDS."""
import sys
from collections import Counter
from pathlib import Path

import numpy as np

from . import base, cloud, codecs, harm

# No point may lie farther than this from the unharmed cloud, mm.
MOST_MM = 1.0


class Unharmed:
    """A base series in one codec, its files and its clouds."""

    def __init__(self, triplanar, work, series, codec, signed):
        _, self.syntax, self.encode, self.in_fragments = codec
        self.series, self.triplanar, self.work = series, triplanar, work
        self.samples, self.bits, self.intercept = codecs.stored(series.hu, signed)
        self.pixels = [self.encode(slice, self.bits) for slice in self.samples]
        self.folder = work / 'unharmed'
        self.write(self.folder, self.pixels, {})
        run = cloud.Run(triplanar, self.folder, work)
        assert not run.failed, run.output
        self.told, self.points = run.told(), run.points
        # Every crossing: a harm may change which one stands for its leaf.
        fine = cloud.Run(triplanar, self.folder, work, '--leaf', '0.1')
        assert not fine.failed, fine.output
        self.crossings = np.concatenate([fine.points, run.points])
        self.paper = None

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

    def round(self, codec, rng):
        """One damaged series: what was done, which files."""
        count = len(self.pixels)
        harmed = sorted(int(z) for z in rng.choice(count, int(rng.integers(1, 4)), replace=False))
        if rng.random() < 0.3:  # side by side
            first = int(rng.integers(0, count - 3))
            harmed = list(range(first, first + len(harmed)))
        pixels, of_files, done = list(self.pixels), {}, []
        kinds = list(harm.COMPRESSED if self.in_fragments else harm.NATIVE) + [harm.EXCHANGED, harm.REPEATED]
        kind = kinds[int(rng.integers(len(kinds)))]
        in_stream = codec == 'deflated' and rng.random() < 0.5
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
        return ', '.join(done), getattr(kind, '__name__', kind), pixels, of_files, touched


def main() -> int:
    triplanar, work, shared, rounds = Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4])
    only = sys.argv[5:]
    bases = base.all_of(triplanar, work, shared)
    passed = failed = 0
    for number, codec in enumerate(codecs.ALL):
        name = codec[0]
        if only and name not in only:
            continue
        print(f'-- {name}', flush=True)
        ended = Counter()
        for part, series in enumerate(bases):
            share = len(range(part, rounds, len(bases)))
            if share == 0:
                continue
            try:
                unharmed = Unharmed(triplanar, work, series, codec, signed=(number + part) % 2 == 1)
            except (ImportError, FileNotFoundError) as error:
                print(f'skipped: no encoder: {error}')
                break
            except AssertionError as error:
                if 'transfer syntax' in str(error) or 'transfer-syntax' in str(error):
                    print('skipped: the program is built without this codec')
                    break
                raise
            if 'inconsistent_levels' in unharmed.told:
                print(f'FAILED: {series.name}: a doubt on the unharmed series', flush=True)
                failed += 1
            for round_of in range(share):
                seed = [number, part, round_of]
                done, kind, pixels, of_files, touched = unharmed.round(name, np.random.default_rng(seed))
                unharmed.write(unharmed.folder, pixels, of_files, touched)
                run = cloud.Run(triplanar, unharmed.folder, work)
                unharmed.write(unharmed.folder, unharmed.pixels, {}, touched)
                what = f'{series.name}, seed {seed}: {done}'
                if run.failed:
                    ended['error'] += 1
                    passed += 1
                    continue
                new = run.told() - unharmed.told
                if new:
                    ended['doubt' if 'inconsistent_levels' in new else 'other doubt'] += 1
                    passed += 1
                    continue
                off, missing = cloud.farthest(run.points, unharmed.crossings), cloud.farthest(unharmed.points, run.points)
                if off <= MOST_MM:
                    ended['the same within 1 mm'] += 1
                    ended['of them with points missing by more than 2 mm'] += missing > 2
                    passed += 1
                else:
                    ended['quiet and wrong'] += 1
                    failed += 1
                    print(f'FAILED: {what}: quiet, and a point {off:.2f} mm off', flush=True)
        print('; '.join(f'{count} {end}' for end, count in sorted(ended.items())), flush=True)
    print(f'{passed} passed, {failed} failed')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
