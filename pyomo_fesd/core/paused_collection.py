"""Make many objects without Python's garbage collection, and without the walk over all of them that would follow.

Pyomo's ``PauseGC`` enables the collection at its end, and the next allocation starts one that walks all the new objects: a tenth
of the time of a transformation, and nothing of a new model is garbage.  Here the new objects count as old at once: they are walked
by the next full collection.  Python starts one by the number of objects that grew old otherwise, so models that were thrown away
could add up in between: after ``MOST`` objects the collection is Python's own until the next full one.
"""

import gc
from contextlib import contextmanager
from threading import Lock

#: To walk fewer new objects than this takes about a millisecond at most.
FEW = 10_000
#: New objects that may count as old between two full collections; one model may go beyond.
MOST = 500_000


class _AgedObjects:
    """The number of objects that count as old without a walk since the last full collection."""

    def __init__(self):
        self._number, self._collections, self._lock = 0, 0, Lock()

    def add_new_objects(self):
        """Let the new objects count as old, unless they are few, too many did before, or somebody keeps objects frozen."""
        new = gc.get_count()[0]
        with self._lock:
            if new < FEW or self._number_now() > MOST or gc.get_freeze_count():
                return
            self._number += new
            gc.freeze()
            gc.unfreeze()

    def _number_now(self):
        collections = gc.get_stats()[2]['collections']
        if collections != self._collections:
            self._number, self._collections = 0, collections
        return self._number


_AGED = _AgedObjects()


@contextmanager
def paused_collection():
    """Pause the garbage collection in the body, in all threads, unless somebody has done so already."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
        # after an error the new objects are garbage
        _AGED.add_new_objects()
    finally:
        gc.enable()
