"""Mixed complementarity over time as pairs: two bounds on one side (theory, below eq. 14; eq. 5 is l = 0, u = 1).

    l <= x <= u  perp  F:      F = p - n,    0 <= x - l  perp  p >= 0,    0 <= u - x  perp  n >= 0

p and n are the two parts of F.  Where F is continuous in time they are too, and x may jump (a valve, a vapour fraction, a relay);
where x is continuous and F is not (a state between two walls), x - l and u - x are the continuous sides, and p and n jump.

Takes: the conditions over time, by family, and what is continuous.
Leaves: ``p``, ``n``, ``split`` (F = p - n) and ``complementarity`` (index 'lower' and 'upper') in a block beside the source; the
source is switched off.
Does not apply: to conditions without time; the solver splits them.  Equal bounds leave ``x == l``; a variable that is fixed at all
times leaves what F then has to be.
"""

from pyomo.core import Block, Constraint, Set, Var, value
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements

from pyomo_fesd import marks
from pyomo_fesd.complementarity import read
from pyomo_fesd.elements.continuity import inner_label
from pyomo_fesd.errors import FesdError
from pyomo_fesd.values import finite

PARTS = ('lower', 'upper')
#: How far outside its bounds a fixed variable may stand, as everywhere in Pyomo.
OUTSIDE = 1e-8


def split_mixed(conditions, continuity, times):
    """Replace mixed conditions by pairs.

    Parameters
    ----------
    conditions : dict name -> {time: ComplementarityData}
    continuity : Continuity
        learns of p and n
    times : TimeIndex

    Returns
    -------
    dict like ``conditions``
        the generated pairs
    """
    pairs = {}
    for family in conditions.values():
        mixed = {t: read(data) for t, data in family.items()}
        given = all(_is_constant(c.body) for c in mixed.values())
        inner = inner_label(family, times.wrt)
        smooth = inner is not None and continuity.holds(mixed[inner].F)
        for t, condition in mixed.items():
            block, index = _block(family[t])
            if given or _equal(condition):
                _impose(block, index, condition, family[t])
            else:
                for pair in _add(block, index, condition, smooth):
                    pairs.setdefault(times.split(pair)[1], {})[t] = pair
                if t == inner and smooth:
                    for part in parts(family[t]):
                        continuity.add(part, block.split, condition.F)
            family[t].deactivate()
    return pairs


def _is_constant(body):
    return not any(True for _ in identify_variables(body, include_fixed=False))


def _equal(condition):
    """Whether both bounds are one number (a mutable Param may change)."""
    low, high = condition.lower, condition.upper
    return low.__class__ in (int, float) and high.__class__ in (int, float) and low == high


def _block(data):
    """The block for what is generated from the component of ``data``, made at its first time; and the index in it."""
    component, parent = data.parent_component(), data.parent_block()
    if replacement(data) is None:
        if parent.component(marks.GENERATED + 'mixed') is None:
            parent.add_component(marks.GENERATED + 'mixed', Block())
        block = Block()
        parent.component(marks.GENERATED + 'mixed').add_component(component.local_name, block)
        _declare(block, (component.index_set(),) if component.is_indexed() else ())
    return replacement(data), _tuple(data.index())


def _declare(block, index):
    sparse = {'dense': False} if index else {}
    block.part = Set(initialize=PARTS)
    block.p = Var(*index, **sparse, bounds=(0, None))
    block.n = Var(*index, **sparse, bounds=(0, None))
    block.split = Constraint(*index)
    block.complementarity = Complementarity(*index, block.part)
    block.imposed = Constraint(*index)


def _add(block, index, condition, smooth):
    """The pairs of one time; p and n are marked as continuous, or as free to jump."""
    p, n = block.p[index or None], block.n[index or None]
    now = finite(condition.F)
    p.value, n.value = max(now, 0.0), max(-now, 0.0)
    block.split.add(index or None, condition.F == p - n)
    for part in (p, n):
        if smooth:
            marks.mark(block, marks.CONTINUOUS, part, block.split)
        else:
            marks.mark(block, marks.SELECTOR, part)
    yield block.complementarity.add((*index, 'lower'), complements(condition.above >= 0, p >= 0))
    yield block.complementarity.add((*index, 'upper'), complements(condition.below >= 0, n >= 0))


def _impose(block, index, condition, source):
    """x is given: F >= 0 at the lower bound, F <= 0 at the upper, F = 0 between; nothing where the bounds are equal."""
    low, x, high, F = condition
    if not _is_constant(x):
        block.imposed.add(index or None, x == low)
        return
    above, below = value(condition.above), value(condition.below)
    if min(above, below) < -OUTSIDE:
        raise FesdError(
            source,
            f"'{x}' is fixed to {value(x):g}, outside its bounds {value(low):g} and {value(high):g}",
            "fix it between them, or unfix it",
        )
    if min(above, below) > OUTSIDE:
        block.imposed.add(index or None, F == 0)
    elif max(above, below) > OUTSIDE:
        block.imposed.add(index or None, F >= 0 if above <= OUTSIDE else F <= 0)


def source(condition):
    """The user's condition that a generated one stands for; any other is its own source."""
    block = condition.parent_block()
    if not _is_ours(block):
        return condition
    *index, _ = _tuple(condition.index())
    component = block.parent_block().parent_block().component(block.local_name)
    return component[tuple(index) if len(index) > 1 else index[0]] if index else component


def repeats(condition, side):
    """Whether ``side`` of a generated condition is u - x, which says no more than the x - l of the other."""
    block = condition.parent_block()
    again = _is_ours(block) and _tuple(condition.index())[-1] == 'upper'
    return again and not (side.is_variable_type() and side.parent_component() is block.n)


def parts(condition):
    """p and n of a user's mixed condition that was split; None for any other."""
    block = replacement(condition)
    if block is None or condition.index() not in block.p:
        return None
    return block.p[condition.index()], block.n[condition.index()]


def replacement(condition):
    """The block with what was generated from the component of a user's mixed condition; None for any other."""
    home = condition.parent_block().component(marks.GENERATED + 'mixed')
    return home.component(condition.parent_component().local_name) if home is not None else None


def _is_ours(block):
    return block.parent_block() is not None and block.parent_block().local_name == marks.GENERATED + 'mixed'


def _tuple(index):
    return () if index is None else index if isinstance(index, tuple) else (index,)
