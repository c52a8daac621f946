"""Where the variables of copies in a row are among the columns of a joined LPEC.

Takes: insertions in a row, all between the same two parts.
Leaves: for each copy the columns of its own variables, and of those with which it begins and ends.
"""

import numpy as np


def columns_of_row(parts, insertions, n):
    """Return the columns of each copy, after the ``n`` of the model; those that lie behind their part come first."""
    found, before = [], {}
    last_behind = sum(not insertion.ahead for insertion in insertions)
    for number, insertion in enumerate(insertions, 1):
        copy = CopyColumns(parts, insertion, n, before, ends=number == last_behind)
        n, before = n + len(copy.own), copy.passed_on
        found.append(copy)
    return found


class CopyColumns:
    """The columns of one copy.

    Parameters
    ----------
    parts : Parts
    insertion : Insertion
    first : int
        the first column of its own
    before : dict
        the ``passed_on`` of the copy before it, or {}
    ends : bool
        whether the copy ends where its part ended

    Attributes
    ----------
    k : int
        the part that is copied
    rows : int array
        stacked numbers of its rows
    own : int array
        its variables
    extent : int
        that of its part
    place_of_extent : int
    columns : dict
        of the variables in its rows that are not those of the model
    passed_on : dict
        variables at the boundary -> columns of the last values of the copy
    ends : dict
        variables of the part at its end -> columns, where the copy ends there
    """

    def __init__(self, parts, insertion, first, before, ends):
        part = parts.all[insertion.k]
        self.k, self.own, self.extent, self.rows = insertion.k, part.own, part.extent, np.flatnonzero(parts.of_row == insertion.k)
        place = {j: first + i for i, j in enumerate(part.own)}
        self._own, self.place_of_extent = frozenset(place), place[part.extent]
        # the boundary lies between the part and what a copy of it is inserted beside
        follows = dict(zip(*parts.entry(insertion.k)))
        self._begins = {j: j for j in follows} if insertion.ahead else follows
        at_boundary = follows if insertion.ahead else {j: j for j in follows.values()}
        self.columns = {j: before.get(boundary, boundary) for j, boundary in self._begins.items()} | place
        self.passed_on = before | {j: place[last] for j, last in at_boundary.items() if last in place}
        self.ends = {j: place[j] for j in part.ends} if ends else {}

    def of_model(self, variables) -> list:
        """Those of its ``variables`` that are none of the copy, as variables of the model: at the boundary, and of no part."""
        return [self._begins.get(j, j) for j in variables if j not in self._own]

    def at_its_end(self, variables) -> list:
        """Columns of the last values of the copy, of some ``variables`` at the boundary."""
        return [self.passed_on[j] for j in variables if j in self.passed_on]

    def in_place(self, w, there):
        """The point ``w`` with the values that the copy has ``there`` in place of those of the part."""
        found = w.copy()
        found[self.own] = there[self.own]
        return found
