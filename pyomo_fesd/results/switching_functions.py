"""Switching functions with one multiplier (theory, eq. 5), from the steps that ``fesd.dcs`` recorded."""

from dataclasses import dataclass

from pyomo.core import Block, value
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import TimeIndex, all_switched_systems, source_name

#: A function that is nowhere larger than this is zero.
LEAST = 1e-3


@dataclass(frozen=True)
class SwitchingFunction:
    """One switching function over time.

    Attributes
    ----------
    name : str
        of the Disjunction
    nu : dict label -> VarData
        the multiplier of its positive side
    c : dict label -> expression
    """

    name: str
    nu: dict
    c: dict


def switching_functions(model: Block, wrt: ContinuousSet) -> list[SwitchingFunction]:
    """Return the switching functions of a transformed model; Stewart's lam belong to modes, so that form has none."""
    times, found = TimeIndex(wrt), {}
    for step in all_switched_systems(model).steps:
        label, name = times.split(step.nu)
        if label is not None:
            function = found.setdefault(name, SwitchingFunction(source_name(name), {}, {}))
            function.nu[label], function.c[label] = step.nu, step.c
    return list(found.values())


def largest_value(functions: dict) -> float:
    """Return the largest value of a function of time, given as {label: expression}; at least LEAST, the inaccuracy of a zero."""
    return max([LEAST, *(abs(value(c)) for c in functions.values())])
