"""Mixed complementarity over time as pairs: two bounds on one side (theory, below eq. 14; eq. 5 is l = 0, u = 1).

    l <= x <= u  perp  F:      F = p - n,    0 <= x - l  perp  p >= 0,    0 <= u - x  perp  n >= 0

p and n are the two parts of F.  Where F is continuous in time they are too, and x may jump (a valve, a vapour fraction, a relay);
where x is continuous and F is not (a state between two walls), x - l and u - x are the continuous sides, and p and n jump.

Takes: the mixed conditions over time, and the continuity of their sides.
Leaves: ``p``, ``n``, ``split`` (F = p - n) and ``complementarity`` (index 'lower' and 'upper') in a block beside the source; the
source is deactivated.
Does not apply: to conditions without time; the solver splits them.  Equal bounds leave ``x == l``; a variable that is fixed at all
times leaves the sign of F that the condition then implies.
"""

from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Constraint, Set, Var, value
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import (
    GENERATED,
    FesdError,
    MovingGrid,
    Split,
    TimeIndex,
    index_tuple,
    read_complementarity,
    stored_index,
    switched_systems,
    value_or_zero,
)
from pyomo_fesd.finite_elements.continuity import Continuity, inner_label

PARTS = ('lower', 'upper')
#: The distance by which a fixed variable may violate its bounds, as everywhere in Pyomo.
OUTSIDE = 1e-8


def split_mixed(moving: MovingGrid, conditions: dict, continuity: Continuity) -> dict:
    """Replace mixed conditions by pairs.

    Parameters
    ----------
    moving : MovingGrid
        gets ``splits`` and ``split_sources``
    conditions : dict name -> {time: ComplementarityData}
    continuity : Continuity
        gets the continuity of p and n

    Returns
    -------
    dict like ``conditions``
        the generated pairs
    """
    pairs, blocks, times = {}, ComponentMap(), TimeIndex(moving.wrt)
    for by_time in conditions.values():
        mixed = {t: read_complementarity(data) for t, data in by_time.items()}
        given = all(_is_given(c.body) for c in mixed.values())
        inner = inner_label(by_time, moving.wrt)
        smooth = inner is not None and continuity.holds(mixed[inner].F)
        for t, condition in mixed.items():
            source, block, index = by_time[t], _split_block(by_time[t], blocks), index_tuple(by_time[t].index())
            if given or _equal(condition):
                moving.splits[source] = Split()
                _impose_given_side(block, index, condition, source)
            else:
                moving.splits[source] = split = _add_parts_of_function(block, index, condition, smooth)
                for pair in _add_pairs(block, index, condition, split):
                    moving.split_sources[pair] = source
                    pairs.setdefault(times.split(pair)[1], {})[t] = pair
            source.deactivate()
        if smooth and moving.splits[by_time[inner]].p is not None:
            _add_continuous_parts(moving.splits[by_time[inner]], continuity, mixed[inner].F)
    return pairs


def _add_continuous_parts(split, continuity, F):
    for part in (split.p, split.n):
        continuity.add(part, part.parent_block().split, F)


def _is_given(body):
    return not any(True for _ in identify_variables(body, include_fixed=False))


def _equal(condition):
    """Whether both bounds are one number (a mutable Param may change)."""
    low, high = condition.lower, condition.upper
    return low.__class__ in (int, float) and high.__class__ in (int, float) and low == high


def _split_block(data, blocks):
    """Return the block for components generated from the component of ``data``; made on the first call."""
    component, parent = data.parent_component(), data.parent_block()
    if component not in blocks:
        if parent.component(GENERATED + 'mixed') is None:
            parent.add_component(GENERATED + 'mixed', Block())
        blocks[component] = block = Block()
        parent.component(GENERATED + 'mixed').add_component(component.local_name, block)
        _declare_split(block, (component.index_set(),) if component.is_indexed() else ())
    return blocks[component]


def _declare_split(block, index):
    sparse = {'dense': False} if index else {}
    block.part = Set(initialize=PARTS)
    block.p = Var(*index, **sparse, bounds=(0, None))
    block.n = Var(*index, **sparse, bounds=(0, None))
    block.split = Constraint(*index)
    block.complementarity = Complementarity(*index, block.part)
    block.imposed = Constraint(*index)


def _add_parts_of_function(block, index, condition, smooth):
    """p and n at one time, recorded as continuous, or as free to jump."""
    p, n = block.p[stored_index(index)], block.n[stored_index(index)]
    now, systems = value_or_zero(condition.F), switched_systems(block)
    p.value, n.value = max(now, 0.0), max(-now, 0.0)
    block.split.add(stored_index(index), condition.F == p - n)
    if smooth:
        systems.continuous.update((part, block.split) for part in (p, n))
    else:
        systems.selectors.update((p, n))
    return Split(p, n)


def _add_pairs(block, index, condition, split):
    """The pairs of one time."""
    yield block.complementarity.add((*index, 'lower'), complements(condition.above >= 0, split.p >= 0))
    yield block.complementarity.add((*index, 'upper'), complements(condition.below >= 0, split.n >= 0))


def _impose_given_side(block, index, condition, source):
    """x is given: F >= 0 at the lower bound, F <= 0 at the upper, F = 0 between; no condition on F where the bounds are equal."""
    low, x, high, F = condition
    if not _is_given(x):
        block.imposed.add(stored_index(index), x == low)
        return
    above, below = value(condition.above), value(condition.below)
    if min(above, below) < -OUTSIDE:
        raise FesdError(
            source,
            f"'{x}' is fixed to {value(x):g}, outside its bounds {value(low):g} and {value(high):g}",
            "fix it between them, or unfix it",
        )
    if min(above, below) > OUTSIDE:
        block.imposed.add(stored_index(index), F == 0)
    elif max(above, below) > OUTSIDE:
        block.imposed.add(stored_index(index), F >= 0 if above <= OUTSIDE else F <= 0)


def repeats_other_side(moving: MovingGrid, condition, side) -> bool:
    """Whether ``side`` of a generated condition is u - x, which adds nothing to the x - l of the other."""
    if condition not in moving.split_sources or index_tuple(condition.index())[-1] != 'upper':
        return False
    return side is not moving.splits[moving.split_sources[condition]].n
