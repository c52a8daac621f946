"""What passes between the three pieces beside Pyomo's own components: marks, as local Suffixes.

A mark is a ``Suffix(direction=LOCAL)`` with one of the names below on the block that holds the marked component.  It survives
``clone``, is never exported to a solver file, and every piece can read it without knowing who wrote it.

=================  ========================  ===========================================================================
mark               on                        value
=================  ========================  ===========================================================================
CONTINUOUS         Var                       the Constraint (of lam, mu, p, n) or Complementarity (of a kink's s) that ties it to
                                             the states: continuous in time where the quantity that switches is
SELECTOR           Var                       ``True``: an independent multiplier nu, free to jump at a switch
INDICATOR          Disjunct                  the expression of its multiplier nu_i (1: mode on, 0: off, between: sliding)
REPLACED           Disjunct,                 ``True``: switched off by logic between modes and not by the user, so new times of
                   LogicalConstraint (data)  it are not switched off too
DECIDED            Complementarity (data)    the inactive Constraint to impose where the pair's second side is positive
ARTIFICIAL         Var                       its upper bound in the homotopy; its bounds are the method's, not the plant's, and a
                                             certificate looks beyond them
PENALTY            Expression                its weight rho; guides the homotopy, never part of the reported objective
=================  ========================  ===========================================================================
"""

from pyomo.core import Block, Suffix

CONTINUOUS = 'fesd_continuous'
SELECTOR = 'fesd_selector'
INDICATOR = 'fesd_indicator'
REPLACED = 'fesd_replaced'
DECIDED = 'fesd_decided'
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


def marked(block, name):
    """All ``(component, value)`` marked ``name`` on ``block`` and the active blocks below it."""
    for suffix in block.component_objects(Suffix, active=True, descend_into=Block):
        if suffix.local_name == name:
            yield from suffix.items()


def is_generated(component):
    """Whether ``component`` is, or lies in, a block that one of the transformations made."""
    while component is not None:
        if component.local_name.startswith(GENERATED):
            return True
        component = component.parent_block()
    return False
