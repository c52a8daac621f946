"""Switching functions with one multiplier (theory, eq. 5), from the steps that ``fesd.dcs`` recorded."""

from dataclasses import dataclass
from functools import cached_property

from pyomo.core import Block
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import TimeIndex, all_switched_systems, number_of, source_name

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

    @cached_property
    def values(self) -> dict[float, float]:
        """The values of c by label, of the time of the first use."""
        return {label: number_of(c) for label, c in self.c.items()}


def switching_functions(model: Block, wrt: ContinuousSet) -> list[SwitchingFunction]:
    """Return the switching functions of a transformed model; Stewart's lam belong to modes, so that form has none."""
    times, found = TimeIndex(wrt), {}
    for step in all_switched_systems(model).steps:
        label, name = times.split(step.nu)
        if label is not None:
            if name not in found:
                found[name] = SwitchingFunction(source_name(name), {}, {})
            found[name].nu[label], found[name].c[label] = step.nu, step.c
    return list(found.values())


def largest_value(numbers: dict[float, float]) -> float:
    """Return the largest value of a function of time, given as {label: number}; at least LEAST, the inaccuracy of a zero."""
    return max([LEAST, *map(abs, numbers.values())])
