"""Positions of pairs and variables in hints about changes.

Takes: hints, with the positions of pairs and of variables by the id of a component; a component need not have any.
Leaves: the same by positions.
"""

import numpy as np

from pyomo_fesd.mpcc.compile.mpcc_functions import ArrivalIndices, MoveIndices, OptionIndices, PlaceIndices, ToggleIndices


def arrival_indices(arrivals, pairs, columns) -> list[ArrivalIndices]:
    """Return the arrivals by positions; gauges are numbered in the order of ``Arrival.gauges``."""
    rows, found, number = {}, [], 0
    for arrival in arrivals:
        if id(arrival.row) not in rows:
            rows[id(arrival.row)] = tuple(_place(place, pairs, columns) for place in arrival.row)
        toggles, options = [], []
        for toggle in arrival.toggles:
            numbers = [None if side is None else number + (side is toggle.second and toggle.first is not None) for side in (toggle.first, toggle.second)]
            number += sum(1 for k in numbers if k is not None)
            toggles.append(_toggle(toggle, numbers, pairs))
        for option in arrival.options:
            options.append(_option(option, number, pairs))
            number += len(option.gauges)
        found.append(ArrivalIndices(rows[id(arrival.row)], tuple(t for t in toggles if t.pairs.size), tuple(options)))
    return found


def _place(place, pairs, columns):
    extent = columns[id(place.extent)][0] if id(place.extent) in columns else None
    return PlaceIndices(extent, moves(place.inside, pairs), moves(place.between, pairs))


def _toggle(toggle, numbers, pairs):
    found = [(k, swapped) for pair, swapped in toggle.sides for k in pairs.get(id(pair), ())]
    positions, swapped = np.array(found, dtype=int).reshape(-1, 2).T
    return ToggleIndices(positions, swapped.astype(bool), *numbers)


def _option(option, number, pairs):
    gauges = np.arange(number, number + len(option.gauges))
    return OptionIndices(
        gauges, *_with_sides(option.requires, pairs), *_with_sides(option.sides, pairs), positions_of(option.either, pairs)
    )


def _with_sides(sides, pairs):
    found = [(k, side) for pair, side in sides for k in pairs.get(id(pair), ())]
    return tuple(np.array(found, dtype=int).reshape(-1, 2).T)


def moves(moved, pairs) -> MoveIndices:
    """Return couples of a pair and its source, which may be None."""
    taken = both_positions([(pair, source) for pair, source in moved if source is not None], pairs)
    return MoveIndices(*taken, positions_of([pair for pair, source in moved if source is None], pairs))


def both_positions(hints, pairs) -> tuple[np.ndarray, ...]:
    """Return the positions of the first and of the second components of couples, where both have any."""
    found = [both for couple in hints for both in zip(*(pairs.get(id(component), ()) for component in couple))]
    return tuple(np.array(found, dtype=int).reshape(-1, 2).T)


def positions_of(components, positions) -> np.ndarray:
    """Return the positions of components in their order."""
    return np.array([k for c in components for k in positions.get(id(c), ())], dtype=int)
