"""What passes between the three pieces beside Pyomo's own components: marks, as local Suffixes.

A mark is a ``Suffix(direction=LOCAL)`` with one of the names below on the block that holds the marked component.  It survives
``clone``, is never exported to a solver file, and every piece can read it without knowing who wrote it.

=================  ========================  ===========================================================================
mark               on                        value
=================  ========================  ===========================================================================
CONTINUOUS         Var (or data)             the Constraint (of lam, mu, p, n), Complementarity (of a kink's s) or Expression (the
                                             arguments of the weights w) that ties it to the states: continuous in time where
                                             the quantity that switches is
SELECTOR           Var                       ``True``: an independent multiplier nu, free to jump at a switch
INDICATOR          Disjunct                  the expression of its multiplier nu_i (1: mode on, 0: off, between: sliding)
REPLACED           Disjunct,                 ``True``: switched off by logic between modes and not by the user, so new times of
                   LogicalConstraint (data)  it are not switched off too
SIDES              Var                       (name, {side: expression}) of the surface that it belongs to: positive where the
                                             quantity is on this side
MEMORY             Expression (data)         the conditions c >= 0 of a mode with memory; the Expression is its weight, 1 or 0 in an
                                             element; the mode goes on until a condition ends
GUARD              Expression (data)         ``True``: a jump of the state happens where this falls to 0 from above
RESET              Var (data)                the Expression of the value after the jump whose guard stands on the same block
DECIDED            Complementarity (data)    the inactive Constraint to impose where the pair's second side is positive
TENTATIVE          Complementarity (data)    ``True``: one of those DECIDED that is dropped where it leaves no solution
MOVE               Expression (data)         what changes together, as (component, value): of a pair, another pair whose zero side
                                             it may take over, or None if its first side may become zero; of a Var, where the move
                                             starts it, or ``True``: worth a look only where it is at its lower bound
ARTIFICIAL         Var                       its bounds (low, high) in the homotopy; all its bounds are the method's, not the
                                             plant's, and a certificate looks beyond them
PENALTY            Expression                its weight rho; guides the homotopy, never part of the reported objective
=================  ========================  ===========================================================================
"""

from pyomo.core import Block, Suffix

from pyomo_fesd.timeindex import TimeIndex

CONTINUOUS = 'fesd_continuous'
SELECTOR = 'fesd_selector'
INDICATOR = 'fesd_indicator'
MEMORY = 'fesd_memory'
GUARD = 'fesd_guard'
RESET = 'fesd_reset'
SIDES = 'fesd_sides'
REPLACED = 'fesd_replaced'
DECIDED = 'fesd_decided'
TENTATIVE = 'fesd_tentative'
MOVE = 'fesd_move'
ARTIFICIAL = 'fesd_artificial'
PENALTY = 'fesd_penalty'

#: Blocks that the package generates are named with this prefix; the user's own components never are.
GENERATED = '_pyomo_fesd_'


def mark(block, name, component, value=True):
    """Set mark ``name`` of ``component`` to ``value`` on ``block``; an indexed Var is marked with all its indices."""
    suffix = block.component(name)
    if suffix is None:
        suffix = Suffix(direction=Suffix.LOCAL)
        block.add_component(name, suffix)
    suffix.set_value(component, value, expand=False)


def suffixes(block, name, used=False):
    """The Suffixes that hold mark ``name`` on ``block`` and the active blocks below it; with ``used`` also those used up."""
    active = None if used else True
    found = (s for s in block.component_objects(Suffix, active=active, descend_into=Block) if s.local_name == name)
    # data that pyomo.dae adds to a Block that is switched off as a whole are active
    return (s for s in found if s.parent_block().parent_component().active)


def marked(block, name, used=False):
    """All ``(component, value)`` marked ``name`` on ``block`` and the active blocks below it."""
    for suffix in suffixes(block, name, used):
        yield from suffix.items()


def use_up(block, name, wrt):
    """What mark ``name`` asks for over ``wrt`` has been done: ``marked`` does not find it any more."""
    times = TimeIndex(wrt)
    for suffix in list(suffixes(block, name)):
        if all(times.time(component) is not None for component in suffix):
            suffix.deactivate()


def is_generated(component):
    """Whether ``component`` is, or lies in, a block that one of the transformations made."""
    while component is not None:
        # a name with an index takes time to write
        component = component.parent_component()
        if component.local_name.startswith(GENERATED):
            return True
        component = component.parent_block()
    return False
