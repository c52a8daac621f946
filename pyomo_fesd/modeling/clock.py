"""Physical time as a variable, for right-hand sides that depend on time.

    dc/dt = 1,   c = first label at the first label

On movable elements a label of the ContinuousSet is not physical time; a state with derivative 1 is, even with a free final time or
free lengths of control stages.

Takes: a model that is not discretised yet.
Leaves: ``time``, ``rate`` and ``tick`` in a generated block.
Does not apply: to inputs that are constant on each control stage; they need no clock.
"""

from pyomo.core import Block, Constraint, Reference, Var
from pyomo.core.base.var import IndexedVar
from pyomo.dae import ContinuousSet, DerivativeVar

from pyomo_fesd.core import GENERATED, FesdError, discretised, find_continuous_set


def clock(block, wrt=None) -> IndexedVar:
    """Return physical time as a Var over ``wrt``: the first call adds a state, and each call returns a reference to it.

    Write ``pyomo_fesd.clock(m, m.t)[t]`` wherever a rule depends on time ``t``, or give it a name: ``m.time = clock(m.t)``.

    Parameters
    ----------
    block : Block or ContinuousSet
        the model, or a part of it; or ``wrt`` itself
    wrt : ContinuousSet, optional
        default: the only one; the state is added to its block

    Raises
    ------
    FesdError
        if ``wrt`` has no clock yet and is discretised already
    """
    if wrt is None and getattr(block, 'ctype', None) is ContinuousSet:
        block, wrt = block.parent_block(), block
    wrt = find_continuous_set(block, wrt, 'clock')
    parent, name = wrt.parent_block(), f'{GENERATED}clock_{wrt.local_name}'
    if parent.component(name) is None:
        if discretised(wrt):
            raise FesdError(wrt, "clock: it is discretised already, and a new state gets no equations", "make the clock before")
        parent.add_component(name, Block())
        _fill(parent.component(name), wrt)
    # the state has its block already: the reference can get a name in the model
    return Reference(parent.component(name).time, ctype=Var)


def _fill(b, wrt):
    b.time = Var(wrt, initialize=lambda b, t: t)
    b.rate = DerivativeVar(b.time, wrt=wrt)
    b.tick = Constraint(wrt, rule=lambda b, t: b.rate[t] == 1)
    b.time[wrt.first()].fix()
