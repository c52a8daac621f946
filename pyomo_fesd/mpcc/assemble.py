"""The MPCC in the solver's scaled variables w and parameters p, from what stands in the NL file.

Its free variables are w / s_x, its parameters p; then f s_f, g s_g, G s_G and H s_H are functions of (w, p).
"""

import casadi as ca
import numpy as np
from pyomo.core import maximize

from pyomo_fesd.mpcc.compiled import Compiled, Move, Numbers, csr
from pyomo_fesd.mpcc.layout import Layout
from pyomo_fesd.mpcc.parameters import parameter_values
from pyomo_fesd.mpcc.scaling import Scale, side_factors
from pyomo_fesd.mpcc.source import Source, start_values


def assemble(problem, entries, nl, handles, factors):
    """The ``Compiled`` of ``problem``, whose ``entries`` stand in ``nl``; ``factors`` are the user's."""
    layout = Layout(nl, entries, handles.variables)
    variables = [nl.variables[j] for j in layout.free]
    constraints = [handles.source(nl.constraints[i]) for i in layout.own]
    pairs = layout.distinct()
    conditions = [entries.conditions[k] for k in pairs]
    sides = np.concatenate([layout.G[pairs], layout.H[pairs]])
    start, _ = start_values(variables)

    s_x, s_g, s_f = factors.of(variables), factors.of(constraints), float(factors.of([problem.objective])[0])
    w, p, f, own, stack = _substitute(nl, layout, s_x)
    S, given = _take(stack, sides), factors.of([c.source for c in conditions] * 2)
    s_sides = _factors_of_expressions(S, (w, p), (start * s_x, parameter_values(handles.parameters)), given)

    scale = Scale(s_x, s_g, s_f, _with_those_of_variables(s_sides, sides, layout, s_x))
    guides = [problem.artificial.get(v.parent_component(), (-np.inf, np.inf)) for v in variables]
    guide = np.array(guides, dtype=float).reshape(-1, 2)
    source = Source(variables, handles.parameters, _are_sides(sides, layout), guide, s_x, entries.splits)
    numbers = _numbers(problem, nl, layout, sides, scale, source, conditions, variables)
    outputs = _outputs(layout, f, own, stack, S, scale)
    return Compiled(w, p, outputs, numbers, variables, constraints, conditions, problem.decisions, source)


def _substitute(nl, layout, s_x):
    """w, p, and in terms of them f, the model's own rows and the stack of entries."""
    w, p = ca.SX.sym('w', len(layout.free)), ca.SX.sym('p', len(layout.settable))
    x = ca.SX(len(nl.variables), 1)
    x[layout.free.tolist()], x[layout.settable.tolist()] = w / s_x, p
    f, g = nl.function(x)
    # constants of a linear row stand in its bound; entries have a lower one
    constants = np.where(np.isfinite(nl.lbg), nl.lbg, 0.0)
    return w, p, f, _take(g, layout.own), layout.stack(g - constants, x)


def _take(column, positions):
    """Those elements of a column; none of a scalar would be a row for casadi."""
    return column[positions.tolist()] if len(positions) else ca.SX(0, 1)


def _factors_of_expressions(S, arguments, at, given):
    """Factors as if no side were a plain variable: the user's, or a mild gradient."""
    if not S.numel():
        return np.ones(0)
    J = csr(ca.Function('sides', arguments, [ca.jacobian(S, arguments[0])])(*at))
    largest = np.abs(J).max(axis=1).toarray().ravel() if J.shape[1] else np.zeros(J.shape[0])
    return side_factors(np.where(np.isfinite(largest), largest, 0.0), given)


def _with_those_of_variables(factors, sides, layout, s_x):
    """A side that is a plain variable has that variable's factor."""
    columns, of_all, factors = layout.columns(sides), np.ones(layout.size), factors.copy()
    of_all[layout.free] = s_x
    plain = columns >= 0
    factors[plain] = of_all[columns[plain]]
    return factors


def _outputs(layout, f, own, stack, S, scale):
    """The functions of the MPCC, in the order of ``Compiled.NAMES``."""
    S, q = S * scale.sides, S.numel() // 2
    # term by term: the sum's order is that of the terms
    penalty = sum((stack[int(k)] for k in layout.penalty), ca.SX(0))
    eta, equal = _take(stack, layout.eta), _take(stack, layout.equal)
    return [f * scale.f, penalty * scale.f, own * scale.g, S[:q], S[q:], eta, equal]


def _are_sides(sides, layout):
    """Which free variables are sides themselves; ``sides`` are addresses."""
    columns, among = layout.columns(sides), np.zeros(layout.size, dtype=bool)
    among[columns[columns >= 0]] = True
    return among[layout.free]


def _moves(problem, conditions, variables, s_x):
    """``problem.moves`` in terms of the places that the pairs have."""
    if not problem.moves:
        return []
    places = {}
    for k, condition in enumerate(conditions):
        places.setdefault(id(condition.source), []).append(k)
    columns = {id(v): j for j, v in enumerate(variables)}
    found = []
    for move in problem.moves:
        taken = [ends for one, other in move for ends in zip(places.get(id(one), ()), places.get(id(other), ()))]
        ended = [k for one, other in move if other is None for k in places.get(id(one), ())]
        short = [columns[id(v)] for v, at in move if at is True and id(v) in columns]
        starts = {columns[id(v)]: at for v, at in move if at is not True and id(v) in columns}
        if taken:
            targets, sources = zip(*taken)
            indices = [np.array(list(ends), dtype=int) for ends in (targets, sources, ended, short, starts)]
            found.append(Move(*indices, np.array(list(starts.values())) * s_x[indices[-1]]))
    return found


def _numbers(problem, nl, layout, sides, scale, source, conditions, variables):
    """The ``Numbers`` of ``problem``; ``sides`` are addresses."""
    return Numbers(
        lbg=nl.lbg[layout.own] * scale.g,
        ubg=nl.ubg[layout.own] * scale.g,
        side_of=sides,
        sign=-1.0 if problem.objective is not None and problem.objective.sense == maximize else 1.0,
        has_objective=problem.objective is not None,
        scale=scale,
        tentative=np.array([d.tentative for d in problem.decisions], dtype=bool),
        moves=_moves(problem, conditions, variables, scale.x),
        **source.read(),
    )
