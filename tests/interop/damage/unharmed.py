"""No unharmed series is doubted: python -m damage.unharmed TRIPLANAR WORK DIR…"""
import sys
from pathlib import Path

from . import cloud


def main() -> int:
    triplanar, work = Path(sys.argv[1]), Path(sys.argv[2])
    passed = failed = 0
    for folder in map(Path, sys.argv[3:]):
        run = cloud.Run(triplanar, folder, work, '--profile', 'paper')
        doubted = 'inconsistent_levels' in run.warnings or 'inconsistent_levels' in run.output
        passed, failed = passed + (not doubted), failed + doubted
        if doubted:
            print(f'FAILED: {folder}: {run.rows or run.output}', flush=True)
    print(f'{passed} passed, {failed} failed')
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
