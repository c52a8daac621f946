"""One Disjunction at one time, as read: its modes, its regions and what the modes define."""

from dataclasses import dataclass
from itertools import chain

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, LogicalConstraint
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import DerivativeVar
from pyomo.gdp import Disjunct
from pyomo.mpec import Complementarity

from pyomo_fesd.dcs.modes import ModeEquations, read_equations
from pyomo_fesd.dcs.nested import Tree
from pyomo_fesd.dcs.regions import Regions, read_regions
from pyomo_fesd.dcs.shape import Swap, shape
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import refuse_foreign


@dataclass(frozen=True)
class System:
    """What one DisjunctionData says.

    Attributes
    ----------
    tree : Tree
        the Disjunction with those nested in it
    modes : list of Mode
        the modes that can be active (a deactivated disjunct or one whose indicator is fixed to False is left out)
    regions : Regions or None
    equations : ModeEquations or None
        both None where only one mode is left: its constraints then simply hold
    """

    tree: Tree
    modes: list
    regions: Regions
    equations: ModeEquations

    @property
    def disjunction(self):
        """The outermost DisjunctionData."""
        return self.tree.disjunction


#: What a disjunct over time cannot contain, a Disjunct only if it is another's, and what to do about it.
REFUSED_INSIDE = {
    Disjunct: (
        "contains the Disjunct '{}', which belongs to no active Disjunction at the same time",
        "write a Disjunction of the inner disjuncts, or deactivate it",
    ),
    LogicalConstraint: ("contains a LogicalConstraint, '{}'", "state the mode by its region and its equations only"),
    Complementarity: ("contains a Complementarity, '{}'", "declare it outside the disjuncts, over time"),
}


class Reader:
    """Reads Disjunctions of one model; keeps what is the same for all of them.

    Parameters
    ----------
    derivatives : iterable of DerivativeVar
        those with respect to the time that the Disjunctions are indexed by
    times : TimeIndex
    """

    def __init__(self, derivatives, times):
        derivatives = list(derivatives)
        self._derivatives = ComponentSet(derivatives)
        self._states = ComponentSet(d.get_state_var() for d in derivatives)
        self._times = times
        self._patterns = {}
        self._choices = {}
        self._read, self._own = {}, ComponentSet()

    def is_derivative(self, v):
        """Whether ``v`` is data of a derivative with respect to time."""
        return v.parent_component() in self._derivatives

    def is_state(self, v):
        """Whether ``v`` is data of a differential state."""
        return v.parent_component() in self._states

    def read(self, tree, modes):
        """Read the ``modes`` that are left of a tree into a ``System``; the model is not changed."""
        self._refuse_all_contents(tree, modes)
        if len(modes) == 1:
            return System(tree, modes, None, None)
        split = [_constraints(mode) for mode in modes]
        counts = tuple((len(equalities), len(inequalities)) for equalities, inequalities in split)
        key, parts = shape([con.expr for con in chain(*chain(*split))], self._kind)
        self._refuse_foreign(tree, modes, split, parts)
        known = None if key is None else self._read.get((counts, key))
        if known is not None:
            first, places = known
            return System(tree, modes, *_swapped(first, Swap(places, parts), split))
        system = System(tree, modes, *self._study(tree.disjunction, modes, split))
        if key is not None:
            self._read[counts, key] = system, parts
        return system

    def contents(self, tree, modes):
        """What two or more modes define (``ModeEquations``), and the inequalities of each."""
        self._refuse_all_contents(tree, modes)
        split = [_constraints(mode) for mode in modes]
        self._refuse_foreign(tree, modes, split)
        return self._equations(tree.disjunction, modes, split), [inequalities for _, inequalities in split]

    def _kind(self, v):
        """What matters of a variable for what is read."""
        return self.is_derivative(v), self.is_state(v)

    def _study(self, disjunction, modes, split):
        """Regions and equations of a Disjunction of a new shape."""
        equations = self._equations(disjunction, modes, split)
        patterns = self._patterns.setdefault(self._times.split(disjunction)[1], {})
        regions = read_regions(disjunction, modes, [inequalities for _, inequalities in split], patterns)
        refuse_defined_in_regions(disjunction, regions.functions, equations)
        return regions, equations

    def _equations(self, disjunction, modes, split):
        self._refuse_derivatives_in_regions(split)
        choice = self._choices.setdefault(self._times.split(disjunction)[1], {})
        equalities = [equalities for equalities, _ in split]
        return read_equations(disjunction, modes, equalities, self.is_derivative, self.is_state, choice)

    def _refuse_foreign(self, tree, modes, split, parts=None):
        """Refuse variables of another model; ``parts`` are all that there are, if they are known."""
        # units of measure are among the parts, and belong to no model
        homes = parts and ComponentSet(part.parent_component() for part in parts if hasattr(part, 'parent_component'))
        if homes and all(home in self._own for home in homes):
            return
        for mode, constraints in zip(modes, split):
            mentioned = (v for c in chain(*constraints) for v in identify_variables(c.body))
            refuse_foreign(mentioned, tree.disjunction.model(), mode)
        self._own.update(homes or ())

    def _refuse_all_contents(self, tree, modes):
        known = ComponentSet(tree.disjuncts())
        for disjunct in ComponentSet(d for mode in modes for d in mode.disjuncts):
            _refuse_contents(disjunct, known)

    def _refuse_derivatives_in_regions(self, split):
        for _, inequalities in split:
            for con in inequalities:
                for v in identify_variables(con.body, include_fixed=True):
                    if self.is_derivative(v):
                        raise FesdError(
                            con,
                            f"the region condition contains the derivative '{v.name}'",
                            "say where a mode holds by the states; a rate that decides makes the modes depend on themselves",
                        )


def _swapped(system, swap, split):
    """Regions and equations of ``system`` with other variables; ``split`` are the constraints that contain them."""
    regions = Regions([swap.expression(c) for c in system.regions.functions], system.regions.geometry)
    return regions, system.equations.swapped(swap, [equalities for equalities, _ in split])


def _refuse_contents(disjunct, known):
    """Refuse a disjunct that contains what no mode can; ``known`` are the disjuncts of the same tree."""
    for component in disjunct.component_objects(descend_into=Block):
        if isinstance(component, DerivativeVar):
            raise FesdError(component, "a DerivativeVar inside a disjunct", "declare it on the block that holds its state")
        if component.ctype in REFUSED_INSIDE and component.active:
            cause, fix = REFUSED_INSIDE[component.ctype]
            for inside in component.values():
                if inside.active and inside not in known:
                    raise FesdError(disjunct, cause.format(inside.name), fix)


def refuse_defined_in_regions(disjunction, functions, equations):
    """A region condition must not contain what the modes define: it would jump at the switch."""
    defined = ComponentSet(equations.defined)
    for c in functions:
        for v in identify_variables(c, include_fixed=True):
            if v in defined:
                raise FesdError(
                    disjunction,
                    f"the region condition '{c} >= 0' contains '{v.name}', which the modes themselves define",
                    "say where a mode holds by the states, or by variables that do not jump at the switch",
                )


def _constraints(mode):
    """The equalities and the inequalities of a mode."""
    equalities, inequalities = [], []
    for con in mode.constraints():
        (equalities if con.equality else inequalities).append(con)
    return equalities, inequalities


def refuse_twice_defined(systems, known):
    """Two Disjunctions that define the same variable over-determine it.

    Parameters
    ----------
    known : ComponentMap VarData -> DisjunctionData
        what was transformed before
    """
    owners = ComponentMap(known)
    for system in systems:
        for v in system.equations.defined if system.equations is not None else ():
            if v in owners:
                raise FesdError(
                    v,
                    f"both '{owners[v].name}' and '{system.disjunction.name}' define it",
                    "let each Disjunction define a contribution of its own, and add them up: m.dx[t] == m.F1[t] + m.F2[t]",
                )
            owners[v] = system.disjunction
