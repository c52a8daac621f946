"""dx/dt = f(x) with a piecewise linear f that may jump: solved in closed form, and written in every way that Pyomo knows."""

from math import exp, log

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.contrib.piecewise import PiecewiseLinearFunction

#: Continuous, slopes 2, -1 and 0; a breakpoint at 6 where nothing changes.
BENT = ((0, 1), (1, 3), (2, 2), (6, 2), (10, 2))
#: Continuous, slopes 2 and 1/2: the errors of all elements add up.
RISING = ((0, 1), (1, 3), (10, 7.5))
#: Constant between jumps, up at 1 and down at 2.
STAIRS = ((0, 1), (1, 1), (1, 3), (2, 3), (2, 0.5), (10, 0.5))
#: Jumps down at 1 and changes its slope there.
JUMPING = ((0, 1), (1, 3), (1, 1), (10, 10))
#: Jumps from positive to negative at 1: x slides.
HOLDING = ((0, 2), (1, 2), (1, -1), (5, -3))


def exact(table, x0, end):
    """x at ``end`` and the times at which x, rising from x0, meets breakpoints; it stays where f jumps below zero."""
    x, t, met = x0, 0.0, []
    for (a, fa), (b, fb) in zip(table, table[1:]):
        if b <= x or a == b:
            continue
        m = (fb - fa) / (b - a)
        f = fa + m * (x - a)
        if f <= 0:
            return x, met
        duration = log(fb / f) / m if m else (b - x) / f
        if t + duration >= end:
            rest = end - t
            return (x + f * (exp(m * rest) - 1) / m if m else x + f * rest), met
        x, t = b, t + duration
        met.append(t)
    return x, met


def states(x0, end, lowest=0, highest=10):
    """x over time with its derivative; no dynamics yet."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    m.x = pyo.Var(m.t, bounds=(lowest, highest), initialize=x0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(x0)
    return m


def by_piecewise(table, x0, end, form='SOS2', collocate=None):
    """f as ``Piecewise`` over time, with a variable for its value."""
    m = states(x0, end)
    if collocate:
        collocate(m)
    m.y = pyo.Var(m.t, initialize=1.0)
    points, values = ([pair[k] for pair in table] for k in (0, 1))
    m.f = pyo.Piecewise(
        m.t, m.y, m.x, pw_pts=points, f_rule=values, pw_constr_type='EQ', pw_repn=form, warn_domain_coverage=False, warning_tol=-1.0
    )
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.y[t])
    return m


def function(table):
    """f as a PiecewiseLinearFunction of simplices and linear functions, the last segment first."""
    pieces = [(p, q) for p, q in zip(table, table[1:]) if p[0] < q[0]][::-1]

    def line(p, q):
        return lambda x: p[1] + (q[1] - p[1]) / (q[0] - p[0]) * (x - p[0])

    return PiecewiseLinearFunction(simplices=[(q[0], p[0]) for p, q in pieces], linear_functions=[line(*piece) for piece in pieces])


def by_function(table, x0, end, collocate=None):
    """f as a PiecewiseLinearFunction in the equation itself."""
    m = states(x0, end)
    if collocate:
        collocate(m)
    m.f = function(table)
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f(m.x[t]))
    return m


def by_table(table, x0, end, collocate=None):
    """f as a PiecewiseLinearFunction of tabular data; it cannot jump."""
    m = states(x0, end)
    if collocate:
        collocate(m)
    m.f = PiecewiseLinearFunction(tabular_data=dict(table))
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f(m.x[t]))
    return m


def in_blocks(table, x0, end, collocate=None):
    """f as a scalar ``Piecewise`` in a Block over time."""
    m = states(x0, end)
    if collocate:
        collocate(m)
    points, values = ([pair[k] for pair in table] for k in (0, 1))

    @m.Block(m.t)
    def pipe(b, t):
        m = b.model()
        b.y = pyo.Var(initialize=1.0)
        b.f = pyo.Piecewise(
            b.y, m.x[t], pw_pts=points, f_rule=values, pw_constr_type='EQ', warn_domain_coverage=False, warning_tol=-1.0
        )
        b.ode = pyo.Constraint(expr=m.dx[t] == b.y)

    return m


def functions_in_blocks(table, x0, end, collocate=None):
    """f as a PiecewiseLinearFunction of its own in a Block over time."""
    m = states(x0, end)
    if collocate:
        collocate(m)

    @m.Block(m.t)
    def pipe(b, t):
        m = b.model()
        b.f = function(table)
        b.ode = pyo.Constraint(expr=m.dx[t] == b.f(m.x[t]))

    return m


def by_conditions(table, x0, end, collocate=None):
    """f as nested ``Expr_if``s in a named Expression."""
    m = states(x0, end)
    if collocate:
        collocate(m)
    pieces = [(p, q) for p, q in zip(table, table[1:]) if p[0] < q[0]]

    def value(x):
        lines = [p[1] + (q[1] - p[1]) / (q[0] - p[0]) * (x - p[0]) for p, q in pieces]
        expr = lines[-1]
        for (_, q), line in reversed(list(zip(pieces, lines[:-1]))):
            expr = pyo.Expr_if(x <= q[0], line, expr)
        return expr

    m.f = pyo.Expression(m.t, rule=lambda m, t: value(m.x[t]))
    m.ode = pyo.Constraint(m.t, rule=lambda m, t: m.dx[t] == m.f[t])
    return m
