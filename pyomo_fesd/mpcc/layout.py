"""Where each side, decision and penalty term stands in the NL file.

All that an entry can be stands in one vector: the file's rows (m), its variables (n), then plain numbers.  The position in it is
an entry's address: i < m for a row, m + j for a variable, and -1 - k, counted from the end, for a number.  Entries are equal if
their addresses are; no two numbers are the same entry.
"""

import casadi as ca
import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.core import value

#: What ``Entries`` has addresses of.
GROUPS = ('G', 'H', 'eta', 'equal', 'penalty', 'present')


class Layout:
    """Addresses of the ``Entries`` in an ``Nl``.

    Attributes
    ----------
    G, H : int arrays (q), addresses;  eta, equal : one each decision;  penalty : one each term
    size : int, number of variables in the file
    settable : int array (l), variables of the file that are parameters
    free : int array, its other variables
    own : int array, its rows that are the model's
    """

    def __init__(self, nl, entries, parameters):
        self._m, self.size = len(nl.constraints), len(nl.variables)
        self._place, self._numbers = ComponentMap((c, i) for i, c in enumerate([*nl.constraints, *nl.variables])), []
        self.settable = np.array([self._place[v] - self._m for v in parameters], dtype=int)
        self.free = np.setdiff1d(np.arange(self.size), self.settable)
        addresses = {name: np.array([self._address(e) for e in getattr(entries, name)], dtype=int) for name in GROUPS}
        self.__dict__.update(addresses)
        self.own = np.setdiff1d(np.arange(self._m), np.concatenate(list(addresses.values())))

    def _address(self, entry):
        if entry in self._place:
            return self._place[entry]
        self._numbers.append(value(entry))
        return -len(self._numbers)

    def stack(self, g, x):
        """The vector in which addresses count, of the rows' values and the variables (SX)."""
        return ca.vertcat(g, x, ca.SX(np.array(self._numbers[::-1], dtype=float)))

    def columns(self, addresses):
        """The variable (of the file) at each address; -1 where there is none."""
        return np.where(addresses >= self._m, addresses - self._m, -1)

    def distinct(self):
        """Positions of the pairs that are not there already, in whichever order of their sides."""
        first = {frozenset(pair): k for k, pair in reversed(list(enumerate(zip(self.G, self.H))))}
        return np.array(sorted(first.values()), dtype=int)
