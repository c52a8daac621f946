"""Equations of one element, or of the first time, as a record.

Elements whose equations have the same structure, down to their numbers, are of the same class: one compiled problem serves them
all.  Plants whose data or controls differ from stage to stage need no special treatment.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field

from pyomo.common.collections import ComponentMap
from pyomo.core.base.var import VarData
from pyomo.core.expr import RelationalExpression

from pyomo_fesd.core import Pair, TimeIndex


@dataclass(frozen=True)
class PointPairs:
    """One complementarity condition over time at the labels of one element.

    Attributes
    ----------
    pairs : list of Pair
        one for each label, then the one after the left boundary if a state jumps there
    number : int
        of labels
    continuous : tuple of bool
        which of the two sides enter with their boundary values
    """

    pairs: list[Pair]
    number: int
    continuous: tuple[bool, bool]

    @classmethod
    def read(cls, over_time, element) -> PointPairs:
        """Read a time complementarity in ``element``."""
        start = over_time.starts.get(element.n)
        pairs = [over_time.sides[t] for t in element.own_labels if t in over_time.sides]
        return cls([*pairs, *([] if start is None else [start])], len(pairs), over_time.continuous)

    @property
    def structure(self) -> Hashable:
        """Equal for records that differ in their expressions only."""
        return self.number, len(self.pairs), self.continuous


@dataclass(frozen=True)
class ElementEquations:
    """Everything that determines the unknowns of one element, or of the first time.

    Attributes
    ----------
    rows : list of relational expressions
    event_functions : dict name -> list of relational expressions
        functions that end the element where they fall to zero, one for each of ``labels``
    cross_pairs : list of Pair
        cross complementarity (theory, eq. 11), or the conditions as they are at the first time
    point_pairs : dict name -> PointPairs
        the conditions that the cross pairs aggregate
    conditions : list of ComplementarityData
        all that may determine a variable
    labels, points : tuple of float
        with the right boundary; collocation points only
    length : VarData or None
        the length multiplier of an element
    unknown, known : list of VarData
        variables that the equations determine, and all others that they contain
    bounds : tuple of (lower, upper)
        of the unknowns; states have none, as a simulation goes where the equations lead
    element_class : int
        equal for equations that differ in the values of ``known`` only
    times : TimeIndex
    factor : callable VarData -> the user's ``scaling_factor`` or None
    size_factor : callable VarData -> factor by its size, or None, where there is no such factor of the user
    typical : ComponentMap VarData -> value
        known values at which sizes of the equations are found, where the present ones hide some
    """

    rows: list[RelationalExpression]
    event_functions: dict[str, list[RelationalExpression]]
    cross_pairs: list[Pair]
    point_pairs: dict[str, PointPairs]
    conditions: list
    labels: tuple[float, ...]
    points: tuple[float, ...]
    length: VarData | None
    unknown: list[VarData]
    known: list[VarData]
    bounds: tuple[tuple, ...]
    element_class: int
    times: TimeIndex
    factor: Callable[[VarData], float | None]
    size_factor: Callable[[VarData], float | None] = lambda v: None
    typical: ComponentMap = field(default_factory=ComponentMap)

    @property
    def all_rows(self) -> list[RelationalExpression]:
        """Rows and event functions."""
        return [*self.rows, *(row for rows in self.event_functions.values() for row in rows)]

    @property
    def factors(self) -> ComponentMap:
        """The user's ``scaling_factor`` of unknowns."""
        found = ((v, self.factor(v)) for v in self.unknown)
        return ComponentMap((v, factor) for v, factor in found if factor is not None)

    @property
    def collocated(self) -> list[VarData]:
        """The unknowns at collocation points."""
        return [v for v in self.unknown if self.times.time(v) in self.points]
