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
    found = ((part, k, number) for k, chain in enumerate(chains) for number, part in enumerate(chain))
    return [_part(part, columns, *place) for part, *place in found if id(part.extent) in columns]


def _part(part, columns, chain, number):
    one_is_given = any((id(first) in columns) != (id(last) in columns) for first, last in part.ends)
    return PartIndices(
        columns[id(part.extent)][0],
        positions_of(part.own, columns),
        positions_of(part.gate, columns),
        np.array([columns[id(v)][0] if id(v) in columns else NONE for v in part.own], dtype=int),
        *both_positions(part.ends, columns),
        positions_of([last for _, last in part.ends], columns),
        chain,
        number,
        not one_is_given,
        part.copies,
    )
