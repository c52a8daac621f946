"""Variables over time whose values a simulation takes as given: inputs, prescribed states, controls held on each stage.

Takes: a model on its moving grid.
Leaves: equal values of a held control throughout its control stage.
Does not apply: to states that are fixed at the first and the last time only, which a simulation leaves alone.
"""

from collections.abc import Container, Iterable, Iterator

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint, Var
from pyomo.core.base.var import VarData
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import FesdError, TimeIndex, derivatives, is_indexed_by, variables_of


def read_inputs(inputs: Var | Iterable[Var], wrt: ContinuousSet) -> list[Var]:
    """Return the ``inputs`` as a list of Vars over ``wrt``.

    Raises
    ------
    FesdError
        for anything else
    """
    listed = list(inputs) if isinstance(inputs, (list, tuple)) else [inputs]
    for u in listed:
        if getattr(u, 'ctype', None) is not Var or not is_indexed_by(u, wrt):
            shown = getattr(u, 'name', repr(u))
            raise FesdError(shown, f"simulate: inputs: this is not a Var over '{wrt.name}'", "give e.g. m.u, or [m.u, m.v]")
    return listed


def given_variables(model: Block, times: TimeIndex, inputs: Iterable[Var], held: Constraint) -> ComponentSet:
    """Return the data of ``inputs``, of prescribed states, and of the controls in the equations ``held``."""
    given = ComponentSet(v for u in inputs for v in u.values())
    given.update(v for by_time in prescribed_states(model, times) for v in by_time.values())
    given.update(v for row in held.values() for v in _hold_last_value(row, times))
    return given


def prescribed_states(model: Block, times: TimeIndex) -> Iterator[dict[float, VarData]]:
    """Yield states fixed at every time, which are inputs, such as a flow at the end of a pipe that is a state inside it."""
    for derivative in derivatives(model, times.wrt):
        for over_time in times.families(derivative.get_state_var().values()).values():
            if len(over_time) > 2 and all(v.fixed for v in over_time.values()):
                yield over_time


def hold_first_values(families: Iterable[dict[float, VarData]], first: float, given: Container[VarData]) -> None:
    """Give the variables of each family over time the value of the first time, as a start; ``given`` and fixed ones keep theirs."""
    for over_time in families:
        number = over_time[first].value if first in over_time else None
        for v in over_time.values() if number is not None else ():
            if not v.fixed and v not in given:
                v.set_value(number, skip_validation=True)


def _hold_last_value(row, times):
    """Give the controls of one equation the value that the last of them has, and return them."""
    *others, last = controls = sorted(variables_of([row.body]), key=times.time)
    for control in others:
        control.set_value(last.value, skip_validation=True)
    return controls
