"""A phase of a run on its timer, which an error inside does not leave running."""

from contextlib import contextmanager


@contextmanager
def phase(timer, name):
    """Time what happens inside as ``name``."""
    timer.start(name)
    try:
        yield
    finally:
        timer.stop(name)
