"""A clock: the time of the plant as a variable, for right-hand sides that depend on time.

    dc/dt = 1,   c = first label at the first label

Once elements move, a label of the ContinuousSet is not physical time; a state with derivative 1 is, also where the final time or
the stage lengths are free.

Takes: a model that is not discretised yet.
Leaves: ``time``, ``rate`` and ``tick`` in a block of its own.
Does not apply: to inputs that are constant on each control stage; they need no clock.
"""

from pyomo.core import Block, Constraint, Var
from pyomo.dae import DerivativeVar

from pyomo_fesd import marks
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import discretised, find_continuous_set


def clock(block, wrt=None):
    """Physical time as a Var over ``wrt``; the first call adds it, later ones return the same.

    Write ``pyomo_fesd.clock(m, m.t)[t]`` wherever a rule depends on time ``t``.

    Parameters
    ----------
    block : Block
        the model, or a part of it
    wrt : ContinuousSet, optional
        may be left out if there is only one; the clock is put beside it

    Raises
    ------
    FesdError
        if ``wrt`` has no clock yet and is discretised already
    """
    wrt = find_continuous_set(block, wrt, 'clock')
    home = wrt.parent_block()
    name = f'{marks.GENERATED}clock_{wrt.local_name}'
    if home.component(name) is None:
        if discretised(wrt):
            raise FesdError(wrt, "clock: it is discretised already, and a new state gets no equations", "make the clock before")
        home.add_component(name, Block())
        _add(home.component(name), wrt)
    return home.component(name).time


def _add(b, wrt):
    b.time = Var(wrt, initialize=lambda b, t: t)
    b.rate = DerivativeVar(b.time, wrt=wrt)
    b.tick = Constraint(wrt, rule=lambda b, t: b.rate[t] == 1)
    b.time[wrt.first()].fix()
