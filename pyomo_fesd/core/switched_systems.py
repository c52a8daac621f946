"""The record of switched systems: components that switch, their multipliers, and how to write them at further times.

Written by ``fesd.dcs``, ``fesd.smooth_to_complementarity``, ``state_jump`` and the unit models; read by
``fesd.finite_elements`` and by the results.  Each block that holds such components has one record, so that a block keeps its
record when it is cloned, and loses it when it is deleted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block

from pyomo_fesd.core.private_data import records_below
from pyomo_fesd.core.time_index import discretised

_SCOPE = 'pyomo_fesd.core.switched_systems'


@dataclass(frozen=True)
class HysteresisMode:
    """One mode with hysteresis at one time.

    Attributes
    ----------
    disjunction : DisjunctionData
        the outermost one
    number : int
        of the mode in its system, 1..
    disjunct : DisjunctData or None
        the innermost disjunct, None where the mode combines several
    weight : ExpressionData
        nu_i, 1 or 0 in an element
    conditions : tuple of ExpressionData
        c_ik; the mode goes on until one of c_ik >= 0 ends
    """

    disjunction: Any
    number: int
    disjunct: Any
    weight: Any
    conditions: tuple


@dataclass(frozen=True)
class Reset:
    """One law of state jumps at one time.

    Attributes
    ----------
    block : BlockData
        the block that ``state_jump`` made
    guard : ExpressionData
        the state jumps where it falls to 0 from above
    resets : tuple of (VarData, ExpressionData)
        the states with their values after the jump
    """

    block: Any
    guard: Any
    resets: tuple


@dataclass(frozen=True)
class Contact:
    """One rigid contact at one time.

    Attributes
    ----------
    block : BlockData
        the block that ``contact`` made
    gap : ExpressionData
        the distance, never negative
    distance : VarData
        the variable >= 0 that equals the gap
    forces : tuple of VarData
        the contact force, or those along the two edges of the friction cone: 0 <= their sum perp distance >= 0
    touching : ComplementarityData
        this condition
    restitution : number or expression
        e, the part of the normal velocity that an impact returns
    sticking : ComplementarityData or None
        the condition that closed bodies do not slip
    """

    block: Any
    gap: Any
    distance: Any
    forces: tuple
    touching: Any
    restitution: Any
    sticking: Any = None


class Step(NamedTuple):
    """One step function at one time (eq. 5).

    Attributes
    ----------
    nu : VarData
        1 where c > 0, 0 where c < 0, between while c stays at 0
    c : expression
        the switching function
    """

    nu: Any
    c: Any


class Dependents(NamedTuple):
    """Generated variables of one time that follow from expressions, such as p, n and nu from a switching function.

    Attributes
    ----------
    variables : tuple of VarData
    arguments : tuple of expressions
    values : callable (list of float) -> list of float
        the values of the variables at values of the arguments; nan where they leave a variable open
    """

    variables: tuple
    arguments: tuple
    values: Callable


@dataclass(frozen=True)
class Surface:
    """One surface of a piecewise function at one time.

    Attributes
    ----------
    variable : VarData
        the positive part or the step that belongs to the surface
    name : str
    sides : dict str -> expression
        for each side an expression that is positive where the argument is on this side
    """

    variable: Any
    name: str
    sides: dict


class TimeWriter(AutoSlots.Mixin):
    """One application of a transformation over time, which can be continued at the times that discretisation adds.

    Attributes
    ----------
    block : BlockData
        where the transformation was applied
    wrt : ContinuousSet
    """

    __slots__ = ('block', 'wrt')

    def __init__(self, block, wrt):
        self.block, self.wrt = block, wrt

    def write(self) -> None:
        """Write the switched systems at all times at which they are not written yet."""
        raise NotImplementedError

    def integrand(self, owner) -> Callable:
        """Return a function that rewrites an integrand of the Integral ``owner``, which is built after the transformation."""
        return lambda expression: expression


#: Entries of a record -> their container.
ENTRIES = (
    dict.fromkeys(('continuous', 'multipliers'), ComponentMap)
    | dict.fromkeys(('selectors', 'excluded', 'signals'), ComponentSet)
    | dict.fromkeys(('steps', 'dependents', 'surfaces', 'hysteresis', 'resets', 'contacts'), list)
    | dict.fromkeys(('writers', 'waiting', 'breakpoints'), list)
)


class SwitchedSystems(AutoSlots.Mixin):
    """The switched systems among the components of one block.

    Attributes
    ----------
    continuous : ComponentMap
        Var (or data) -> the Constraint (of lam, mu, p, n), Complementarity (of a positive part) or Expression (the arguments of
        interpolation weights) that ties it to the states: continuous in time where the quantity that switches is
    selectors : ComponentSet
        Vars (or data): independent multipliers nu, free to jump at a switch
    multipliers : ComponentMap
        DisjunctData -> the expression nu_i of its mode (1: active, 0: inactive, between: sliding)
    excluded : ComponentSet
        DisjunctData and LogicalConstraintData that logic between modes switched off, not the user: at further times they are
        written again
    steps : list of Step
    dependents : list of Dependents
    surfaces : list of Surface
    hysteresis : list of HysteresisMode
    resets : list of Reset
    contacts : list of Contact
    writers : list of TimeWriter
        applications of transformations
    waiting : list of TimeWriter
        those whose ContinuousSet was not discretised when they were applied
    signals : ComponentSet
        Vars over time with the values of a time series
    breakpoints : list of (ContinuousSet, float)
        points that a signal added: boundaries of elements, but not of control stages
    """

    __slots__ = tuple(ENTRIES)

    def __init__(self):
        for name, container in ENTRIES.items():
            setattr(self, name, container())

    def forget(self, gone: ComponentSet) -> None:
        """Remove the entries of components that are deleted."""
        for entries in (self.continuous, self.multipliers):
            for component in [component for component in entries if component in gone]:
                del entries[component]
        self.selectors -= gone
        self.excluded -= gone
        self.steps = [step for step in self.steps if step.nu not in gone]
        self.dependents = [one for one in self.dependents if not any(v in gone for v in one.variables)]
        self.surfaces = [surface for surface in self.surfaces if surface.variable not in gone]


Block.register_private_data_initializer(SwitchedSystems, scope=_SCOPE)


def switched_systems(block) -> SwitchedSystems:
    """Return the record of ``block`` itself, for writing."""
    return block.private_data(_SCOPE)


class AllSwitchedSystems:
    """The entries of several records, for reading: most readers need one kind, which is merged when it is asked for."""

    def __init__(self, records: Sequence[SwitchedSystems]):
        self._records = records

    def __getattr__(self, name):
        # called once for each name: then it is an attribute
        if name not in ENTRIES:
            raise AttributeError(name)
        found = ENTRIES[name]()
        add = found.extend if isinstance(found, list) else found.update
        for entries in filter(None, (getattr(record, name) for record in self._records)):
            add(entries)
        setattr(self, name, found)
        return found


def all_switched_systems(block) -> AllSwitchedSystems:
    """Return the entries of ``block`` and of all active blocks below it."""
    return AllSwitchedSystems(list(records_below(block, _SCOPE)))


def signals(wrt) -> list:
    """Return the signals over ``wrt``, and the rates of linear ones."""
    found = (v for record in records_below(wrt.model(), _SCOPE) for v in record.signals)
    return [v for v in found if v.index_set() is wrt]


def signal_breakpoints(wrt) -> set[float]:
    """Return the points of ``wrt`` that signals added."""
    return {t for record in records_below(wrt.model(), _SCOPE) for other, t in record.breakpoints if other is wrt}


def add_writer(writer: TimeWriter) -> None:
    """Remember that a transformation was applied; it continues where ``wrt`` gets its points later."""
    record = switched_systems(writer.block)
    if not any(type(other) is type(writer) and other.wrt is writer.wrt for other in record.writers):
        # integrands pass each kind of transformation once
        record.writers.append(writer)
    if not discretised(writer.wrt):
        record.waiting.append(writer)


def integrand_rewriter(integral, wrt) -> Callable:
    """Return a function that sends an integrand of ``integral`` through all transformations applied over ``wrt``."""
    writers = (writer for record in records_below(integral.model(), _SCOPE) for writer in record.writers)
    steps = [writer.integrand(integral) for writer in writers if writer.wrt is wrt]
    return lambda expression: reduce(lambda e, step: step(e), steps, expression)


def write_at_further_times(block, wrt) -> None:
    """Let the transformations that were applied before ``wrt`` got its points continue at the new ones."""
    for record in records_below(block, _SCOPE):
        mine = [writer for writer in record.waiting if writer.wrt is wrt]
        record.waiting = [writer for writer in record.waiting if writer.wrt is not wrt]
        for writer in mine:
            writer.write()
