"""Hand-written complementarities over time, read as systems of modes for the reports.

A pair is called by the side that is positive, a condition with two bounds on one side by where it stands.
"""

from pyomo.common.collections import ComponentSet
from pyomo.core import Block
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.complementarity import Pair, read
from pyomo_fesd.elements.cross import sources
from pyomo_fesd.elements.mixed import parts
from pyomo_fesd.records import records
from pyomo_fesd.timeindex import strip_time
from pyomo_fesd.values import number

#: A multiplier nearer than this to 0 (or to 1) counts as off (or on).
CLEAR = 1e-6
#: The modes of a condition with two bounds on one side.
AT_LOWER, BETWEEN, AT_UPPER = 'at lower bound', 'between', 'at upper bound'


def conditions(model, wrt, index):
    """``{name: {mode: {label: expression that is positive there}}}`` of the user's own complementarities.

    Those that ``fesd.finite_elements`` has aggregated are inactive but at the first time; others that are inactive are off.
    """
    own = (c for c in model.component_data_objects(Complementarity, descend_into=Block) if not marks.is_generated(c))
    block, found = records(model).grids.get(wrt), {}
    moved = ComponentSet(c for some in sources(block).values() for c in some) if block is not None else ()
    for name, family in index.families(own).items():
        if any(c.active or c in moved for c in family.values()):
            weights = {t: _weights(c) for t, c in family.items() if block is not None or c.active}
            modes = dict.fromkeys(mode for w in weights.values() for mode in w)
            found[strip_time(name)] = {mode: {t: w[mode] for t, w in weights.items() if mode in w} for mode in modes}
    return found


def _weights(condition):
    """What is positive in each mode of one condition at one time."""
    meaning = read(condition)
    if isinstance(meaning, Pair):
        return {'G > 0': meaning.G, 'H > 0': meaning.H}
    p, n = parts(condition) or (meaning.F, -meaning.F)
    return {AT_LOWER: p, BETWEEN: min(number(meaning.above), number(meaning.below)), AT_UPPER: n}


def positions(model, wrt, index, elements):
    """Where each condition with two bounds stands, as shares like those of a Disjunction.

    Parameters
    ----------
    elements : iterable of Element
        each has one active set; none on a set without elements
    """
    together = {t: ((t,),) for t in wrt}
    for element in elements:
        together.update((t, (element.points, (element.left,))) for t in (*element.points, element.right))
    return {name: _shares(modes, together) for name, modes in conditions(model, wrt, index).items() if BETWEEN in modes}


def _shares(modes, together):
    found = {mode: {} for mode in modes}
    for t, groups in together.items():
        on = next(filter(None, (positive(modes, labels) for labels in groups)), [])
        for mode in modes if on else ():
            found[mode][t] = (mode in on) / len(on)
    return found


def positive(modes, labels):
    """The modes with something positive at one of ``labels``."""
    return [mode for mode, weights in modes.items() if any(t in weights and number(weights[t]) > CLEAR for t in labels)]
