"""One Disjunction at one time, as read: its modes, its regions and what the modes define."""

from dataclasses import dataclass

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, BooleanVar, Constraint, LogicalConstraint, Var
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import DerivativeVar
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd.dcs.modes import ModeEquations, read_equations
from pyomo_fesd.dcs.regions import Regions, read_regions
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import refuse_foreign


@dataclass(frozen=True)
class System:
    """What one DisjunctionData says.

    Attributes
    ----------
    disjunction : DisjunctionData
    modes : list of DisjunctData
        the modes that can be active (a deactivated disjunct or one whose indicator is fixed to False is left out)
    regions : Regions or None
    equations : ModeEquations or None
        both None where only one mode is left: its constraints then simply hold
    """

    disjunction: object
    modes: list
    regions: Regions
    equations: ModeEquations


#: What a disjunct over time cannot contain, and what to do about it.
REFUSED_INSIDE = {
    Disjunction: ("contains another Disjunction", "nested switching is not supported yet: write the modes in one Disjunction"),
    Disjunct: ("contains another Disjunct", "nested switching is not supported yet: write the modes in one Disjunction"),
    LogicalConstraint: ("contains a LogicalConstraint", "state the mode by its region and its equations only"),
    Complementarity: ("contains a Complementarity", "declare it outside the disjuncts, over time"),
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

    def is_derivative(self, v):
        """Whether ``v`` is data of a derivative with respect to time."""
        return v.parent_component() in self._derivatives

    def is_state(self, v):
        """Whether ``v`` is data of a differential state."""
        return v.parent_component() in self._states

    def read(self, disjunction):
        """Read one DisjunctionData into a ``System``; the model is not changed."""
        modes = self.modes(disjunction)
        if len(modes) == 1:
            return System(disjunction, modes, None, None)
        equations, inequalities = self.contents(disjunction, modes)
        patterns = self._patterns.setdefault(self._times.split(disjunction)[1], {})
        regions = read_regions(disjunction, modes, inequalities, patterns)
        refuse_defined_in_regions(disjunction, regions.functions, equations)
        return System(disjunction, modes, regions, equations)

    def modes(self, disjunction, fixed_are_left_out=True):
        """The disjuncts that can be active; a fixed indicator decides unless it says only which mode comes first."""
        if not disjunction.xor:
            raise FesdError(
                disjunction,
                "it is declared with xor=False: several modes may be active at once",
                "a switching system is in one mode at a time: leave xor at True",
            )
        modes = [d for d in disjunction.disjuncts if self._possible(disjunction, d, fixed_are_left_out)]
        chosen = [d for d in modes if d.indicator_var.fixed and d.indicator_var.value]
        if len(chosen) > 1:
            raise FesdError(
                disjunction,
                "two modes are fixed to True: " + ', '.join(f"'{d.name}'" for d in chosen),
                "a switching system is in one mode at a time: fix one indicator only",
            )
        if fixed_are_left_out:
            modes = chosen or modes
        if not modes:
            raise FesdError(disjunction, "all its disjuncts are switched off", "activate one, or deactivate the Disjunction")
        for disjunct in modes:
            self._refuse_contents(disjunct)
        return modes

    def contents(self, disjunction, modes):
        """What two or more modes define (``ModeEquations``), and the inequalities of each."""
        split = [_constraints(d) for d in modes]
        for disjunct, (equalities, inequalities) in zip(modes, split):
            mentioned = (v for c in (*equalities, *inequalities) for v in identify_variables(c.body))
            refuse_foreign(mentioned, disjunction.model(), disjunct)
        self._refuse_derivatives_in_regions(split)
        choice = self._choices.setdefault(self._times.split(disjunction)[1], {})
        equalities, inequalities = ([part[k] for part in split] for k in (0, 1))
        equations = read_equations(disjunction, modes, equalities, self.is_derivative, self.is_state, choice)
        return equations, inequalities

    @staticmethod
    def _possible(disjunction, disjunct, fixed_are_left_out):
        if disjunct.active:
            off = disjunct.indicator_var.fixed and disjunct.indicator_var.value is False
            return not (off and fixed_are_left_out)
        if disjunct.transformation_block is not None:
            raise FesdError(
                disjunct,
                f"another transformation has already treated this disjunct of '{disjunction.name}'",
                "apply fesd.dcs instead of, not after, gdp.bigm or gdp.hull",
            )
        return False

    @staticmethod
    def _refuse_contents(disjunct):
        for ctype, (cause, fix) in REFUSED_INSIDE.items():
            inside = next(disjunct.component_data_objects(ctype, active=True, descend_into=Block), None)
            if inside is not None:
                raise FesdError(disjunct, f"{cause}, '{inside.name}'", fix)
        for ctype in (Var, DerivativeVar):
            for var in disjunct.component_objects(ctype, descend_into=Block):
                if isinstance(var, DerivativeVar):
                    raise FesdError(var, "a DerivativeVar inside a disjunct", "declare it on the block that holds its state")

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


def _constraints(disjunct):
    """The equalities and the inequalities of a disjunct."""
    equalities, inequalities = [], []
    for con in disjunct.component_data_objects(Constraint, active=True, descend_into=Block):
        (equalities if con.equality else inequalities).append(con)
    return equalities, inequalities


def refuse_logic_over_time(block, time):
    """LogicalConstraints and BooleanVars over time are not part of a switching system.

    Parameters
    ----------
    time : callable ComponentData -> time label or None
    """
    for ctype in (LogicalConstraint, BooleanVar):
        for data in block.component_data_objects(ctype, active=True, descend_into=Block):
            if time(data) is not None:
                raise FesdError(
                    data,
                    f"a {ctype.__name__} over time",
                    "the state decides the mode: write logic between modes as regions of one Disjunction",
                )
