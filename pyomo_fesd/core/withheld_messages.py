"""Withhold messages of one thread: those that other threads log meanwhile appear as always."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def withheld_messages(name: str) -> Iterator[list[logging.LogRecord]]:
    """Withhold what this thread logs at the logger ``name`` and below; yields the growing list of records.

    Pyomo's ``LoggingIntercept`` replaces the handlers of the whole process.
    """
    thread, records = threading.get_ident(), []

    def withhold(record):
        ours = threading.get_ident() == thread and f'{record.name}.'.startswith(f'{name}.')
        if ours and record not in records[-1:]:  # each handler asks for it
            records.append(record)
        return not ours

    handlers = list(_handlers(logging.getLogger(name)))
    for handler in handlers:
        handler.addFilter(withhold)
    try:
        yield records
    finally:
        for handler in handlers:
            handler.removeFilter(withhold)


def _handlers(logger):
    """The handlers that a message of ``logger`` reaches, and Python's last resort."""
    yield logging.lastResort
    while logger is not None:
        yield from logger.handlers
        logger = logger.parent if logger.propagate else None
