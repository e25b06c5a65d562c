"""A line for each check, and the count."""
import contextlib
import traceback


class Checks:
    def __init__(self):
        self.passed = 0
        self.failed = 0

    def that(self, what, holds, otherwise=''):
        if holds:
            self.passed += 1
            print(f'ok: {what}', flush=True)
        else:
            self.failed += 1
            print(f'FAILED: {what}: {otherwise}', flush=True)

    def equal(self, what, got, expected):
        self.that(what, got == expected, f'got {got!r}, expected {expected!r}')

    @contextlib.contextmanager
    def no_exception(self, what):
        """A peer that breaks counts as one failure and lets the others run."""
        try:
            yield
        except Exception:
            traceback.print_exc()
            self.that(what, False, 'ended with an exception')
