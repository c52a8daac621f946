"""Ctrl-C: at once where nothing is lost by it, and after the body where something would be left half done."""

import contextlib
import logging
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps

#: Frames that are looked at: the present one, a generator's caller, and that of a tracer.
NEAR = 3
#: Open contexts of the main thread.
_open = []


class DeferredInterrupt:
    """Context in which Ctrl-C waits until the body has ended, so that what the body makes it also removes.

    Then the handler of before gets the signal, which by default raises KeyboardInterrupt.

    Does not apply: in other threads than the main one, which signals never interrupt, and where Ctrl-C is ignored.

    Attributes
    ----------
    pressed : bool
        whether a Ctrl-C is waiting

    Examples
    --------
    >>> with DeferredInterrupt() as interrupt, tempfile.TemporaryDirectory() as folder, interrupt.raising():
    ...     work(folder)
    """

    def __init__(self):
        self.pressed, self._handler, self._raised = False, None, None

    def __enter__(self):
        if threading.current_thread() is threading.main_thread() and callable(signal.getsignal(signal.SIGINT)):
            self._handler = signal.signal(signal.SIGINT, self._remember)
            _open.append(self)
        return self

    def __exit__(self, kind, error, trace):
        handler = self._handler
        if handler is not None:
            _open.remove(self)
            try:
                signal.signal(signal.SIGINT, handler)
            finally:
                self._handler = None
            self._answer(handler)

    def _remember(self, *args):
        self.pressed = True

    def _raise(self, number, frame):
        if _may_leave_open(frame):
            # a context of a generator, or a lock, that is interrupted there would never be left: the end of the body answers
            self.pressed = True
            return
        try:
            self._handler(number, frame)
        except BaseException as error:
            self._raised = error
            raise

    def _answer(self, handler):
        if self.pressed:
            self.pressed = False
            handler(signal.SIGINT, None)

    @contextmanager
    def raising(self) -> Iterator[None]:
        """Context inside the first one in which Ctrl-C does not wait.

        Its end raises what a library has turned into another error, or what got lost in the deletion of a generator.
        """
        if self._handler is None:
            yield
            return
        try:
            signal.signal(signal.SIGINT, self._raise)
            self._answer(self._handler)
            yield
        finally:
            # where Ctrl-C fell into the entry of this context, the outer one has ended long before this generator is deleted
            if self._handler is not None:
                self._end_of_raising()

    def _end_of_raising(self):
        signal.signal(signal.SIGINT, self._remember)
        raised, self._raised = self._raised, None
        if raised is not None:
            raise raised
        self._answer(self._handler)


def _may_leave_open(frame):
    """Whether contextlib enters or leaves a context, or logging its lock, which all threads share; a tracer may lie between."""
    for _ in range(NEAR):
        if frame is not None and frame.f_code.co_filename in (contextlib.__file__, logging.__file__):
            return True
        frame = frame and frame.f_back
    return False


def interruptible(function: Callable) -> Callable:
    """Decorate ``function``: Ctrl-C raises KeyboardInterrupt, whatever the libraries that it calls make of it."""

    @wraps(function)
    def call(*args, **kwds):
        with DeferredInterrupt() as interrupt, interrupt.raising():
            return function(*args, **kwds)

    return call


def interrupt_handled() -> None:
    """Note that a KeyboardInterrupt was caught on purpose: no context raises it again."""
    for context in _open:
        context._raised = None
