"""Files that a run writes: refused before it if they cannot be written, and no reason to lose its result if that fails later."""

import logging

from pyomo_fesd.core import FesdError

logger = logging.getLogger('pyomo_fesd')

LOST = "%s='%s': it could not be written, the result is not affected: %s"


def open_to_write(option: str, path, mode: str = 'w'):
    """Open the file that ``option`` names.

    Raises
    ------
    FesdError
        with the option, if it cannot be written
    """
    try:
        return open(path, mode)
    except OSError as error:
        raise FesdError(f"{option}='{path}'", f"this file cannot be written: {error}", "give another file or folder") from None


def warn_of_loss(option: str, path, error: Exception) -> None:
    """Warn that a file could not be written after all."""
    logger.warning(LOST, option, path, error)
