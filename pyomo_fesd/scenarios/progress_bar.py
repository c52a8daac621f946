"""A progress bar of tqdm, if it is installed."""

from contextlib import contextmanager


@contextmanager
def progress_bar(total: int, done: int, show: bool):
    """A function to call after each scenario; without tqdm, or if not ``show``, it does nothing."""
    bar = _tqdm(total=total, initial=done, unit='scenario') if show else None
    try:
        yield (lambda: None) if bar is None else bar.update
    finally:
        if bar is not None:
            bar.close()


def _tqdm(**kwds):
    # optional, and the terminal's or the notebook's form is chosen by tqdm itself
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm(**kwds)
