"""Modes with memory (hysteresis): a mode goes on until its own region ends, also where that of another has begun (eq. E1, E2).

    nu_i in {0, 1} constant between switches,  sum_i nu_i = 1
    nu_i = 1  only where c_ik(x) >= 0 for all k           (the region of mode i, its inequalities)
    nu_i falls from 1 to 0 only where some c_ik(x) = 0     (the region ends)

The regions of the modes overlap; in the overlap the last mode decides.  Two modes that share no boundary are a relay with
hysteresis; a mode without a condition never ends, such as that of a disc that has burst.

Takes: a ``MemorySystem``.
Leaves: ``nu`` of all modes but the last, ``weight`` of every mode and ``condition`` as Expressions, ``mode`` (eq. 7), and the mark
MEMORY, from which ``fesd.finite_elements`` makes the law of switching between its elements (``elements/memory.py``).
Does not apply: to a model on a fixed grid, where no element boundary can lie on the end of a region.
"""

from dataclasses import dataclass

from pyomo.core import Expression, Set, Var

from pyomo_fesd import marks
from pyomo_fesd.dcs.modes import ModeEquations
from pyomo_fesd.dcs.nested import Tree
from pyomo_fesd.dcs.regions import conditions
from pyomo_fesd.dcs.system import refuse_defined_in_regions
from pyomo_fesd.errors import FesdError

NAME = 'memory'


@dataclass(frozen=True)
class MemorySystem:
    """One Disjunction with memory at one time.

    Attributes
    ----------
    tree : Tree
    modes : list of Mode
    conditions : list of lists of expressions
        for each mode the c_ik of its region c_ik >= 0
    equations : ModeEquations
    """

    tree: Tree
    modes: list
    conditions: list
    equations: ModeEquations
    regions = None  # they overlap, so signs do not tell the mode

    @property
    def disjunction(self):
        """The outermost DisjunctionData."""
        return self.tree.disjunction


def read(reader, tree, modes):
    """Read a Disjunction whose last mode decides where regions overlap.

    Raises
    ------
    FesdError
        for what every Disjunction is refused for, but not for overlaps, gaps, or modes without a region
    """
    equations, inequalities = reader.contents(tree, modes)
    regions = [[c for con in constraints for c in conditions(con)] for constraints in inequalities]
    refuse_defined_in_regions(tree.disjunction, [c for region in regions for c in region], equations)
    _refuse_ambiguous(tree.disjunction, modes)
    return MemorySystem(tree, modes, regions, equations)


def applies(system):
    """Systems that were read as such."""
    return isinstance(system, MemorySystem)


def size(system):
    """Number of modes."""
    return len(system.modes)


def declare(block, index, modes):
    """Declare the components of the form over ``index`` (a tuple of sets) for a number of ``modes``."""
    block.modes = Set(dimen=1, initialize=range(1, modes + 1))
    block.conditions = Set(dimen=1)
    block.nu = Var(*index, Set(dimen=1, initialize=range(1, modes)), dense=False, bounds=(0, 1))
    block.weight = Expression(*index, block.modes)
    block.condition = Expression(*index, block.modes, block.conditions)


def add(block, index, system):
    """Add one time of one Disjunction."""
    nu = [block.nu[(*index, i)] for i in range(1, len(system.modes))]
    for i, (one, stated) in enumerate(zip([*nu, 1 - sum(nu)], system.conditions), start=1):
        block.weight[(*index, i)] = one
        for k, c in enumerate(stated, start=1):
            block.conditions.add(k)
            block.condition[(*index, i, k)] = c
        kept = tuple(block.condition[(*index, i, k)] for k in range(1, len(stated) + 1))
        marks.mark(block, marks.MEMORY, block.weight[(*index, i)], kept)
    for variable in nu:
        variable.value = 1 / len(system.modes)
        marks.mark(block, marks.SELECTOR, variable)
    _take_given(system.modes, nu)


def _possible(modes):
    """The modes that fixed indicators leave open: the one whose disjuncts are fixed to True, or all with none fixed to False."""
    given = [{d.indicator_var.value for d in mode.disjuncts if d.indicator_var.fixed} for mode in modes]
    return [m for m, values in zip(modes, given) if values == {True}] or [m for m, v in zip(modes, given) if False not in v]


def _refuse_ambiguous(disjunction, modes):
    possible = _possible(modes)
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


def _take_given(modes, nu):
    """An indicator that the user fixed, as that of the mode at the first time, fixes the multipliers."""
    possible = _possible(modes)
    for variable, mode in zip(nu, modes):
        if len(possible) == 1:
            variable.fix(float(mode is possible[0]))


def weight(block, index, system, modes):
    """The sum of the weights of some of the ``modes``, by number."""
    return sum(block.weight[(*index, i + 1)] for i in modes)


def owners(system):
    """No pair belongs to a point in time; the conditions are those of the elements."""
    return []


def equations(block, index):
    """The equations of one time."""
    return []
