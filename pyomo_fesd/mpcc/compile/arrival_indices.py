"""Positions of pairs and variables in hints about changes.

Takes: hints, with the positions of pairs and of variables by the id of a component; a component need not have any.
Leaves: the same by positions.
"""

from itertools import chain, count

import numpy as np

from pyomo_fesd.mpcc.compile.hint_indices import (
    ArrivalIndices,
    ChangeIndices,
    MoveIndices,
    OptionIndices,
    PlaceIndices,
    ToggleIndices,
)


def arrival_indices(arrivals, pairs, columns) -> list[ArrivalIndices]:
    """Return the arrivals by positions; gauges are numbered in the order of ``Arrival.gauges``."""
    rows, found, numbers = {}, [], count()
    for arrival in arrivals:
        if id(arrival.row) not in rows:
            both = (arrival.row, arrival.opposite) if arrival.opposite else (arrival.row,)
            rows[id(arrival.row)] = tuple(tuple(_place(place, pairs, columns) for place in row) for row in both)
        toggles = [_toggle(toggle, numbers, pairs) for toggle in arrival.toggles]
        options = [_option(option, numbers, pairs) for option in arrival.options]
        found.append(ArrivalIndices(rows[id(arrival.row)], tuple(t for t in toggles if t.pairs.size), tuple(options)))
    return found


def changes_by_id(hints, pairs) -> dict[int, ChangeIndices]:
    """Return the changes of neighbouring branches and coincidences by positions, by the id of each ``Change``."""
    of_coincidences = [(*hint.changes, hint.beyond_later, hint.beyond_earlier) for hint in hints.coincidences]
    several = chain([hint.changes for hint in hints.neighbour_branches], of_coincidences)
    every = {id(change): change for changes in several for change in changes if change is not None}
    return {key: _change(change, pairs) for key, change in every.items()}


def _change(change, pairs):
    differing = both_positions(change.differing, pairs)
    return ChangeIndices(
        *differing, moves(change.later, pairs), moves(change.earlier, pairs), positions_of(change.happening, pairs)
    )


def _place(place, pairs, columns):
    extent = columns[id(place.extent)][0] if id(place.extent) in columns else None
    return PlaceIndices(extent, moves(place.inside, pairs), moves(place.between, pairs), positions_of(place.happening, pairs))


def _toggle(toggle, numbers, pairs):
    first, second = (None if side is None else next(numbers) for side in (toggle.first, toggle.second))
    return ToggleIndices(positions_of(toggle.pairs, pairs), first, second, *_with_numbers(toggle.with_them, pairs))


def _option(option, numbers, pairs):
    gauges = np.array([next(numbers) for _ in option.gauges], dtype=int)
    return OptionIndices(
        gauges, *_with_numbers(option.requires, pairs), *_with_numbers(option.sides, pairs), positions_of(option.either, pairs)
    )


def _with_numbers(couples, pairs):
    found = [(k, number) for pair, number in couples for k in pairs.get(id(pair), ())]
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
