"""The table of a refinement, and what is returned with it."""

from dataclasses import dataclass

import pandas as pd

#: Errors that are estimated, each with a column.
ERRORS = ('states', 'switches', 'objective', 'quantities')
#: How numbers are printed.
FORMATS = {'order': '{:.1f}', 'seconds': '{:.1f}', 'pairs': '{:.0f}'}
#: Characters of a note that are printed.
NOTE = 60


@dataclass(frozen=True)
class Refinement:
    """What ``refine`` has done; prints as a table.

    Attributes
    ----------
    reached : bool
        whether the estimated error is below the tolerance
    error : float
        the estimate, nan if there is none
    table : pandas.DataFrame
        a row for each round: ``nfe`` (elements of each control stage), estimated errors of ``states``, ``switches`` and
        ``objective`` (or ``quantities``), the ``order`` that was observed, ``pairs``, ``seconds``, and a ``note``
    results : SolverResults or None
        of ``mpec_hybrid`` in the last round; None after a simulation
    """

    reached: bool
    error: float
    table: pd.DataFrame
    results: object

    def __repr__(self):
        return lines(self.table)

    __str__ = __repr__


class Table:
    """Rows that grow.

    Parameters
    ----------
    absent : dict str -> bool
        columns that may stay empty, and whether they do
    tee : bool
        whether rows are printed
    """

    def __init__(self, absent, tee):
        self._absent, self._tee, self._rows = absent, tee, []

    def __len__(self):
        return len(self._rows)

    def add(self, row):
        """A round as a dict."""
        self._rows.append(row)
        if self._tee:
            print(lines(self.frame) if len(self) == 1 else lines(self.frame.tail(1)).splitlines()[-1], flush=True)

    @property
    def frame(self):
        """As a DataFrame."""
        columns = ['nfe', 'elements', *ERRORS, 'order', 'pairs', 'seconds', 'note']
        frame = pd.DataFrame(self._rows, columns=columns, index=pd.RangeIndex(1, 1 + len(self), name='round'))
        return frame.drop(columns=[name for name, absent in self._absent.items() if absent])


def lines(table):
    """As text."""
    formatters = {name: FORMATS.get(name, '{:.1e}').format for name in (*ERRORS, *FORMATS)}
    return table.to_string(formatters=formatters, na_rep='-', max_colwidth=NOTE)
