"""The MPCC in the solver's scaled variables w and parameters p, from the content of the NL file.

Its free variables are w / s_x, its parameters p; then f s_f, g s_g, G s_G and H s_H are functions of (w, p).
"""

from collections import defaultdict

import casadi as ca
import numpy as np
from pyomo.core import maximize
from scipy import sparse

from pyomo_fesd.mpcc.compile.arrival_indices import arrival_indices, both_positions, moves, positions_of
from pyomo_fesd.mpcc.compile.model_values import ModelValues, start_values, stated_bounds
from pyomo_fesd.mpcc.compile.mpcc_functions import (
    ChangeIndices,
    CoincidenceIndices,
    FillingIndices,
    FollowerIndices,
    MpccData,
    MpccFunctions,
    NeighbourIndices,
    csr,
    take,
)
from pyomo_fesd.mpcc.compile.natural_units import natural_units
from pyomo_fesd.mpcc.compile.nl_index import NlIndex
from pyomo_fesd.mpcc.compile.parameters import parameter_values
from pyomo_fesd.mpcc.compile.round_off import EXACT, parameter_terms
from pyomo_fesd.mpcc.compile.scaling import Scale, side_factors
from pyomo_fesd.mpcc.compile.sizes import row_factors, variable_factors, without_small

UNBOUNDED = (-np.inf, np.inf)
#: Variables of a nonlinear model that may be scaled by coefficients.
SMALL = 100
#: By what variables and rows without a factor of the user are scaled: see ``compile_mpcc``.
AUTO, STARTS, COEFFICIENTS, USER = NATURAL_UNITS = ('auto', 'starts', 'coefficients', 'user')


def assemble(problem, entries, nl, symbols, factors, natural):
    """The ``MpccFunctions`` of ``problem``, whose ``entries`` are in ``nl``; ``factors`` are the user's.

    ``natural`` says by what the others are scaled, as in ``compile_mpcc``.
    """
    index = NlIndex(nl, entries, symbols.variables)
    by_starts = natural == STARTS or (natural == AUTO and bool(problem.hints.alike))
    compiled = _assembled(problem, entries, nl, symbols, factors, index, by_starts)
    if natural == USER:
        return compiled
    by_coefficients = natural == COEFFICIENTS or (natural == AUTO and not by_starts and _shows_sizes(compiled))
    units = natural_units(compiled, not by_coefficients)
    return compiled if units.ordinary else _assembled(problem, entries, nl, symbols, factors, index, by_starts, units)


def _shows_sizes(compiled):
    """Whether coefficients show the sizes: of nonlinear models they say too little in large ones, and in simulations."""
    optimises = compiled.has_objective and compiled.G.numel() > 0
    return optimises and (compiled.linear or compiled.x.numel() <= SMALL)


def _assembled(problem, entries, nl, symbols, factors, index, by_starts, units=None):
    variables = [nl.variables[j] for j in index.free]
    constraints = [symbols.original(nl.constraints[i]) for i in index.model_rows]
    pairs = index.distinct()
    conditions = [entries.conditions[k] for k in pairs]
    sides = np.concatenate([index.G[pairs], index.H[pairs]])
    start, _ = start_values(variables)

    at = start, parameter_values(symbols.parameters)
    given = factors.of(variables), factors.of(constraints)
    s_x, s_g = _factors_by_size(nl, index, sides, at, variables, *given, problem.hints) if by_starts else given
    s_f, offset = float(factors.of([problem.objective])[0]), 0.0
    if units is not None:
        s_x, s_g, s_f, offset = s_x * units.x, s_g * units.g, s_f * units.f, units.offset
    w, p, f, rows, stack = _substitute(nl, index, s_x)
    S, given = take(stack, sides), factors.of([c.source for c in conditions] * 2)
    s_sides = _factors_of_expressions(S, (w, p), (start * s_x, at[1]), given)
    scale = Scale(s_x, s_g, s_f, _with_factors_of_variables(s_sides, sides, index, s_x), offset)

    positions = _positions_of(conditions), {id(v): [j] for j, v in enumerate(variables)}
    guides = [problem.hints.guide_bounds.get(v.parent_component(), UNBOUNDED) for v in variables]
    values = ModelValues(
        variables, symbols.parameters, _are_sides(sides, index), np.array(guides, dtype=float).reshape(-1, 2), s_x, entries.splits
    )
    data = MpccData(
        lbg=nl.lbg[index.model_rows] * scale.g,
        ubg=nl.ubg[index.model_rows] * scale.g,
        side_of=sides,
        sign=-1.0 if problem.objective is not None and problem.objective.sense == maximize else 1.0,
        has_objective=problem.objective is not None,
        scale=scale,
        tentative=np.array([d.tentative for d in problem.decisions], dtype=bool),
        neighbours=_neighbours(problem.hints.neighbour_branches, *positions, s_x),
        coincidences=[_coincidence(hint, *positions) for hint in problem.hints.coincidences],
        arrivals=arrival_indices(problem.hints.arrivals, *positions),
        followers=_followers(problem.hints.followers, positions[0]),
        fillings=_fillings(problem.hints.fillings, *positions, s_x),
        **values.read(),
    )
    gauges = take(stack, index.gauges)
    gauges = gauges * _factors_of_expressions(gauges, (w, p), (start * s_x, at[1]), np.ones(gauges.numel()))
    outputs = _outputs(index, f, rows, stack, S, scale, gauges)
    return MpccFunctions(w, p, outputs, data, variables, constraints, conditions, problem.decisions, values)


def _factors_by_size(nl, index, sides, at, variables, given_x, given_g, hints):
    """Factors of variables and of the model's rows: the user's, or by their sizes where these are far from 1."""
    w, p, _, rows, stack = _substitute(nl, index, np.ones(len(variables)))
    all_rows = ca.vertcat(rows, take(stack, sides))
    function = ca.Function('rows', [w, p], [all_rows, ca.jacobian(all_rows, w)])
    bounds = np.concatenate([nl.lbg[index.model_rows], np.zeros(len(sides))])
    begin = without_small(at[0])
    cancelling = np.concatenate([nl.cancelling[index.model_rows], _of_rows(nl.cancelling, sides)])
    cancelling = np.maximum(cancelling, parameter_terms(all_rows, w, p, begin, at[1]))
    J, constants = _linearised(function, begin, at[1], bounds, cancelling)
    # sides are zero at solutions, and so may be what is left of them
    certain = constants.copy()
    certain[len(index.model_rows) :] = without_small(certain[len(index.model_rows) :])
    columns = {id(v): j for j, v in enumerate(variables)}
    alike = [[columns[id(v)] for v in group if id(v) in columns] for group in hints.alike]
    s_x = variable_factors(J, (certain, constants), at[0], stated_bounds(variables), given_x, [group for group in alike if group])
    J = csr(function(*at)[1])[: len(index.model_rows)]
    return s_x, row_factors(J @ sparse.diags(1 / s_x), given_g)


def _of_rows(values, addresses):
    """The values (one each row of the file) of those addresses that are rows, 0 for the others."""
    is_row = (addresses >= 0) & (addresses < len(values))
    return np.where(is_row, np.append(values, 0.0)[np.where(is_row, addresses, -1)], 0.0)


def _linearised(function, w, p, bounds, cancelling):
    """Jacobian of rows, and the sizes of their distances from ``bounds`` where the variables are 0, without rounding errors.

    A constant in which terms of the sizes ``cancelling`` cancel has their size.
    """
    values, J = function(w, p)
    J = csr(J)
    found = np.asarray(values, dtype=float).ravel() - J @ w
    constants = np.abs(found - np.where(np.isfinite(bounds), bounds, 0.0))
    exact = constants > EXACT * (abs(J) @ np.abs(w) + np.abs(found))
    return J, np.maximum(np.where(exact, constants, 0.0), cancelling)


def _substitute(nl, index, s_x):
    """w, p, and in terms of them f, the model's own rows and the stack of entries."""
    w, p = ca.SX.sym('w', len(index.free)), ca.SX.sym('p', len(index.parameters))
    x = ca.SX(len(nl.variables), 1)
    x[index.free.tolist()], x[index.parameters.tolist()] = w / s_x, p
    f, g = nl.function(x)
    # constants of a linear row are part of its bound; entries have a lower one
    constants = np.where(np.isfinite(nl.lbg), nl.lbg, 0.0)
    return w, p, f, take(g, index.model_rows), index.stack(g - constants, x)


def _factors_of_expressions(S, arguments, at, given):
    """Factors as if no side were a plain variable: the user's, or a mild gradient."""
    if not S.numel():
        return np.ones(0)
    J = csr(ca.Function('sides', arguments, [ca.jacobian(S, arguments[0])])(*at))
    largest = np.abs(J).max(axis=1).toarray().ravel() if J.shape[1] else np.zeros(J.shape[0])
    return side_factors(np.where(np.isfinite(largest), largest, 0.0), given)


def _with_factors_of_variables(factors, sides, index, s_x):
    """A side that is a plain variable has that variable's factor."""
    columns, of_all, factors = index.columns(sides), np.ones(index.size), factors.copy()
    of_all[index.free] = s_x
    plain = columns >= 0
    factors[plain] = of_all[columns[plain]]
    return factors


def _are_sides(sides, index):
    """Which free variables are sides themselves; ``sides`` are addresses."""
    columns, among = index.columns(sides), np.zeros(index.size, dtype=bool)
    among[columns[columns >= 0]] = True
    return among[index.free]


def _outputs(index, f, rows, stack, S, scale, gauges):
    """The functions of the MPCC, in the order of ``MpccFunctions.NAMES``."""
    S, q = S * scale.sides, S.numel() // 2
    # term by term: the sum's order is that of the terms
    penalty = sum((stack[int(k)] for k in index.penalty), ca.SX(0))
    eta, equal = take(stack, index.eta), take(stack, index.equal)
    f = _without(f, scale.offset)
    return [f * scale.f, penalty * scale.f, rows * scale.g, S[:q], S[q:], eta, equal, gauges]


def _without(f, offset):
    """f - offset; where f is a sum with a number, the number changes, so that nothing is lost to round-off."""
    if offset == 0.0:
        return f
    number, rest = 0.0, [f]
    terms = []
    while rest:
        term = rest.pop()
        if term.is_constant():
            number += float(term)
        elif term.is_op(ca.OP_ADD):
            rest += [term.dep(1), term.dep(0)]
        else:
            terms.append(term)
    return sum(terms, ca.SX(number - offset))


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
