"""What holds in one element of a moving grid, read from the model: equations, signs, pairs, unknowns.

Elements whose equations look the same, down to their numbers, are of the same ``kind``: one compiled problem serves them all.  So
plants whose data or controls differ from stage to stage need no special treatment.

Takes: a model after ``fesd.finite_elements``.
Leaves: nothing; the model is only read.
Does not apply: to inequalities of the user, which do not determine a simulation.
"""

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint
from pyomo.core.base.suffix import Suffix, SuffixFinder
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.complementarity import read
from pyomo_fesd.elements.cross import families_of
from pyomo_fesd.march.structure import Look
from pyomo_fesd.timeindex import DISCRETISATION, derivatives

#: What stands in lists on the block of the grid, but belongs to one point in time.
LISTS = ('nonnegative', 'left_limit')


@dataclass(frozen=True)
class Equations:
    """The problem of one element, or of the first time.

    Attributes
    ----------
    rows : list of relational expressions
    limits : dict name -> list of relational expressions
        functions that end the element where they fall to zero, one for each of ``labels``
    pairs : list of Pair
    points : dict name -> Points
        what the pairs stand for
    conditions : list of ComplementarityData
        all that may determine a variable
    labels : tuple of float
        points in time: the stage points, the right boundary
    length : VarData or None
        the length multiplier of an element
    unknown : list of VarData
        what the problem determines
    known : list of VarData
    kind : int
        the same for problems that differ only in the values of what is known
    reader : Reader
    """

    rows: list
    limits: dict
    pairs: list
    points: dict
    conditions: list
    labels: tuple
    length: object
    unknown: list
    known: list
    kind: int
    reader: object

    @property
    def all_rows(self):
        """Those of the limits too."""
        return [*self.rows, *(row for rows in self.limits.values() for row in rows)]

    @property
    def bounds(self):
        """``(lower, upper)`` of the unknowns; states have none, as a simulation goes where the equations lead."""
        return [self.reader.bounds(v) for v in self.unknown]

    @property
    def factors(self):
        """The user's ``scaling_factor`` of unknowns, as a ComponentMap."""
        found = ((v, self.reader.factor(v)) for v in self.unknown)
        return ComponentMap((v, factor) for v, factor in found if factor is not None)

    @property
    def timed(self):
        """The unknowns at stage points."""
        stages = self.reader.stage_labels(self.labels)
        return [v for v in self.unknown if self.reader.time(v) in stages]


@dataclass(frozen=True)
class Points:
    """A family of conditions in one element.

    Attributes
    ----------
    pairs : list of Pair
        one for each label, then the one after the left boundary if a state jumps there
    labels : int
        how many labels
    continuous : tuple of bool
        which of the two sides enter with their boundary values
    """

    pairs: list
    labels: int
    continuous: tuple

    @classmethod
    def of(cls, family, element, labels):
        """Those of ``family``."""
        start = family.starts.get(element.n)
        pairs = [family.sides[t] for t in labels if t in family.sides]
        return cls([*pairs, *([] if start is None else [start])], len(pairs), family.continuous)

    @property
    def kind(self):
        """Equal for families that differ in their values only."""
        return self.labels, len(self.pairs), self.continuous


def own_labels(element):
    """The labels of an element without its left boundary."""
    return tuple(dict.fromkeys((*element.points, element.right)))


def variables_of(expressions):
    """All variables of ``expressions``, fixed ones too, each once."""
    found = ComponentSet()
    for e in expressions:
        if hasattr(e, 'is_expression_type'):
            found.update(identify_variables(e, include_fixed=True))
    return found


class Reader:
    """Reads the problems of one moving grid.

    Parameters
    ----------
    model : Block
    block : Block
        of the grid
    grid : Grid
    times : TimeIndex
    given : ComponentSet of VarData
        variables over time that a march knows: inputs, weights of modes with memory
    """

    def __init__(self, model, block, grid, times, given):
        self._model, self._block, self._grid, self._times, self._given = model, block, grid, times, given
        self._states = ComponentSet(d.get_state_var() for d in derivatives(model, times.wrt))
        self._first, self._kinds = times.wrt.first(), {}
        self._read_equations()
        self._read_conditions()

    def _read_equations(self):
        """Equations, and what the package generated, by label; what belongs to an element by its number."""
        block, times, memory = self._block, self._times, self._block.component('memory')
        self._equations, self._of_element, self._copies = defaultdict(list), defaultdict(list), defaultdict(list)
        for c in self._model.component_data_objects(Constraint, active=True, descend_into=Block):
            label = times.time(c)
            if label is not None and (c.equality or marks.is_generated(c)) and c.parent_block() is not memory:
                self._equations[label].append(c)
        for name in LISTS:
            for c in block.component(name).values() if block.component(name) is not None else ():
                label = max(t for t in map(times.time, variables_of([c.body])) if t is not None)
                self._equations[label].append(c)
        jumps = block.component('jumps')
        if jumps is not None:
            for (b, _), c in jumps.copied.items():
                self._of_element[b + 1].append(c)
            for (b, _), v in jumps.copy.items():
                self._copies[b + 1].append(v)
        for (_, n, _), c in block.sign_after.items() if block.component('sign_after') is not None else ():
            self._of_element[n].append(c)

    def _read_conditions(self):
        """Conditions by label, aggregated pairs by element."""
        self._conditions, self._pairs = defaultdict(list), defaultdict(list)
        for index, c in self._block.cross.items():
            self._pairs[index[1]].append(c)
        for c in self._model.component_data_objects(Complementarity, descend_into=Block):
            label = self._times.time(c)
            if label is not None and getattr(c, '_args', None) is not None:
                self._conditions[label].append(c)

    def first(self, label):
        """The algebraic equations of the first time; conditions hold there as they are."""
        conditions = [c for c in self._conditions[label] if c.active]
        pairs, families = [read(c) for c in conditions], families_of(self._block)
        points = {f.name: Points([f.sides[label]], 1, f.continuous) for f in families if label in f.sides}
        return self._problem(self._equations[label], {}, pairs, points, conditions, (label,))

    def element(self, element, limits):
        """What holds in an element.

        Parameters
        ----------
        limits : dict name -> list of relational expressions
            functions that end it, such as guards, at its labels
        """
        labels, n = own_labels(element), element.n
        equations = [*(c for t in labels for c in self._equations[t]), *self._of_element[n]]
        pairs = [read(c) for c in self._pairs[n]]
        conditions = [c for t in labels for c in self._conditions[t]]
        points = {f.name: Points.of(f, element, labels) for f in families_of(self._block)}
        return self._problem(equations, limits, pairs, points, conditions, labels, self._block.r[n], self._copies[n])

    def _problem(self, equations, limits, pairs, points, conditions, labels, length=None, copies=()):
        look = Look()
        for c in equations:
            # labels are rounded, and so are the coefficients of collocation
            look.at(c.expr, numbers=not c.parent_component().local_name.endswith(DISCRETISATION))
        for expr in (row for rows in limits.values() for row in rows):
            look.at(expr)
        for expr in (side for some in (pairs, *(p.pairs for p in points.values())) for pair in some for side in pair):
            look.at(expr)
        unknown = [*([] if length is None else [length]), *copies]
        chosen = set(map(id, unknown))
        determined = [id(v) not in chosen and self._determined(v, labels) for v in look.variables]
        unknown += [v for v, new in zip(look.variables, determined) if new]
        chosen = set(map(id, unknown))
        known = [v for v in look.variables if id(v) not in chosen]
        places = tuple(id(v) in chosen for v in look.variables)
        bounds, families = tuple(map(self.bounds, unknown)), tuple(p.kind for p in points.values())
        kind = self._kinds.setdefault((tuple(look.tokens), places, bounds, families, tuple(limits)), len(self._kinds))
        rows = [c.expr for c in equations]
        return Equations(rows, limits, pairs, points, conditions, labels, length, unknown, known, kind, self)

    def sides(self, label):
        """The conditions at one label, by the name of their family."""
        return {f.name: f.sides[label] for f in families_of(self._block) if label in f.sides}

    def _determined(self, v, labels):
        if self._times.time(v) not in labels or v in self._given:
            return False
        # a state that is fixed later than at the first time, as at the end of a control problem, is simulated all the same
        return not v.fixed or (self._is_state(v) and self._times.time(v) != self._first)

    def bounds(self, v):
        """``(lower, upper)`` of an unknown; states have none."""
        return (None, None) if self._is_state(v) else (v.lb, v.ub)

    def time(self, v):
        """The label of a variable."""
        return self._times.time(v)

    def stage_labels(self, labels):
        """Those of the labels of an element that are stage points."""
        return labels[: len(self._grid.tau)]

    @cached_property
    def _find_factor(self):
        model = self._model.model()
        present = any(s.local_name == 'scaling_factor' for s in model.component_objects(Suffix, active=True))
        return SuffixFinder('scaling_factor', None, model).find if present else lambda v: None

    def factor(self, v):
        """The user's factor of a variable, or None."""
        return self._find_factor(v)

    def _is_state(self, v):
        return v.parent_component() in self._states
