"""The MPCC in the solver's scaled variables w and parameters p, from its rows.

Its free variables are w / s_x, its parameters p; then f s_f, g s_g, G s_G and H s_H are functions of (w, p).
"""

from collections import defaultdict
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from pyomo.core import maximize
from scipy import sparse

from pyomo_fesd.mpcc.compile.arrival_indices import arrival_indices, both_positions, moves, positions_of
from pyomo_fesd.mpcc.compile.casadi_matrices import csr
from pyomo_fesd.mpcc.compile.model_values import ModelValues, start_values, stated_bounds
from pyomo_fesd.mpcc.compile.mpcc_functions import (
    ChangeIndices,
    CoincidenceIndices,
    FollowerIndices,
    MpccData,
    MpccFunctions,
    NeighbourIndices,
)
from pyomo_fesd.mpcc.compile.natural_units import natural_units
from pyomo_fesd.mpcc.compile.parameters import parameter_values
from pyomo_fesd.mpcc.compile.round_off import EXACT
from pyomo_fesd.mpcc.compile.scaled_functions import LARGE, ScaledFunctions
from pyomo_fesd.mpcc.compile.scaling import Scale, side_factors
from pyomo_fesd.mpcc.compile.sizes import row_factors, variable_factors, without_small

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
        self._m, self._q = len(rows.constraints), len(rows.conditions)
        self._start, _ = start_values(self._variables)
        self._p = parameter_values(self._parameters)
        self._user_x = factors.of(self._variables)
        self._kind = ca.SX if expanded or rows.main.size + rows.others.size <= LARGE else ca.MX

    def by_user(self):
        """The user's factors of variables, rows and objective."""
        return _Factors(self._user_x, self._factors.of(self._constraints), float(self._factors.of([self._problem.objective])[0]))

    def by_starts(self):
        """The same, or by sizes where these are far from 1 and the user gave none."""
        user, rows, m = self.by_user(), self._rows, self._m
        begin = without_small(self._start)
        J, constants = self._linearised(begin)
        # sides are zero at solutions, and so may be what is left of them
        certain = constants.copy()
        certain[m:] = without_small(certain[m:])
        columns = {id(v): j for j, v in enumerate(self._variables)}
        alike = [[columns[id(v)] for v in group if id(v) in columns] for group in self._problem.hints.alike]
        sizes = (certain, constants), self._start, stated_bounds(self._variables), user.x, [group for group in alike if group]
        s_x = variable_factors(J, *sizes)
        J = csr(rows.main.jacobian(self._at(self._start)))[2 : 2 + m]
        return replace(user, x=s_x, g=row_factors(J @ sparse.diags(1 / s_x), user.g))

    def _linearised(self, w):
        """Jacobian of rows and sides, and the sizes of their distances from bounds where the variables are 0, without rounding errors.

        A constant in which terms cancel has their size.
        """
        main, m, at = self._rows.main, self._m, self._at(w)
        chosen = slice(2, 2 + m + 2 * self._q)
        J = csr(main.jacobian(at))[chosen]
        bounds = np.concatenate([self._rows.lbg, np.zeros(2 * self._q)])
        found = main.values(at).full().ravel()[chosen] - J @ w
        constants = np.abs(found - np.where(np.isfinite(bounds), bounds, 0.0))
        exact = constants > EXACT * (abs(J) @ np.abs(w) + np.abs(found))
        cancelling = np.maximum(self._rows.cancelling, main.parameter_terms(at)[chosen])
        return J, np.maximum(np.where(exact, constants, 0.0), cancelling)

    def _at(self, w):
        return ca.DM(np.concatenate([w, self._p]).tolist())

    def functions(self, factors):
        """The ``MpccFunctions`` with these factors."""
        rows, problem, s_x = self._rows, self._problem, factors.x
        sign = -1.0 if problem.objective is not None and problem.objective.sense == maximize else 1.0
        sides = self._side_factors(s_x)
        scale = Scale(
            s_x, factors.g, factors.f, np.where(rows.plain >= 0, s_x[rows.plain], sides) if len(s_x) else sides, factors.offset
        )
        values = self._model_values(s_x)
        positions = _positions_of(rows.conditions), {id(v): [j] for j, v in enumerate(self._variables)}
        hints = problem.hints
        data = MpccData(
            lbg=rows.lbg * scale.g,
            ubg=rows.ubg * scale.g,
            side_of=rows.side_of,
            sign=sign,
            has_objective=problem.objective is not None,
            scale=scale,
            tentative=np.array([d.tentative for d in problem.decisions], dtype=bool),
            neighbours=_neighbours(hints.neighbour_branches, *positions, s_x),
            coincidences=[_coincidence(hint, *positions) for hint in hints.coincidences],
            arrivals=arrival_indices(hints.arrivals, *positions),
            followers=_followers(hints.followers, positions[0]),
            **values.read(),
        )
        functions = self._scaled_functions(scale, sign)
        return MpccFunctions(functions, data, self._variables, self._constraints, rows.conditions, problem.decisions, values)

    def _scaled_functions(self, scale, sign):
        main, others, d = self._rows.main, self._rows.others, len(self._problem.decisions)
        # the number in the objective changes, so that nothing is lost to round-off
        constants = main.constants.copy()
        constants[0] -= sign * scale.offset
        main = replace(main, constants=constants)
        J = csr(others.jacobian(self._at(self._start))) @ sparse.diags(1 / scale.x)
        of_others = np.concatenate([np.ones(d), _factors_of_expressions(J[d:], np.ones(J.shape[0] - d))])
        factors = np.concatenate([[sign * scale.f, scale.f], scale.g, scale.sides, np.ones(d)])
        return ScaledFunctions(main, others, (self._m, self._q, d), scale.x, factors, of_others, self._kind)

    def _side_factors(self, s_x):
        """Factors of sides as if none were a plain variable."""
        given = self._factors.of([c.source for c in self._rows.conditions] * 2)
        J = csr(self._rows.main.jacobian(self._at(self._start)))[2 + self._m : 2 + self._m + 2 * self._q]
        return _factors_of_expressions(J @ sparse.diags(1 / s_x), given)

    def _model_values(self, s_x):
        guides = self._problem.hints.guide_bounds
        guide = [guides.get(v.parent_component(), UNBOUNDED) for v in self._variables]
        are_sides = np.zeros(len(self._variables), dtype=bool)
        are_sides[self._rows.plain[self._rows.plain >= 0]] = True
        guide = np.array(guide, dtype=float).reshape(-1, 2)
        return ModelValues(self._variables, self._parameters, are_sides, guide, s_x, self._rows.splits)


def _factors_of_expressions(J, given):
    """The user's factors of functions with the Jacobian ``J``, or a mild gradient."""
    largest = abs(J).max(axis=1).toarray().ravel() if 0 not in J.shape else np.zeros(J.shape[0])
    return side_factors(np.where(np.isfinite(largest), largest, 0.0), given)


def _positions_of(conditions):
    """Positions of the pairs by the id of their Complementarity."""
    pairs = defaultdict(list)
    for k, condition in enumerate(conditions):
        pairs[id(condition.source)].append(k)
    return pairs


def _neighbours(branches, pairs, columns, s_x):
    """The neighbouring branches by positions of pairs and variables, without those in which no pair takes over."""
    found = (_neighbour(branch, pairs, columns, s_x) for branch in branches)
    return [neighbour for neighbour in found if neighbour.targets.size]


def _followers(followers, pairs):
    """The followers by positions of pairs."""
    found = [
        (k, leader, follower.swapped)
        for follower in followers
        for k, leader in zip(pairs.get(id(follower.pair), ()), pairs.get(id(follower.leader), ()))
    ]
    columns = zip(*found) if found else ((), (), ())
    return FollowerIndices(*(np.array(column, dtype=kind) for column, kind in zip(columns, (int, int, bool))))


def _neighbour(branch, pairs, columns, s_x):
    """One of them; ``pairs`` and ``columns`` are positions by the id of a component, which need not have any."""
    targets, sources = both_positions(branch.takes_over, pairs)
    starts = {columns[id(v)][0]: start for v, start in branch.starts if id(v) in columns}
    at = np.array(list(starts), dtype=int)
    return NeighbourIndices(
        targets,
        sources,
        ended=positions_of(branch.first_side_zero, pairs),
        short=positions_of(branch.if_at_lower_bound, columns),
        starts=at,
        at=np.array(list(starts.values()), dtype=float) * s_x[at],
    )


def _coincidence(hint, pairs, columns):
    changes = tuple(
        ChangeIndices(*both_positions(change.differing, pairs), moves(change.later, pairs), moves(change.earlier, pairs))
        for change in hint.changes
    )
    later, earlier = (None if v is None or id(v) not in columns else columns[id(v)][0] for v in (hint.later, hint.earlier))
    return CoincidenceIndices(changes, later, earlier, hint.fixed)
