"""Read one Disjunction at one time: its modes, its regions, and the variables that the modes define."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import NamedTuple

from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import Stamp, expression_key, refuse_foreign
from pyomo_fesd.dcs.reading.disjunction_tree import DisjunctionTree
from pyomo_fesd.dcs.reading.mode_contents import refuse_contents, refuse_defined_in_regions, refuse_derivatives_in_regions
from pyomo_fesd.dcs.reading.mode_domains import read_laws
from pyomo_fesd.dcs.reading.mode_equations import ModeEquations, read_equations
from pyomo_fesd.dcs.reading.regions import Regions, conditions, read_regions


@dataclass(frozen=True)
class System:
    """One DisjunctionData with its modes.

    Attributes
    ----------
    tree : DisjunctionTree
        the Disjunction with those nested in it
    modes : list of Mode
        the modes that can be active (a deactivated disjunct or one whose indicator is fixed to False is left out)
    """

    tree: DisjunctionTree
    modes: list

    @property
    def disjunction(self):
        """The outermost DisjunctionData."""
        return self.tree.disjunction

    def parts(self) -> list[tuple]:
        """Return every disjunct with the numbers of the modes that it is part of; none for one that is switched off."""
        numbers = {}
        for i, mode in enumerate(self.modes):
            for disjunct in mode.disjuncts:
                numbers.setdefault(id(disjunct), []).append(i)
        return [(disjunct, numbers.get(id(disjunct), [])) for disjunct in self.tree.disjuncts()]


class _Stated(NamedTuple):
    """The constraints of each mode; a key of them all together, if there is one, and its components."""

    equalities: list
    inequalities: list
    key: tuple | None = None
    parts: Sequence = ()


@dataclass(frozen=True)
class ModeSystem(System):
    """One DisjunctionData as a system of modes.

    Attributes
    ----------
    regions : Regions or None
        None also where the regions may overlap (hysteresis)
    equations : ModeEquations or None
        both None where only one mode is left, whose constraints are imposed as they are
    laws : list of lists of Law
        by mode, how its right-hand sides (or its equations, where it is implicit) are continued outside of its region
    stated : _Stated or None
        its components and constraints, if others that are built like it can be recognised
    """

    regions: Regions | None
    equations: ModeEquations | None
    laws: list
    stated: _Stated | None = None

    @property
    def first(self) -> 'ModeSystem':
        """The system that was analysed: this one itself."""
        return self

    @property
    def defined(self) -> list:
        """The variables that the modes define."""
        return [] if self.equations is None else self.equations.defined


@dataclass(frozen=True)
class HysteresisSystem(ModeSystem):
    """One DisjunctionData whose last mode goes on where regions overlap.

    Attributes
    ----------
    conditions : list of lists of expressions
        for each mode the c_ik of its region c_ik >= 0
    """

    conditions: list = field(default_factory=list)


@dataclass(frozen=True)
class RecognisedSystem(System):
    """One DisjunctionData that is built like another one; has all that a ``ModeSystem`` has, made when it is asked for.

    Attributes
    ----------
    first : ModeSystem
        that of the other one
    stamp : Stamp
        from its components to those of others
    stated : _Stated
        its own components and constraints
    """

    first: ModeSystem
    stamp: Stamp
    stated: _Stated

    @property
    def laws(self) -> list:
        """Those of the other one, which do not contain its components."""
        return self.first.laws

    @cached_property
    def defined(self) -> list:
        """The variables that the modes define."""
        return [self.stated.parts[self.stamp.place(v)] for v in self.first.equations.defined]

    @cached_property
    def regions(self) -> Regions:
        """The regions, in expressions of its own components."""
        functions, geometry = self.first.regions.functions, self.first.regions.geometry
        return Regions([self.stamp.expression(c, self.stated.parts) for c in functions], geometry)

    @cached_property
    def equations(self) -> ModeEquations:
        """The equations, in expressions of its own components."""
        return self.first.equations.stamped(self.stamp, self.stated.parts, self.stated.equalities)


@dataclass(frozen=True)
class Analyses:
    """The analyses of Disjunctions, which hold for all that are built alike.

    Attributes
    ----------
    systems : dict key -> (ModeSystem, Stamp)
    patterns, choices : dict name -> dict
        sign patterns, and the variables that modes define, of the times of one Disjunction
    copies : dict id of a ModeSystem of ``systems`` -> BlendedCopies
        what was written for it
    """

    systems: dict = field(default_factory=dict)
    patterns: dict = field(default_factory=dict)
    choices: dict = field(default_factory=dict)
    copies: dict = field(default_factory=dict)


class SystemReader:
    """Reads Disjunctions of one model; the analysis of one is reused for all that are built alike.

    Parameters
    ----------
    variables : TimeVariables
    times : TimeIndex
    analyses : Analyses
        those that are known, to which others are added
    """

    def __init__(self, variables, times, analyses):
        # the components of the model by id, which are kept, so that no other one gets it
        self._variables, self._times, self._own = variables, times, {}
        self._patterns, self._choices, self._read = analyses.patterns, analyses.choices, analyses.systems

    def recognise(self, tree, modes) -> RecognisedSystem | None:
        """Return the ``modes`` that are left of a tree where others that are built alike were read before, else None.

        These contain no operations that ``expression_key`` does not know, such as piecewise functions.
        """
        if len(modes) == 1 or not self._read:
            return None
        stated = self._stated(modes)
        first, stamp = self._read.get(stated.key, (None, None))
        if first is None:
            return None
        refuse_contents(tree, modes)
        self._refuse_foreign(tree, modes, stated)
        return RecognisedSystem(tree, modes, first, stamp, stated)

    def read(self, tree, modes) -> ModeSystem | RecognisedSystem:
        """Read the ``modes`` that are left of a tree; the model is not changed."""
        known = self.recognise(tree, modes)
        if known is not None:
            return known
        refuse_contents(tree, modes)
        if len(modes) == 1:
            return ModeSystem(tree, modes, None, None, [])
        stated = self._stated(modes)
        self._refuse_foreign(tree, modes, stated)
        # regions alone are right at the first time only
        if stated.key is None or not any(stated.equalities):
            return self._study(tree, modes, stated.equalities, stated.inequalities)
        system = self._study(tree, modes, stated.equalities, stated.inequalities, stated)
        self._read[stated.key] = system, Stamp(stated.parts)
        return system

    def _stated(self, modes):
        """The constraints of some modes, with a key of them all together."""
        equalities, inequalities = _split_constraints(modes)
        counts = tuple(map(len, equalities)), tuple(map(len, inequalities))
        key, parts = expression_key(
            [con.expr for con in chain(*equalities, *inequalities)],
            lambda v: (self._variables.kind(v), v.bounds),
        )
        return _Stated(equalities, inequalities, None if key is None else (counts, key), parts)

    def read_hysteresis(self, tree, modes) -> HysteresisSystem:
        """Read two or more modes whose regions may overlap, leave gaps, or have no condition."""
        refuse_contents(tree, modes)
        equalities, inequalities = _split_constraints(modes)
        self._refuse_foreign(tree, modes, _Stated(equalities, inequalities))
        equations = self._equations(tree.disjunction, modes, equalities, inequalities)
        stated = [[c for con in cons for c in conditions(con)] for cons in inequalities]
        refuse_defined_in_regions(tree.disjunction, chain(*stated), equations)
        laws = read_laws(modes, equations, [list(enumerate(cs)) for cs in stated])
        return HysteresisSystem(tree, modes, None, equations, laws, conditions=stated)

    def _study(self, tree, modes, equalities, inequalities, stated=None):
        """Regions and equations of a Disjunction with a new key."""
        equations = self._equations(tree.disjunction, modes, equalities, inequalities)
        patterns = self._patterns.setdefault(self._times.split(tree.disjunction)[1], {})
        regions = read_regions(tree.disjunction, modes, inequalities, patterns)
        refuse_defined_in_regions(tree.disjunction, regions.functions, equations)
        return ModeSystem(tree, modes, regions, equations, read_laws(modes, equations, regions.conditions()), stated)

    def _equations(self, disjunction, modes, equalities, inequalities):
        refuse_derivatives_in_regions(inequalities, self._variables)
        if not any(equalities) and self._times.time(disjunction) == self._times.wrt.first():
            return ModeEquations.none(equalities)
        choice = self._choices.setdefault(self._times.split(disjunction)[1], {})
        return read_equations(disjunction, modes, equalities, self._variables, choice)

    def _refuse_foreign(self, tree, modes, stated):
        """Refuse variables of another model."""
        # units of measure are among the parts, and belong to no model
        components = [part.parent_component() for part in stated.parts if hasattr(part, 'parent_component')]
        if components and all(id(c) in self._own for c in components):
            return
        model = tree.disjunction.model()
        # the parts are all that the constraints mention; where they belong to the model, the constraints need no walk
        if not components or any(c.model() is not model for c in components):
            for mode, cons in zip([*modes, *modes], [*stated.equalities, *stated.inequalities]):
                mentioned = (v for con in cons for v in identify_variables(con.body))
                refuse_foreign(mentioned, model, mode)
        self._own |= {id(c): c for c in components}


def _split_constraints(modes):
    """The equalities and the inequalities of each mode."""
    equalities, inequalities = [[] for _ in modes], [[] for _ in modes]
    for mode, equal, unequal in zip(modes, equalities, inequalities):
        for con in mode.constraints():
            (equal if con.equality else unequal).append(con)
    return equalities, inequalities
