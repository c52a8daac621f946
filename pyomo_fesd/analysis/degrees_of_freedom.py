"""Compare equations and unknowns: degrees of freedom and structural singularity, before anything is solved.

A bipartite graph joins equations and unknowns.  A largest matching leaves over unknowns that nothing determines, and equations
that contradict or repeat others, whatever the numbers are (Dulmage and Mendelsohn 1958).  A pair 0 <= G perp H >= 0 counts as one
equation in all variables of G and H, since one of them is zero; on movable elements the pairs at single points count, and the
lengths are given.

Takes: a model or a block of one, before or after discretisation, before or after ``fesd.dcs``.
Leaves: the model as it is.
Does not apply: to singularity that numbers alone cause (two parallel equations), and to inequalities.
"""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.common.dependencies import attempt_import
from pyomo.core import Block, Constraint, Objective, Var, value
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching

from pyomo_fesd.core import TimeIndex, all_switched_systems, moving_grids, read_complementarity, refuse_no_model

#: Imported when it is first used, since it imports networkx.
incidence, _ = attempt_import('pyomo.contrib.incidence_analysis')
INDEX = re.compile(r'\[[^\]]*\]')
#: Number of names that a message lists.
SHOWN = 3
#: Fixed values may miss an equation between them by this much, as in Pyomo's NL writer.
CONTRADICTION = 1e-8


@dataclass(frozen=True)
class Structure:
    """Degrees of freedom of a block, and the parts of it that have too many or too few equations.

    Attributes
    ----------
    block : str
        name of the block
    unknowns, equations : int
        variables that are not fixed and occur in an equation; equalities and pairs
    has_objective : bool
        with an objective, degrees of freedom are intended
    loose : list of VarData
        unknowns left over, one choice of them
    undetermined : list of VarData
        all among which that choice can be made
    surplus : list of ConstraintData and ComplementarityData
        equations left over, one choice of them
    overdetermined : list of ConstraintData and ComplementarityData
        all among which that choice can be made
    outside : list of ConstraintData
        active equations elsewhere in the model that contain unknowns of the block, such as the streams of a flowsheet whose Arcs
        lie above it; not counted
    """

    block: str
    unknowns: int
    equations: int
    has_objective: bool
    loose: list
    undetermined: list
    surplus: list
    overdetermined: list
    outside: list

    @property
    def degrees_of_freedom(self) -> int:
        """Unknowns less equations."""
        return self.unknowns - self.equations

    @property
    def problem(self) -> str:
        """A sentence about the fault with the names of blocks; empty for a sound structure."""
        parts = []
        if self.surplus:
            parts.append(_sentence('equation(s) too many', self.surplus, self.overdetermined))
        if self.loose and (self.surplus or not self.has_objective):
            parts.append(_sentence('unknown(s) that nothing determines', self.loose, self.undetermined))
        if parts and self.outside:
            parts.append(self._outside())
        return '; '.join(parts)

    def _outside(self):
        return (
            f"{len(self.outside)} active equation(s) outside '{self.block}' contain its unknowns and are not counted, e.g. "
            + _few([c.name for c in self.outside], len(self.outside))
        )

    def __str__(self):
        head = f"{self.block}: {self.unknowns} unknowns, {self.equations} equations, degrees of freedom {self.degrees_of_freedom}"
        more = f"\n{self._outside()}" if self.outside and not self.problem else ''
        return f"{head}\n{self.problem or 'structurally sound'}{more}"

    __repr__ = __str__


def structure(block) -> Structure:
    """Count degrees of freedom of ``block``, and find where it has too many or too few equations.

    Returns
    -------
    Structure
        prints as two lines; ``problem`` is empty for a sound model
    """
    refuse_no_model(block, 'structure')
    given = Given(block)
    unknowns, equations, rows = ComponentMap(), [], []
    for equation, expressions in equations_of(block, given):
        found = [v for v in ComponentSet(chain(*map(_incident_variables, expressions))) if v not in given]
        if found or _contradicts(equation):
            equations.append(equation)
            rows.append([unknowns.setdefault(v, len(unknowns)) for v in found])
    has_objective = any(True for _ in block.component_data_objects(Objective, active=True, descend_into=Block))
    faults = _faults(_incidence(rows, len(unknowns)), equations, list(unknowns))
    return Structure(_name(block), len(unknowns), len(equations), has_objective, *faults, _outside(block, unknowns, given))


def _outside(block, unknowns, given):
    """The active equations of the model that do not lie in ``block`` and contain its unknowns."""
    model = block.model()
    if block is model:
        return []
    inside = ComponentSet(block.component_data_objects(Constraint, active=True, descend_into=Block))
    others = (c for c in model.component_data_objects(Constraint, active=True, descend_into=Block) if c not in inside)
    own = (c for c in others if c.equality and c not in given)
    return [c for c in own if any(v in unknowns for v in identify_variables(c.body, include_fixed=False))]


class Given:
    """Variables and equations that movable elements determine, and not the plant.

    These are all components on the blocks of moving grids, the weights of modes with hysteresis, and with Gauss points the data at
    element boundaries, which are not collocation points.

    Attributes
    ----------
    summed : ComponentSet
        the inactive conditions that are summed up in aggregated pairs
    """

    def __init__(self, block):
        weights = (mode.weight for mode in all_switched_systems(block.model()).hysteresis)
        self._own = ComponentSet(v for weight in weights for v in identify_variables(weight))
        self._between, self.summed = [], ComponentSet()
        for wrt, moving in moving_grids(block).items():
            self._own.update(moving.block.component_data_objects((Var, Constraint, Complementarity), descend_into=Block))
            self.summed.update(one for sources in moving.sources.values() for one in sources)
            if not moving.grid.right_is_collocated:
                self._between.append((TimeIndex(wrt), {e.right for e in moving.grid.elements}))

    def __contains__(self, component):
        return component in self._own or any(times.time(component) in labels for times, labels in self._between)


def equations_of(block, given) -> Iterator[tuple]:
    """Yield ``(component, expressions)`` for every equality and pair of the plant; pairs that are summed up count one by one."""
    for c in block.component_data_objects(Constraint, active=True, descend_into=Block):
        if c.equality and c not in given:
            yield c, [c.body]
    grids = moving_grids(block).values()
    for c in block.component_data_objects(Complementarity, descend_into=Block):
        counts = c.active or c in given.summed or any(moving.source(c) in given.summed for moving in grids)
        if counts and c not in given and not any(c in moving.splits for moving in grids):
            yield c, pair_sides(c)


def _contradicts(equation):
    """Whether an equation between fixed values alone does not hold."""
    if equation.ctype is not Constraint or any(True for _ in identify_variables(equation.body, include_fixed=False)):
        return False
    return abs(value(equation.body) - value(equation.upper)) > CONTRADICTION


def pair_sides(condition) -> list:
    """Return the sides G and H of a pair."""
    return [e for e in read_complementarity(condition) if e is not None]


def _incident_variables(expression):
    """Variables that are not fixed, without those whose coefficient is zero."""
    if not hasattr(expression, 'is_expression_type'):
        return ()
    return incidence.get_incident_variables(expression, include_fixed=False, method=incidence.IncidenceMethod.standard_repn)


def _incidence(rows, width):
    """The matrix with an entry for each unknown of each equation; ``rows`` lists their columns."""
    columns = list(chain(*rows))
    return csr_matrix((np.ones(len(columns)), columns, np.cumsum([0, *map(len, rows)])), shape=(len(rows), width))


def _faults(matrix, equations, unknowns):
    """Loose, undetermined, surplus and overdetermined components."""
    matched = maximum_bipartite_matching(matrix, perm_type='column') if min(matrix.shape) else np.zeros(0)
    matching = {i: int(j) for i, j in enumerate(matched) if j >= 0}
    if len(matching) == len(equations) == len(unknowns):
        return [], [], [], []
    # the matching is scipy's: that of Pyomo recurses once for each equation of a chain
    rows, columns = incidence.dulmage_mendelsohn.dulmage_mendelsohn(matrix, matching=matching)
    names = (
        (unknowns, columns.unmatched),
        (unknowns, [*columns.unmatched, *columns.underconstrained]),
        (equations, rows.unmatched),
        (equations, [*rows.unmatched, *rows.overconstrained]),
    )
    return [[components[int(k)] for k in places] for components, places in names]


def _sentence(fault, chosen, among):
    by_kind = {(_block_name(c), c.parent_component().local_name): c.name for c in reversed(chosen)}
    examples = list(reversed(by_kind.values()))
    blocks = Counter(map(_block_name, among)).most_common()
    return f"{len(chosen)} {fault}, e.g. {_few(examples, len(chosen))}, among {len(among)} in " + _few(
        [f"{name} ({n})" for name, n in blocks], len(blocks)
    )


def _few(names, number):
    """Some of the names of ``number`` components."""
    return ', '.join(names[:SHOWN]) + (', ...' if number > SHOWN or number > len(names) else '')


def _block_name(component):
    """The name of the block of a component without its indices, among which is time."""
    return INDEX.sub('', _name(component.parent_block()))


def _name(block):
    return 'the model' if block.parent_block() is None else block.name
