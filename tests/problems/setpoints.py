"""A relay with hysteresis whose set-point w differs from stage to stage: x' = 1 up to w + 1, then x' = -1 down to w - 1.

With w = 0 on [0, 4], 3 on [4, 8] and -1 on [8, 12], from x = 0 rising: 1 at t = 1 (turns), -1 at 3 (turns), 0 at 4.  Then w = 3: it
goes on rising to 4 at 8.  There w = -1: 4 is above w + 1 = 0, so it turns at once, and is at 0 at 12.
"""

import pyomo.dae as dae
import pyomo.environ as pyo

SETPOINTS = {4: 0.0, 8: 3.0, 12: -1.0}
SWITCHES = [(1.0, 'rising', 'falling'), (3.0, 'falling', 'rising'), (8.0, 'rising', 'falling')]
FINAL = 0.0


def setpoint(t):
    """w at time t; a boundary belongs to the stage on its left."""
    return next(w for end, w in SETPOINTS.items() if t <= end)


def build(how='control'):
    """The set-point as a control that is held on each stage, as an algebraic variable that follows one, or as numbers in rules."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, *SETPOINTS])
    m.x = pyo.Var(m.t, initialize=0)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(0)
    if how != 'numbers':
        m.w = pyo.Var(m.t, initialize=lambda m, t: setpoint(t))
    if how == 'algebraic':
        m.goal = pyo.Var(m.t, initialize=0)
        m.follow = pyo.Constraint(m.t, rule=lambda m, t: m.goal[t] == 2 * m.w[t] / 2)
    goal = {'control': lambda m, t: m.w[t], 'algebraic': lambda m, t: m.goal[t], 'numbers': lambda m, t: setpoint(t)}[how]

    @m.Disjunct(m.t)
    def rising(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.x[t] <= goal(m, t) + 1)
        d.ode = pyo.Constraint(expr=m.dx[t] == 1)

    @m.Disjunct(m.t)
    def falling(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.x[t] >= goal(m, t) - 1)
        d.ode = pyo.Constraint(expr=m.dx[t] == -1)

    @m.Disjunction(m.t)
    def relay(m, t):
        return [m.rising[t], m.falling[t]]

    m.rising[0].indicator_var.fix(True)
    return m


def controls(m):
    """What is held on each stage."""
    return [m.w] if m.component('w') is not None else []
