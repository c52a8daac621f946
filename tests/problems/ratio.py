"""A table of r v: v(t) = k t, the ratio r is 2 below v = 1 and 1 above, dy/dt = max(0, r v - b) by a table, 0 <= t <= 2.

r v is 2 k t until t = 1/k and then k t, so the kink at b may be passed before, at, or after the jump, or twice.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.contrib.piecewise import PiecewiseLinearFunction
from pyomo.gdp import Disjunction


def exact(b, k=1.0):
    """y(2)."""

    def area(left, right, slope):
        start = min(max(b / slope, left), right)
        return slope * (right**2 - start**2) / 2 - b * (right - start)

    return area(0, 1 / k, 2 * k) + area(1 / k, 2, k)


def build(b, argument='variable'):
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.k = pyo.Var(initialize=1, bounds=(0.6, 1.8))
    m.k.fix()
    m.v, m.y = pyo.Var(m.t, initialize=0, bounds=(0, 5)), pyo.Var(m.t, initialize=0)
    m.dv, m.dy = dae.DerivativeVar(m.v), dae.DerivativeVar(m.y)
    m.v[0].fix(0)
    m.y[0].fix(0)
    m.r, m.w = pyo.Var(m.t, initialize=1, bounds=(0, 3)), pyo.Var(m.t, initialize=0, bounds=(0, 10))
    m.f = pyo.Var(m.t, initialize=0)
    m.speed = pyo.Constraint(m.t, rule=lambda m, t: m.dv[t] == m.k)
    m.gear = Disjunction(m.t, rule=lambda m, t: [[m.v[t] <= 1, m.r[t] == 2], [m.v[t] >= 1, m.r[t] == 1]])
    m.force = pyo.Constraint(m.t, rule=lambda m, t: m.w[t] == m.r[t] * m.v[t])
    if argument == 'variable':
        m.table = pyo.Piecewise(
            m.t, m.f, m.w, pw_pts=[0, b, 10], f_rule=[0, 0, 10 - b], pw_constr_type='EQ', pw_repn='SOS2', warn_domain_coverage=False
        )
    else:
        m.table = PiecewiseLinearFunction(points=[0, b, 10], function=lambda w: max(0.0, w - b))
        m.look_up = pyo.Constraint(m.t, rule=lambda m, t: m.f[t] == m.table(m.r[t] * m.v[t]))
    m.work = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == m.f[t])
    return m
