"""Warnings of the package during one run, for studies that judge what a user would see."""

import logging
from contextlib import contextmanager


@contextmanager
def warnings_of_package():
    """Collect the warnings of pyomo_fesd in a list."""
    logger, said = logging.getLogger('pyomo_fesd'), []
    handler = logging.Handler(logging.WARNING)
    handler.emit = lambda record: said.append(record.getMessage())
    logger.addHandler(handler)
    kept, logger.propagate = logger.propagate, False
    try:
        yield said
    finally:
        logger.removeHandler(handler)
        logger.propagate = kept
