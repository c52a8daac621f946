"""Time a phase of a run; an error inside stops the timer too."""

from contextlib import contextmanager


@contextmanager
def phase(timer, name: str):
    """Time the statements inside as phase ``name`` of ``timer``, a HierarchicalTimer."""
    timer.start(name)
    try:
        yield
    finally:
        timer.stop(name)
