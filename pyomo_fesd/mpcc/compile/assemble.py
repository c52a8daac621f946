"""The MPCC in the solver's scaled variables w and parameters p, from its rows.

Its free variables are w / s_x, its parameters p; then f s_f, g s_g, G s_G and H s_H are functions of (w, p).
"""

from collections import defaultdict
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from pyomo.core import maximize
from scipy import sparse

from pyomo_fesd.mpcc.compile.arrival_indices import arrival_indices, changes_by_id, moves, positions_of
from pyomo_fesd.mpcc.compile.casadi_matrices import csr
from pyomo_fesd.mpcc.compile.hint_indices import (
    CoincidenceIndices,
    DriftIndices,
    FillingIndices,
    FollowerIndices,
    ImpactIndices,
    NeighbourIndices,
    StickingIndices,
)
from pyomo_fesd.mpcc.compile.model_values import ModelValues, start_values, stated_bounds
from pyomo_fesd.mpcc.compile.mpcc_data import MpccData
from pyomo_fesd.mpcc.compile.mpcc_functions import MpccFunctions
from pyomo_fesd.mpcc.compile.natural_units import natural_units
from pyomo_fesd.mpcc.compile.parameters import parameter_values
from pyomo_fesd.mpcc.compile.part_indices import part_indices
from pyomo_fesd.mpcc.compile.scaled_functions import LARGE, ScaledFunctions, ScaledRows
from pyomo_fesd.mpcc.compile.scaling import Scale, side_factors
from pyomo_fesd.mpcc.compile.sizes import beside, certain_constants, row_factors, variable_factors, without_small
from pyomo_fesd.mpcc.compile.sparse_entries import largest_entries, major_index, with_entries

UNBOUNDED = (-np.inf, np.inf)
#: Variables of a nonlinear model that may be scaled by coefficients.
SMALL = 100
#: By what variables and rows without a factor of the user are scaled: see ``compile_mpcc``.
AUTO, STARTS, COEFFICIENTS, USER = NATURAL_UNITS = ('auto', 'starts', 'coefficients', 'user')


def assemble(problem, rows, symbols, factors, natural, expanded=False):
    """The ``MpccFunctions`` of ``problem`` from its ``ModelRows``; ``factors`` are the user's.

    ``natural`` says by what the others are scaled, as in ``compile_mpcc``; functions are SX if ``expanded``.
    """
    by_starts = natural == STARTS or (natural == AUTO and bool(problem.hints.alike))
    assembly = _Assembly(problem, rows, symbols, factors, expanded)
    scaled = assembly.by_starts() if by_starts else assembly.by_user()
    compiled = assembly.functions(scaled)
    if natural == USER:
        return compiled
    by_coefficients = natural == COEFFICIENTS or (natural == AUTO and not by_starts and _shows_sizes(compiled))
    units = natural_units(compiled, not by_coefficients)
    return compiled if units.ordinary else assembly.functions(scaled.in_units(units))


def _shows_sizes(compiled):
    """Whether coefficients show the sizes: of nonlinear models they say too little in large ones, and in simulations."""
    optimises = compiled.has_objective and compiled.pairs > 0
    return optimises and (compiled.linear or len(compiled.x0) <= SMALL)


@dataclass(frozen=True)
class _Factors:
    """Factors of variables (n), rows (m) and the objective, and the objective's offset."""

    x: np.ndarray
    g: np.ndarray
    f: float
    offset: float = 0.0

    def in_units(self, units):
        """The product with ``NaturalUnits``."""
        return _Factors(self.x * units.x, self.g * units.g, self.f * units.f, units.offset)


class _Assembly:
    """The functions of one MPCC, whatever their factors."""

    def __init__(self, problem, rows, symbols, factors, expanded):
        self._problem, self._rows, self._factors = problem, rows, factors
        self._parameters = symbols.parameters
        self._variables, self._constraints = rows.variables, [symbols.original(c) for c in rows.constraints]
        self._q = len(rows.conditions)
        self._start, _ = start_values(self._variables)
        self._p = parameter_values(self._parameters)
        size = sum(functions.size for functions in (rows.cost, rows.rows, rows.sides, rows.others))
        self._kind = ca.SX if expanded or size <= LARGE else ca.MX
        self._slopes = {}

    def by_user(self):
        """The user's factors of variables, rows and objective."""
        of = self._factors.of
        return _Factors(of(self._variables), of(self._constraints), float(of([self._problem.objective])[0]))

    def by_starts(self):
        """The same, or by sizes where these are far from 1 and the user gave none."""
        user, m = self.by_user(), len(self._constraints)
        J, constants = self._linearised(without_small(self._start))
        # sides are zero at solutions, and so may be what is left of them
        certain = constants.copy()
        certain[m:] = without_small(certain[m:])
        columns = {id(v): j for j, v in enumerate(self._variables)}
        alike = [[columns[id(v)] for v in group if id(v) in columns] for group in self._problem.hints.alike]
        alike = [group for group in alike if group]
        slopes = major_index(J), J.indices, np.where(self._in_weights(J), 0.0, J.data)
        s_x = variable_factors(slopes, (certain, constants), self._start, stated_bounds(self._variables), user.x, alike)
        points = (self._start, beside(self._start))
        jacobians = (self._jacobian(self._rows.rows, w) for w in points)
        largest = [largest_entries(with_entries(J, J.data / s_x[J.indices])) for J in jacobians]
        return replace(user, x=s_x, g=row_factors(largest, user.g))

    def _in_weights(self, J):
        """Which entries of ``J`` (csr) are weights of drifts: at a solution they are 0 but for what keeps the row regular."""
        weighted = {id(drift.row) for drift in self._problem.hints.drifts}
        rows = [i for i, c in enumerate(self._constraints) if id(c) in weighted]
        return np.isin(major_index(J), rows)

    def _linearised(self, w):
        """Jacobian of rows and sides, and the sizes of their distances from bounds where the variables are 0.

        Rounding errors are 0, and a constant in which terms cancel has their size.
        """
        at, both, sides = self._at(w), (self._rows.rows, self._rows.sides), 2 * self._q
        count = len(self._constraints) + sides
        J = sparse.vstack([self._jacobian(functions, w) for functions in both]).tocsr()[:count]
        parts = [(_column(functions.values(at)), functions.parameter_terms(at)) for functions in both]
        values, terms = (np.concatenate(some)[:count] for some in zip(*parts))
        found, bounds = values - J @ w, np.concatenate([self._rows.lbg, np.zeros(sides)])
        constants = np.abs(found - np.where(np.isfinite(bounds), bounds, 0.0))
        certain = certain_constants(constants, found, abs(J) @ np.abs(w))
        return J, np.maximum(certain, np.maximum(self._rows.cancelling, terms))

    def _jacobian(self, functions, w):
        """Jacobian (csr) of ``functions`` at ``w``, found once: nobody may change it."""
        key = id(functions), w.tobytes()
        if key not in self._slopes:
            self._slopes[key] = functions.coefficients if functions.is_linear else csr(functions.jacobian(self._at(w)))
        return self._slopes[key]

    def _at(self, w):
        return ca.DM(np.concatenate([w, self._p]).tolist())

    def functions(self, factors):
        """The ``MpccFunctions`` with these factors."""
        rows, problem, hints = self._rows, self._problem, self._problem.hints
        scale, values = self._scale(factors), self._model_values(factors.x)
        sign = -1.0 if problem.objective is not None and problem.objective.sense == maximize else 1.0
        positions = _positions_of(rows.conditions), {id(v): [j] for j, v in enumerate(self._variables)}
        changes = changes_by_id(hints, positions[0])
        of_rows = {id(c): i for i, c in enumerate(self._constraints)}
        data = MpccData(
            lbg=rows.lbg * scale.g,
            ubg=rows.ubg * scale.g,
            side_of=rows.side_of,
            sign=sign,
            has_objective=problem.objective is not None,
            scale=scale,
            tentative=np.array([d.tentative for d in problem.decisions], dtype=bool),
            neighbours=_neighbours(hints.neighbour_branches, changes, positions[1], scale.x),
            coincidences=[_coincidence(hint, changes, *positions) for hint in hints.coincidences],
            arrivals=arrival_indices(hints.arrivals, *positions),
            parts=part_indices(hints.chains, positions[1]),
            followers=_followers(hints.followers, positions[0]),
            fillings=_fillings(hints.fillings, *positions, scale.x),
            impacts=_impacts(hints.impacts, *positions, of_rows),
            stickings=_stickings(hints.stickings, *positions),
            drifts=_drifts(hints.drifts, positions[1], of_rows),
            **values.read(),
        )
        functions = self._scaled_functions(scale, sign)
        return MpccFunctions(functions, data, self._variables, self._constraints, rows.conditions, problem.decisions, values)

    def _scale(self, factors):
        """Factors of sides besides the others: a side that is a plain variable has that variable's."""
        sides, plain = self._of_expressions(self._rows.sides, factors.x)[: 2 * self._q], self._rows.plain
        given = self._factors.of([c.source for c in self._rows.conditions] * 2)
        sides = side_factors(sides, given)
        of_variables = np.concatenate([factors.x, np.ones(len(self._p))])
        sides[plain >= 0] = of_variables[plain[plain >= 0]]
        return Scale(factors.x, factors.g, factors.f, sides, factors.offset)

    def _of_expressions(self, functions, s_x):
        """The largest entry of the gradient of each function at the start; 0 where it has none."""
        if not len(functions.constants):
            return np.zeros(0)
        J = self._jacobian(functions, self._start)
        largest = largest_entries(with_entries(J, J.data / s_x[J.indices]))
        return np.where(np.isfinite(largest), largest, 0.0)

    def _scaled_functions(self, scale, sign):
        rows, d = self._rows, len(self._problem.decisions)
        # the number in the objective changes, so that nothing is lost to round-off
        cost = replace(rows.cost, constants=rows.cost.constants - [sign * scale.offset, 0.0])
        gauges = self._of_expressions(rows.others, scale.x)[d:]
        decided = np.ones(d)
        parts = (
            (cost, np.array([sign * scale.f, scale.f])),
            (rows.rows, scale.g),
            (rows.sides, np.concatenate([scale.sides, decided])),
            (rows.others, np.concatenate([decided, side_factors(gauges, np.ones(len(gauges)))])),
        )
        return ScaledFunctions(*(ScaledRows(*part, scale.x) for part in parts), self._q, self._kind)

    def _model_values(self, s_x):
        guides, sides = self._problem.hints.guide_bounds, np.zeros(len(self._variables), dtype=bool)
        plain = self._rows.plain
        sides[plain[(plain >= 0) & (plain < len(sides))]] = True
        guide = np.array([guides.get(v.parent_component(), UNBOUNDED) for v in self._variables], dtype=float).reshape(-1, 2)
        return ModelValues(self._variables, self._parameters, sides, guide, s_x, self._rows.splits)


def _column(values):
    return values.full().ravel()


def _positions_of(conditions):
    """Positions of the pairs by the id of their Complementarity."""
    pairs = defaultdict(list)
    for k, condition in enumerate(conditions):
        pairs[id(condition.source)].append(k)
    return pairs


def _neighbours(branches, changes, columns, s_x):
    """The neighbouring branches by positions of pairs and variables, without those in which no pair changes."""
    found = (_neighbour(branch, changes, columns, s_x) for branch in branches)
    return [neighbour for neighbour in found if any(change.moved(neighbour.later).targets.size for change in neighbour.changes)]


def _followers(followers, pairs):
    """The followers by positions of pairs."""
    found = [
        (k, leader, follower.swapped)
        for follower in followers
        for k, leader in zip(pairs.get(id(follower.pair), ()), pairs.get(id(follower.leader), ()))
    ]
    columns = zip(*found) if found else ((), (), ())
    return FollowerIndices(*(np.array(column, dtype=kind) for column, kind in zip(columns, (int, int, bool))))


def _fillings(fillings, pairs, columns, s_x):
    """The fillings by positions of pairs and variables, without those that are not complete."""
    found = []
    for filling in fillings:
        of_pairs = positions_of(filling.pairs, pairs)
        shares, extents = positions_of(filling.shares, columns), positions_of([v for _, v in filling.extents], columns)
        if len(of_pairs) == len(filling.pairs) and len(shares) == len(extents) == len(of_pairs) + 1:
            coefficients = np.array([coefficient for coefficient, _ in filling.extents]) / s_x[extents]
            found.append(FillingIndices(of_pairs, shares, s_x[shares], extents, coefficients, filling.amount))
    return found


def _impacts(impacts, pairs, columns, rows):
    """The impacts by positions, without those of which something is not in the problem."""
    found = []
    for impact in impacts:
        variables = (impact.above, impact.below, *impact.within, *impact.before)
        if id(impact.room) in rows and all(id(v) in columns for v in variables):
            above, below = (columns[id(v)][0] for v in (impact.above, impact.below))
            within, before = (positions_of(some, columns) for some in (impact.within, impact.before))
            of_pairs = positions_of(impact.pairs, pairs)
            found.append(ImpactIndices(impact.boundary, of_pairs, above, below, rows[id(impact.room)], within, before))
    return found


def _stickings(stickings, pairs, columns):
    """The boundaries of bodies that must not slip by positions, without those of which something is not in the problem."""
    found = []
    for sides in stickings:
        if id(sides.pair) in pairs and all(id(v) in columns for v in (*sides.meeting, *sides.after)):
            meeting, after = (positions_of(some, columns) for some in (sides.meeting, sides.after))
            found.append(StickingIndices(pairs[id(sides.pair)][0], meeting, after))
    return found


def _drifts(drifts, columns, rows):
    """The drifts by positions, without those of which something is not in the problem."""
    found = []
    for drift in drifts:
        variables = (drift.drift, drift.rate, *drift.distances, *drift.forces)
        if id(drift.row) in rows and all(id(v) in columns for v in variables):
            of_drift, of_rate = (columns[id(v)][0] for v in (drift.drift, drift.rate))
            sides = (positions_of(some, columns) for some in (drift.distances, drift.forces))
            found.append(DriftIndices(of_drift, of_rate, rows[id(drift.row)], *sides))
    return found


def _neighbour(branch, changes, columns, s_x):
    """One of them; ``columns`` are positions by the id of a component, which need not have any."""
    starts = {columns[id(v)][0]: start for v, start in branch.starts if id(v) in columns}
    at = np.array(list(starts), dtype=int)
    return NeighbourIndices(
        tuple(changes[id(change)] for change in branch.changes),
        branch.later,
        short=positions_of(branch.if_at_lower_bound, columns),
        starts=at,
        at=np.array(list(starts.values()), dtype=float) * s_x[at],
    )


def _coincidence(hint, changes, pairs, columns):
    present = tuple(changes[id(change)] for change in hint.changes)
    extents = hint.later, hint.earlier, hint.before, hint.after
    later, earlier, before, after = (None if v is None or id(v) not in columns else columns[id(v)][0] for v in extents)
    beyond = (None if change is None else changes[id(change)] for change in (hint.beyond_later, hint.beyond_earlier))
    by_values = (moves(some, pairs) for some in (hint.by_values_later, hint.by_values_earlier))
    return CoincidenceIndices(present, later, earlier, hint.fixed, before, after, *beyond, *by_values)
