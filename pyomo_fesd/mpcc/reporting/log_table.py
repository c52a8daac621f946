"""The log that ``tee=True`` prints: one aligned line for each NLP and LPEC, or with several starts one for each start."""

from contextlib import contextmanager

from pyomo_fesd.mpcc.reporting.output_files import open_to_write, warn_of_loss

#: Columns and their widths, negative for left-aligned.
COLUMNS = {
    'step': 4,
    ' what': -12,
    'eps': 8,
    'objective': 15,
    'violation': 10,
    'compl.': 9,
    'bi-act.': 7,
    'iter': 5,
    'time': 7,
    ' status': -7,
}
START_COLUMNS = {'start': 5, 'objective': 15, 'nlps': 5, 'iter': 6, 'time': 8, ' outcome': -8}
#: Objectives that differ by less, relative, count as one.
DISTINCT = 1e-6


def _header(columns):
    return ' '.join(f'{name:{"<" if width < 0 else ">"}{abs(width)}}' for name, width in columns.items())


@contextmanager
def log_streams(tee, path):
    """Context with the streams ``tee`` and, if a path is given, a file."""
    if path is None:
        yield list(tee)
        return
    file = open_to_write('log_file', path)
    try:
        yield [*tee, file]
    finally:
        try:
            file.close()
        except OSError as error:
            warn_of_loss('log_file', path, error)


class LogTable:
    """Prints a run to ``streams``, a list of text streams."""

    COLUMNS = COLUMNS

    def __init__(self, streams):
        self._streams, self._number = streams, 0

    def begin(self, compiled):
        """Print the sizes and the column titles."""
        c = compiled
        self._print(
            f"mpec_hybrid: {len(c.variables)} variables, {len(c.constraints)} constraints, {len(c.conditions)} pairs"
            + (f", {len(c.decisions)} decided by the branch" if c.decisions else "")
            + (f"; {c.missing} values were missing and start at 0 or their bound" if c.missing else "")
        )
        self._print(_header(self.COLUMNS))

    def note(self, text):
        """Print a line before the table."""
        self._print(f"mpec_hybrid: {text}")

    def row(self, entry):
        """Print one NLP or LPEC."""
        self._number += 1
        eps = f'{entry.eps:8.1e}' if entry.eps else ' ' * 8
        self._print(
            f"{self._number:4d}  {entry.kind:<11} {eps} {entry.f:15.8e} {entry.violation:10.2e} {entry.complementarity:9.2e} "
            f"{entry.biactive:7d} {entry.iterations:5d} {entry.seconds:6.2f}s  {entry.status}"
        )

    def end(self, results):
        """Print the result."""
        info = results.extra_info
        self._print(info.outcome + (f" ({info.reason})" if info.reason else ""))
        objective = results.incumbent_objective
        self._print(
            (f"objective {objective:.10g}, " if objective is not None else "")
            + f"{info.nlps} NLPs with {info.nlp_iterations} iterations, {info.lpecs} LPECs with at most {info.binaries} binaries, "
            f"{results.timing_info.wall_time:.2f} s"
        )

    def _print(self, line):
        for stream in list(self._streams):
            try:
                stream.write(line + '\n')
                stream.flush()
            except (OSError, ValueError) as error:  # the disk is full, the pipe or the stream is closed
                self._streams.remove(stream)
                warn_of_loss('log', getattr(stream, 'name', 'stream'), error)


class StartsTable(LogTable):
    """As ``LogTable``, for several starts."""

    COLUMNS = START_COLUMNS

    def row(self, start):
        """Print one start."""
        objective = ' ' * 15 if start.objective is None else f'{start.objective:15.8e}'
        work = f'{start.nlps:5d} {start.iterations:6d} {start.seconds:7.2f}s'
        self._print(f'{start.start:5d} {objective} {work}  {start.outcome.splitlines()[0]}')

    def end(self, results):
        """Print the spread of the objectives, and the result."""
        starts = results.extra_info.starts
        f = sorted(start.objective for start in starts if start.certified)
        if f:
            distinct = 1 + sum(b - a > DISTINCT * max(1.0, abs(a)) for a, b in zip(f, f[1:]))
            self._print(
                f"{len(starts)} starts, {len(f)} certified with {distinct} distinct objective(s) from {f[0]:.10g} to {f[-1]:.10g}"
            )
        super().end(results)
