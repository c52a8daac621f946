"""The MPCC in the solver's scaled variables w and parameters p, from what stands in the NL file.

Its free variables are w / s_x, its parameters p; then f s_f, g s_g, G s_G and H s_H are functions of (w, p).
"""

import casadi as ca
import numpy as np
from pyomo.core import maximize

from pyomo_fesd.mpcc.compiled import Compiled, Numbers, csr
from pyomo_fesd.mpcc.layout import Layout
from pyomo_fesd.mpcc.scaling import Scale, side_factors


def assemble(problem, entries, nl, handles, factors):
    """The ``Compiled`` of ``problem``, whose ``entries`` stand in ``nl``; ``factors`` are the user's."""
    layout = Layout(nl, entries, handles.variables)
    variables = [nl.variables[j] for j in layout.free]
    constraints = [handles.source(nl.constraints[i]) for i in layout.own]
    pairs = layout.distinct()
    conditions = [entries.conditions[k] for k in pairs]
    sides = np.concatenate([layout.G[pairs], layout.H[pairs]])
    start, missing = _start(variables)

    s_x, s_g, s_f = factors.of(variables), factors.of(constraints), float(factors.of([problem.objective])[0])
    w, p, f, own, stack = _substitute(nl, layout, s_x)
    S, given = _take(stack, sides), factors.of([c.source for c in conditions] * 2)
    s_sides = _factors_of_expressions(S, (w, p), (start * s_x, handles.values()), given)

    scale = Scale(s_x, s_g, s_f, _with_those_of_variables(s_sides, sides, layout, s_x))
    graph = ca.Function('mpcc', [w, p], _outputs(layout, f, own, stack, S, scale))
    numbers = _numbers(problem, nl, layout, sides, scale, start, missing=missing, parameters=handles.values())
    return Compiled(graph, numbers, variables, constraints, conditions, problem.decisions)


def _start(variables):
    """The variables' values, 0 where there is none, and how many there are not."""
    start = np.array([np.nan if v.value is None else v.value for v in variables], dtype=float)
    known = np.isfinite(start)
    return np.where(known, start, 0.0), int(np.count_nonzero(~known))


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
    """What the graph returns, in the order of ``Compiled.NAMES``."""
    S, q = S * scale.sides, S.numel() // 2
    # term by term: the sum's order is that of the terms
    penalty = sum((stack[int(k)] for k in layout.penalty), ca.SX(0))
    eta, equal = _take(stack, layout.eta), _take(stack, layout.equal)
    return [f * scale.f, penalty * scale.f, own * scale.g, S[:q], S[q:], eta, equal]


def _numbers(problem, nl, layout, sides, scale, start, **facts):
    """The ``Numbers`` of ``problem`` with ``facts``; plain variables among ``sides`` (addresses) get the bound 0."""
    lbx, ubx = nl.lbx.copy(), nl.ubx[layout.free]
    columns = layout.columns(sides)
    plain = columns[columns >= 0]
    lbx[plain] = np.maximum(lbx[plain], 0.0)
    lbx = lbx[layout.free]
    variables = (nl.variables[j] for j in layout.free)
    guide = np.array([problem.artificial.get(v.parent_component(), np.inf) for v in variables], dtype=float)
    return Numbers(
        lbx=lbx * scale.x,
        ubx=ubx * scale.x,
        lbg=nl.lbg[layout.own] * scale.g,
        ubg=nl.ubg[layout.own] * scale.g,
        side_of=sides,
        artificial=np.isfinite(guide),
        guide_ubx=np.minimum(ubx, guide) * scale.x,
        x0=np.clip(start, lbx, ubx) * scale.x,
        sign=-1.0 if problem.objective is not None and problem.objective.sense == maximize else 1.0,
        has_objective=problem.objective is not None,
        scale=scale,
        **facts,
    )
