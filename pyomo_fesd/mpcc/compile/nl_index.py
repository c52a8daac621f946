"""Where the NL file has each side, decision and penalty term.

Everything that an entry can be is one element of a vector: the file's rows (m), its variables (n), then plain numbers.  The
position in it is an entry's address: i < m for a row, m + j for a variable, and -1 - k, counted from the end, for a number.
Entries are equal if their addresses are; no two numbers are the same entry.
"""

import casadi as ca
import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.core import value

#: The lists of ``Entries`` that have addresses.
GROUPS = ('G', 'H', 'eta', 'equal', 'penalty', 'gauges', 'present')


class NlIndex:
    """Addresses of the ``Entries`` in an ``NlModel``.

    Attributes
    ----------
    G, H : int arrays (q), addresses;  eta, equal : one each decision;  penalty : one each term;  gauges : one each gauge
    size : int, number of variables in the file
    parameters : int array (l), variables of the file that are parameters
    free : int array, its other variables
    model_rows : int array, its rows that are the model's own
    """

    def __init__(self, nl, entries, parameters):
        self._m, self.size = len(nl.constraints), len(nl.variables)
        self._position, self._numbers = ComponentMap((c, i) for i, c in enumerate([*nl.constraints, *nl.variables])), []
        self.parameters = np.array([self._position[v] - self._m for v in parameters], dtype=int)
        self.free = np.setdiff1d(np.arange(self.size), self.parameters)
        addresses = {name: np.array([self._address(e) for e in getattr(entries, name)], dtype=int) for name in GROUPS}
        self.__dict__.update(addresses)
        self.model_rows = np.setdiff1d(np.arange(self._m), np.concatenate(list(addresses.values())))

    def _address(self, entry):
        if entry in self._position:
            return self._position[entry]
        self._numbers.append(value(entry))
        return -len(self._numbers)

    def stack(self, g, x):
        """The vector that addresses refer to, of the rows' values and the variables (SX)."""
        return ca.vertcat(g, x, ca.SX(np.array(self._numbers[::-1], dtype=float)))

    def columns(self, addresses):
        """The variable (of the file) at each address; -1 for rows and numbers."""
        return np.where(addresses >= self._m, addresses - self._m, -1)

    def distinct(self):
        """Positions of the pairs without repetitions, in whichever order of their sides."""
        first = {frozenset(pair): k for k, pair in reversed(list(enumerate(zip(self.G, self.H))))}
        return np.array(sorted(first.values()), dtype=int)
