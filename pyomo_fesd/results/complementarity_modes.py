"""Hand-written complementarities over time, read as systems of modes for the reports.

A mode of a pair is named by the side that is positive, of a condition with two bounds on one side by its position.
"""

from collections.abc import Iterable

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, quicksum
from pyomo.dae import ContinuousSet
from pyomo.mpec import Complementarity

from pyomo_fesd.core import (
    Element,
    Pair,
    TimeIndex,
    all_switched_systems,
    is_generated,
    moving_grids,
    own_components,
    read_complementarity,
    strip_time,
    value_or_nan,
)

#: A multiplier nearer than this to 0 (or to 1) counts as off (or on).
CLEAR = 1e-6
#: In elements without a clear mode, values above this part of the largest one of their mode count, unless all are below the second.
PART, NOISE = 1e-3, 1e-8
#: The modes of a condition with two bounds on one side.
AT_LOWER, BETWEEN, AT_UPPER = 'at lower bound', 'between', 'at upper bound'
#: The modes of a rigid contact.
OPEN, CLOSED = 'open', 'closed'


def complementarity_modes(model: Block, wrt: ContinuousSet, times: TimeIndex) -> dict:
    """Return ``{name: {mode: {label: expression that is positive there}}}`` of the user's own complementarities.

    Those that ``fesd.finite_elements`` has aggregated are inactive except at the first time; others that are inactive are left out.
    """
    contacts = ComponentMap((contact.touching, contact) for contact in all_switched_systems(model).contacts)
    own = (c for c in own_components(model, Complementarity, Block) if not is_generated(c))
    moving, found = moving_grids(model).get(wrt), {}
    splits = {} if moving is None else moving.splits
    summed = ComponentSet() if moving is None else ComponentSet(c for some in moving.sources.values() for c in some)
    for name, by_time in times.families_in(own).items():
        if any(c.active or c in summed for c in by_time.values()):
            present = {t: c for t, c in by_time.items() if moving is not None or c.active}
            touching = contacts.get(next(iter(present.values())))
            if touching is None:
                found[strip_time(name)] = _by_mode(present, splits)
            else:
                name = times.split(touching.block)[1]
                found[strip_time(name)] = _of_contact([contacts[c] for c in present.values()], times)
    return found


def _of_contact(contacts, times):
    at = {times.time(contact.block): contact for contact in contacts}
    return {OPEN: {t: c.gap for t, c in at.items()}, CLOSED: {t: quicksum(c.forces) for t, c in at.items()}}


def _by_mode(by_time, splits):
    modes = {}
    for t, condition in by_time.items():
        for mode, weight in _mode_weights(condition, splits.get(condition)):
            modes.setdefault(mode, {})[t] = weight
    return modes


def _mode_weights(condition, split):
    """Each mode of one condition at one time, with an expression that is positive in it."""
    meaning = read_complementarity(condition)
    if isinstance(meaning, Pair):
        return [('G > 0', meaning.G), ('H > 0', meaning.H)]
    p, n = (meaning.F, -meaning.F) if split is None or split.p is None else (split.p, split.n)
    return [(AT_LOWER, p), (BETWEEN, min(value_or_nan(meaning.above), value_or_nan(meaning.below))), (AT_UPPER, n)]


def complementarity_positions(model: Block, wrt: ContinuousSet, times: TimeIndex, elements: Iterable[Element]) -> dict:
    """Return the position of each condition with two bounds, as multipliers like those of a Disjunction.

    Parameters
    ----------
    elements : iterable of Element
        each has one active set; none on a set without elements
    """
    together = {t: ((t,),) for t in wrt}
    for element in elements:
        together.update((t, (element.points, (element.left,))) for t in (*element.points, element.right))
    return {name: _shares(modes, together) for name, modes in complementarity_modes(model, wrt, times).items() if BETWEEN in modes}


def _shares(modes, together):
    found = {mode: {} for mode in modes}
    for t, groups in together.items():
        on = next(filter(None, (positive_modes(modes, labels) for labels in groups)), [])
        for mode in modes if on else ():
            found[mode][t] = (mode in on) / len(on)
    return found


def positive_modes(modes: dict, labels: Iterable[float]) -> list[str]:
    """Return the modes with a positive expression at one of ``labels``."""
    return _above(modes, labels, dict.fromkeys(modes, CLEAR))


def relatively_positive_modes(modes: dict, labels: Iterable[float]) -> list[str]:
    """Return the modes with an expression that is positive at one of ``labels`` beside its largest value: for small units."""
    largest = {mode: float(np.nanmax([0.0, *map(value_or_nan, weights.values())])) for mode, weights in modes.items()}
    return _above(modes, labels, {mode: max(PART * size, NOISE) for mode, size in largest.items()})


def _above(modes, labels, least):
    return [mode for mode, weights in modes.items() if any(t in weights and value_or_nan(weights[t]) > least[mode] for t in labels)]
