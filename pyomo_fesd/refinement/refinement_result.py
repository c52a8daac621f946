"""The result of a refinement, and its table with a row for each round."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pyomo.common.dependencies import pandas as pd
from pyomo.opt import SolverResults

#: Estimated errors, each with a column.
ERRORS = ('states', 'switches', 'objective', 'quantities')
COLUMNS = ['nfe', 'elements', *ERRORS, 'order', 'pairs', 'seconds', 'note']
FORMATS = dict.fromkeys(ERRORS, '{:.1e}'.format) | {'order': '{:.1f}'.format, 'seconds': '{:.1f}'.format, 'pairs': '{:.0f}'.format}
#: Characters of a note that are printed.
NOTE = 60


@dataclass(frozen=True)
class Refinement:
    """The result of ``refine``; prints as a table.

    Attributes
    ----------
    reached : bool
        whether the estimated error is below the tolerance
    error : float
        the estimate, nan if there is none
    fixed_points : tuple of float
        labels at which the last grid has ``fixed_points``, placed by ``refine`` or given
    table : pandas.DataFrame
        a row for each round: ``nfe`` (elements of each control stage), estimated errors of ``states``, ``switches`` and
        ``objective`` (or ``quantities``), the observed ``order``, ``pairs``, ``seconds``, and a ``note``
    results : SolverResults or None
        of ``mpec_hybrid`` in the last round; None after a simulation
    """

    reached: bool
    error: float
    fixed_points: tuple[float, ...]
    table: pd.DataFrame
    results: SolverResults | None

    def __repr__(self) -> str:
        return _text(self.table)

    __str__ = __repr__


class RoundTable:
    """Rows of rounds; ``absent`` says for each optional column whether it is left out, ``tee`` prints rows as they come."""

    def __init__(self, absent: Mapping[str, bool], tee: bool):
        self._absent, self._tee, self._rows = [name for name, out in absent.items() if out], tee, []

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, row: dict) -> None:
        """Add a round."""
        self._rows.append(row)
        if self._tee:
            print(_text(self.frame) if len(self) == 1 else _text(self.frame.tail(1)).splitlines()[-1], flush=True)

    @property
    def frame(self) -> pd.DataFrame:
        """The table as a DataFrame."""
        index = pd.RangeIndex(1, 1 + len(self), name='round')
        return pd.DataFrame(self._rows, columns=COLUMNS, index=index).drop(columns=self._absent)


def _text(table):
    return table.to_string(formatters=FORMATS, na_rep='-', max_colwidth=NOTE)
