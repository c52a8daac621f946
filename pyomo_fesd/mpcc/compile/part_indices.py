"""Positions of the variables of parts.

Takes: chains of ``Part``, and the positions of variables by the id of a component; one that is fixed has none.
Leaves: the same by positions.
"""

import numpy as np

from pyomo_fesd.mpcc.compile.arrival_indices import both_positions, positions_of
from pyomo_fesd.mpcc.compile.hint_indices import PartIndices

#: In place of the position of a variable that is given.
NONE = -1


def part_indices(chains, columns) -> list[PartIndices]:
    """Return the parts of all chains by positions, without parts whose extent is given."""
    return [part for k, chain in enumerate(chains) for part in _parts(chain, columns, k)]


def _parts(chain, columns, k):
    given = [_given(part, columns) for part in chain]
    for number, part in enumerate(chain):
        if id(part.extent) in columns:
            beside = given[max(number - 1, 0) : number] + given[number + 1 : number + 2]
            yield _part(part, columns, k, number, not beside or given[number] in beside)


def _part(part, columns, k, number, alike):
    one_is_given = any((id(first) in columns) != (id(last) in columns) for first, last in part.ends)
    return PartIndices(
        extent=columns[id(part.extent)][0],
        own=positions_of(part.own, columns),
        gate=positions_of(part.gate, columns),
        places=np.array([columns[id(v)][0] if id(v) in columns else NONE for v in part.own], dtype=int),
        **dict(zip(('first', 'last'), both_positions(part.ends, columns))),
        ends=positions_of([last for _, last in part.ends], columns),
        chain=k,
        number=number,
        alike=alike,
        whole=alike and not one_is_given,
        copies=part.copies,
    )


def _given(part, columns):
    """Places of the variables that are given; those that only some parts of a chain have are not, and come after the others."""
    return [place for place, v in enumerate(part.own) if id(v) not in columns]
