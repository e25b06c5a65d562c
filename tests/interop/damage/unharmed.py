"""No unharmed series is doubted: python -m damage.unharmed TRIPLANAR WORK DIR…"""
import sys
from pathlib import Path

from . import cloud


def main() -> int:
    triplanar, work = Path(sys.argv[1]), Path(sys.argv[2])
    passed = failed = 0
    for folder in map(Path, sys.argv[3:]):
        run = cloud.read(triplanar, folder, work)
        doubted = run.doubts or 'inconsistent_levels' in run.output or 'decode_failed' in run.output
        passed, failed = passed + (not doubted), failed + bool(doubted)
        if doubted:
            print(f'FAILED: {folder}: {run.rows or run.output}', flush=True)
    print(f'{passed} passed, {failed} failed')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
