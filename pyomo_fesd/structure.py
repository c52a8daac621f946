"""Is there an equation for every unknown?  Degrees of freedom and structural singularity, before anything is solved.

A bipartite graph joins equations and unknowns.  A largest matching (Dulmage and Mendelsohn 1958) leaves unknowns over that nothing
determines, and equations that contradict or repeat others, whatever the numbers are.  A pair 0 <= G perp H >= 0 counts as one
equation in all variables of G and H, since one of them is zero; on movable elements the pairs at single points count, and the
lengths are given.

Takes: a model or a block of one, before or after discretisation, with or without modes that are transformed.
Leaves: nothing.
Does not apply: to what numbers alone tell (two parallel equations), and to inequalities.
"""

import re
from collections import Counter
from dataclasses import dataclass

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.contrib.incidence_analysis import IncidenceMethod, get_incident_variables
from pyomo.contrib.incidence_analysis.dulmage_mendelsohn import dulmage_mendelsohn
from pyomo.core import Block, Constraint, Objective, Var, value
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

from pyomo_fesd import marks
from pyomo_fesd.complementarity import read
from pyomo_fesd.elements.cross import grid_of, sources
from pyomo_fesd.elements.mixed import replacement, source
from pyomo_fesd.records import records
from pyomo_fesd.timeindex import TimeIndex

INDEX = re.compile(r'\[[^\]]*\]')
#: Names that a message lists.
SHOWN = 3
#: Fixed values may miss an equation between them by this much, as in Pyomo's NL writer.
CONTRADICTION = 1e-8


@dataclass(frozen=True)
class Structure:
    """What ``structure`` finds.

    Attributes
    ----------
    block : str
        name of what was looked at
    unknowns, equations : int
        variables that are not fixed and stand in an equation; equalities and pairs
    has_objective : bool
        with one, degrees of freedom are wanted
    loose : list of VarData
        unknowns left over, one choice of them
    undetermined : list of VarData
        all among which that choice can be made
    surplus : list of ConstraintData and ComplementarityData
        equations left over, one choice of them
    overdetermined : list of ConstraintData and ComplementarityData
        all among which that choice can be made
    """

    block: str
    unknowns: int
    equations: int
    has_objective: bool
    loose: list
    undetermined: list
    surplus: list
    overdetermined: list

    @property
    def degrees_of_freedom(self):
        """Unknowns less equations."""
        return self.unknowns - self.equations

    @property
    def problem(self):
        """What is wrong, in a sentence with the names of blocks; empty if nothing is."""
        parts = []
        if self.surplus:
            parts.append(_sentence('equation(s) too many', self.surplus, self.overdetermined))
        if self.loose and (self.surplus or not self.has_objective):
            parts.append(_sentence('unknown(s) that nothing determines', self.loose, self.undetermined))
        return '; '.join(parts)

    def __str__(self):
        head = f"{self.block}: {self.unknowns} unknowns, {self.equations} equations, degrees of freedom {self.degrees_of_freedom}"
        return f"{head}\n{self.problem or 'structurally sound'}"

    __repr__ = __str__


def structure(block):
    """Look at the structure of ``block``: degrees of freedom, and where there are too many or too few equations.

    Returns
    -------
    Structure
        prints as two lines; ``problem`` is empty for a sound model
    """
    given = _Given(block)
    equations = [(c, expressions) for c, expressions in _equations(block, given.summed) if c not in given]
    unknowns, places = ComponentMap(), []
    for i, (_, expressions) in enumerate(equations):
        found = ComponentSet(v for e in expressions for v in _variables(e))
        places.extend((i, unknowns.setdefault(v, len(unknowns))) for v in found if v not in given)
    used = sorted({i for i, _ in places} | {i for i, (c, _) in enumerate(equations) if _contradicts(c)})
    equations, row = [equations[i][0] for i in used], {i: k for k, i in enumerate(used)}
    matrix = _incidence([(row[i], j) for i, j in places], (len(equations), len(unknowns)))
    has_objective = any(True for _ in block.component_data_objects(Objective, active=True, descend_into=Block))
    parts = _parts(matrix, equations, list(unknowns))
    return Structure(_name(block), len(unknowns), len(equations), has_objective, *parts)


class _Given:
    """What movable elements decide and not the plant: all on their blocks; weights of modes with memory; with Gauss also their
    boundaries, which are no stages.

    Attributes
    ----------
    summed : ComponentSet
        the conditions that aggregated pairs stand for
    """

    def __init__(self, block):
        weights = (weight for weight, _ in marks.marked(block.model(), marks.MEMORY, used=True))
        self._own = ComponentSet(v for weight in weights for v in identify_variables(weight))
        self._between, self.summed = [], ComponentSet()
        for wrt, home in records(block).grids.items():
            self._own.update(home.component_data_objects((Var, Constraint, Complementarity), descend_into=Block))
            self.summed.update(one for pairs in sources(home).values() for one in pairs)
            grid = grid_of(home)
            if not grid.right_is_stage:
                self._between.append((TimeIndex(wrt), {e.right for e in grid.elements}))

    def __contains__(self, component):
        return component in self._own or any(times.time(component) in labels for times, labels in self._between)


def _equations(block, summed):
    """``(component, expressions)`` for every equality and pair that determines something; pairs that are summed up one by one."""
    found = [(c, [c.body]) for c in block.component_data_objects(Constraint, active=True, descend_into=Block) if c.equality]
    conditions = block.component_data_objects(Complementarity, descend_into=Block)
    asked = (c for c in conditions if (c.active or source(c) in summed) and replacement(c) is None)
    return found + [(c, _sides(c)) for c in asked]


def _contradicts(equation):
    """Whether an equation between fixed values alone does not hold; with unknowns it is asked for anyway."""
    if equation.ctype is not Constraint or any(True for _ in identify_variables(equation.body, include_fixed=False)):
        return False
    return abs(value(equation.body) - value(equation.upper)) > CONTRADICTION


def _sides(condition):
    return [e for e in read(condition) if e is not None]


def _variables(expression):
    """Variables that are not fixed, without those whose coefficient is zero."""
    if not hasattr(expression, 'is_expression_type'):
        return ()
    return get_incident_variables(expression, include_fixed=False, method=IncidenceMethod.standard_repn)


def _incidence(places, shape):
    rows, columns = np.array(places, dtype=int).reshape(-1, 2).T
    return coo_matrix((np.ones(len(rows)), (rows, columns)), shape=shape)


def _parts(matrix, equations, unknowns):
    """Loose, undetermined, surplus and overdetermined components; the slow decomposition only where it has something to find."""
    matched = maximum_bipartite_matching(matrix.tocsr(), perm_type='column') if min(matrix.shape) else np.zeros(0)
    if np.count_nonzero(matched >= 0) == len(equations) == len(unknowns):
        return [], [], [], []
    rows, columns = dulmage_mendelsohn(matrix)
    names = (
        (unknowns, columns.unmatched),
        (unknowns, [*columns.unmatched, *columns.underconstrained]),
        (equations, rows.unmatched),
        (equations, [*rows.unmatched, *rows.overconstrained]),
    )
    return [[components[int(k)] for k in places] for components, places in names]


def _sentence(what, chosen, among):
    kinds = {(_home(c), c.parent_component().local_name): c.name for c in reversed(chosen)}
    examples = list(reversed(kinds.values()))
    homes = Counter(_home(c) for c in among).most_common()
    return f"{len(chosen)} {what}, e.g. {_few(examples, len(chosen))}, among {len(among)} in " + _few(
        [f"{home} ({n})" for home, n in homes], len(homes)
    )


def _few(names, number):
    """Some of the names of ``number`` components."""
    return ', '.join(names[:SHOWN]) + (', ...' if number > SHOWN or number > len(names) else '')


def _home(component):
    """The block of a component without its indices, among which is time."""
    return INDEX.sub('', _name(component.parent_block()))


def _name(block):
    return 'the model' if block.parent_block() is None else block.name
