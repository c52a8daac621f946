"""Modes with hysteresis: a mode goes on until its own region ends, also where another region has begun (eq. E1, E2).

    nu_i in {0, 1} constant between switches,  sum_i nu_i = 1
    nu_i = 1  only where c_ik(x) >= 0 for all k           (the region of mode i, its inequalities)
    nu_i falls from 1 to 0 only where some c_ik(x) = 0     (the region ends)

The regions of the modes overlap; in the overlap the last mode goes on.  Two modes that share no boundary are a relay with
hysteresis; a mode without a condition never ends, such as that of a burst disc.

Takes: a ``HysteresisSystem``.
Leaves: ``nu`` of all modes but the last, ``weight`` of every mode and ``condition`` as Expressions, ``mode`` (eq. 7), and a
    ``HysteresisMode`` in the record of switched systems, from which ``fesd.finite_elements`` makes the law of switching between
    its elements.
Does not apply: to a model on a fixed grid, where no element boundary can lie on the end of a region.
"""

from collections.abc import Iterable

from pyomo.core import Expression, Set, Var
from pyomo.core.base.block import BlockData

from pyomo_fesd.core import FesdError, HysteresisMode, switched_systems
from pyomo_fesd.dcs.reading import HysteresisSystem, ModeSystem

NAME = 'hysteresis'


def applies(system: ModeSystem) -> bool:
    """Whether the system was read with hysteresis."""
    return isinstance(system, HysteresisSystem)


def size(system: ModeSystem) -> int:
    """Return the number of modes."""
    return len(system.modes)


def declare(block: BlockData, sets: tuple, modes: int) -> None:
    """Declare the components of the form over ``sets`` for a number of ``modes``."""
    block.modes = Set(dimen=1, initialize=range(1, modes + 1))
    block.conditions = Set(dimen=1)
    block.nu = Var(*sets, Set(dimen=1, initialize=range(1, modes)), dense=False, bounds=(0, 1))
    block.weight = Expression(*sets, block.modes)
    block.condition = Expression(*sets, block.modes, block.conditions)


def add(block: BlockData, index: tuple, system: ModeSystem) -> None:
    """Add one time of one Disjunction."""
    nu = [block.nu[(*index, i)] for i in range(1, len(system.modes))]
    for i, (nu_i, conditions_i) in enumerate(zip([*nu, 1 - sum(nu)], system.conditions), start=1):
        block.weight[(*index, i)] = nu_i
        for k, c in enumerate(conditions_i, start=1):
            block.conditions.add(k)
            block.condition[(*index, i, k)] = c
        kept = tuple(block.condition[(*index, i, k)] for k in range(1, len(conditions_i) + 1))
        mode = system.modes[i - 1]
        disjunct = mode.innermost[-1] if len(mode.innermost) == 1 else None
        entry = HysteresisMode(system.disjunction, i, disjunct, block.weight[(*index, i)], kept)
        switched_systems(block).hysteresis.append(entry)
    for variable in nu:
        variable.value = 1 / len(system.modes)
        switched_systems(block).selectors.add(variable)
    _fix_given(system.modes, nu)


def _possible_modes(modes):
    """The modes that fixed indicators allow: the one whose disjuncts are fixed to True, or all with none fixed to False."""
    given = [{d.indicator_var.value for d in mode.disjuncts if d.indicator_var.fixed} for mode in modes]
    return [m for m, values in zip(modes, given) if values == {True}] or [m for m, v in zip(modes, given) if False not in v]


def refuse_ambiguous(disjunction, modes) -> None:
    """Refuse indicators that are fixed so that the mode at this time is not clear."""
    possible = _possible_modes(modes)
    on = [m for m in possible if any(d.indicator_var.fixed for d in m.disjuncts)]
    if len(on) > 1:
        raise FesdError(
            disjunction,
            "two modes are fixed to True: " + ', '.join(f"'{m.name}'" for m in on),
            "a switching system is in one mode at a time: fix one indicator only",
        )
    if len(possible) not in (1, len(modes)):
        off = next(d for mode in modes for d in mode.disjuncts if d.indicator_var.fixed)
        raise FesdError(
            disjunction,
            f"the indicator of '{off.name}' is fixed to False, which leaves {len(possible)} other modes",
            "fix the one that comes first to True; deactivate a disjunct that is never active",
        )


def _fix_given(modes, nu):
    """Fix the multipliers where the user fixed an indicator, as at the first time."""
    possible = _possible_modes(modes)
    for variable, mode in zip(nu, modes):
        if len(possible) == 1:
            variable.fix(float(mode is possible[0]))


def weight(block: BlockData, index: tuple, system: ModeSystem, modes):
    """Return the sum of the weights of some of the ``modes``, by number."""
    return sum(block.weight[(*index, i + 1)] for i in modes)


def owners(block: BlockData, index: tuple, system: ModeSystem) -> Iterable:
    """Return nothing: the pairs belong to elements, not to points in time."""
    return []


def equations(block: BlockData, index: tuple) -> list:
    """Return nothing: the form has no equations at points in time."""
    return []
