"""Inputs that the user gives at the present times of a ContinuousSet, at the times that discretisation adds.

* A Var that is fixed to one value at all present times is fixed to it at the new ones too.
* So does a mutable Param.
* A Var that is fixed to different values, or a Param that has different ones, says nothing about the new times: an error.

Takes: a model before and after pyomo.dae has added times.
Leaves: Vars that are fixed at the new times.
Does not apply: to states, which may be given at both ends, and to ``controls``, which have the value of their control stage.
"""

import logging
from collections.abc import Sequence

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Param, value
from pyomo.core.base.param import IndexedParam
from pyomo.dae import ContinuousSet
from pyomo.gdp import Disjunct

from pyomo_fesd.core import FesdError, TimeIndex, derivatives, is_indexed_by, own_components, strip_time, variables_below

logger = logging.getLogger('pyomo_fesd')

#: Relative difference of values that are equal.
SAME = 1e-12
#: Names that one warning lists.
SHOWN = 5
REMEDY = (
    "give a time series with pyomo_fesd.signal, or name it in piecewise_constant if it is constant on each control stage; "
    "values that hold at these times only belong into constraints"
)
PLACES = (Block, Disjunct)


def read_fixed_inputs(block: Block, wrt: ContinuousSet, controls: Sequence) -> dict[str, dict]:
    """Return the Vars over time that are fixed at all present times: ``{name: {time: data}}``.

    Raises
    ------
    FesdError
        for one that is fixed to different values
    """
    states = (d.get_state_var() for d in derivatives(block, wrt))
    known = ComponentSet([*states, *(v for u in controls for v in (u, *u.values()))])
    variables = variables_below(block, descend_into=PLACES)
    others = [v for v in variables if v not in known and v.parent_component() not in known]
    if not any(v.fixed for v in others):
        return {}
    families = TimeIndex(wrt).families(others).items()
    found = {strip_time(name): by_time for name, by_time in families if len(by_time) > 1 and all(v.fixed for v in by_time.values())}
    for by_time in found.values():
        _refuse_different_values(by_time, wrt)
    return found


def _refuse_different_values(by_time, wrt):
    (first, data), *others = by_time.items()
    for t, other in others:
        if None not in (data.value, other.value) and abs(other.value - data.value) > SAME * max(abs(data.value), abs(other.value)):
            raise FesdError(
                data,
                f"it is fixed at every time that the model has, to {data.value:g} at {first:g} and {other.value:g} at {t:g}, but "
                "has no value at the times between, which discretisation adds",
                REMEDY,
            )


def fix_at_new_times(inputs: dict[str, dict], wrt: ContinuousSet) -> None:
    """Fix these inputs at all times, and say so."""
    times = TimeIndex(wrt)
    for by_time in inputs.values():
        given = next(iter(by_time.values()))
        for t in wrt:
            if t not in by_time and given.value is not None:
                _fix_at(times, given, t)
    if inputs:
        names = list(inputs)
        more = f' and {len(names) - SHOWN} more' if len(names) > SHOWN else ''
        logger.warning(
            "fixed at every time that the model had, and so at the times that discretisation adds: %s%s. "
            "Unfix them there if they are no inputs.",
            ', '.join(names[:SHOWN]),
            more,
        )


def _fix_at(times, given, t):
    try:
        times.at(given, t).fix(given.value)
    except KeyError:
        pass  # it does not exist there


def complete_params(block: Block, wrt: ContinuousSet, controls: Sequence, error: Exception | None = None) -> None:
    """Give a mutable Param with one value at all times this value where rules have asked for it at a new time.

    Raises
    ------
    FesdError
        naming a Param that has other values, or that cannot change
    """
    given = ComponentSet(controls)
    for param in own_components(block.model(), Param, PLACES):
        if isinstance(param, IndexedParam) and is_indexed_by(param, wrt) and param not in given:
            if param.mutable:
                _complete(param)
            elif error is not None and f'({param.name}[' in str(error):
                raise FesdError(param, "it has no value at the times that discretisation adds", f"give it a default; {REMEDY}")


def _complete(param):
    values = {index: value(data, exception=False) for index, data in param._data.items()}
    missing, known = [index for index, number in values.items() if number is None], set(values.values()) - {None}
    if missing and len(known) != 1:
        raise FesdError(param, f"it has no value at {missing[0]}, a time that discretisation adds", REMEDY)
    for index in missing:
        param[index].set_value(*known)
