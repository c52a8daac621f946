"""Time-optimal control of a car whose gearbox has hysteresis.

    gear A:  dv/dt = u     up to v = 15            gear B:  dv/dt = 3 u     down to v = 10
    dq/dt = v,   |u| <= 5,   0 <= v <= 25,   from (0, 0) to (150, 0) in minimum time T

In continuous time the car accelerates in A for 3 s to v = 15, then in B to v = 25, holds it, brakes in B to v = 10 and in A to
rest: T* = 152/15.  Controls are constant on each stage.  With stages that end where the control changes (at 55/152 and 107/152
of the horizon) T* is attained; ten equal stages come within 1 %.

There are many local minima, as the control of the stage in which the gear changes serves both gears (T from 10.23 to 15 and more,
all certified): ``relaxation='elastic'`` finds better ones here than the default, and several starts better still.  Units: m, s.
"""

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd

BEST = 152 / 15
EQUAL = tuple(k / 10 for k in range(11))
FITTING = (0, 55 / 152, 107 / 152, 1)
PICTURE = 'gearbox_car.png'


def build(stages=EQUAL):
    """The car on a horizon of one nominal second for each second of T*; ``stages`` are ends of control stages, 0 to 1."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[BEST * s for s in stages])
    m.T = pyo.Var(initialize=12, bounds=(1, 50))
    m.q = pyo.Var(m.t, initialize=0)
    m.v = pyo.Var(m.t, initialize=0, bounds=(0, 25))
    m.u = pyo.Var(m.t, initialize=1, bounds=(-5, 5))
    m.dq, m.dv = dae.DerivativeVar(m.q), dae.DerivativeVar(m.v)
    m.q[0].fix(0)
    m.v[0].fix(0)
    m.rolls = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.v[t])

    @m.Disjunct(m.t)
    def A(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.v[t] <= 15)
        d.ode = pyo.Constraint(expr=m.dv[t] == m.u[t])

    @m.Disjunct(m.t)
    def B(d, t):
        m = d.model()
        d.until = pyo.Constraint(expr=m.v[t] >= 10)
        d.ode = pyo.Constraint(expr=m.dv[t] == 3 * m.u[t])

    @m.Disjunction(m.t)
    def gear(m, t):
        return [m.A[t], m.B[t]]

    m.A[0].indicator_var.fix(True)
    end = m.t.last()
    m.arrives = pyo.Constraint(expr=m.q[end] == 150)
    m.stands = pyo.Constraint(expr=m.v[end] == 0)
    m.time = pyo.Objective(expr=m.T)
    return m


def solve(stages=EQUAL, each=3, **options):
    """Transform and solve with ``each`` elements a stage; returns the model and the results."""
    m = build(stages)
    pyo.TransformationFactory('fesd.dcs').apply_to(m, memory=[m.gear])
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, nfe=each * (len(stages) - 1), ncp=2, piecewise_constant=[m.u], final_time=m.T
    )
    return m, pyo.SolverFactory('mpec_hybrid').solve(m, **({'relaxation': 'elastic', 'starts': 4, 'seed': 1} | options))


def main():
    """Solve on equal and on fitting stages, say what was found, draw the first."""
    for stages, title in ((EQUAL, 'ten equal stages'), (FITTING, 'three fitting stages')):
        m, results = solve(stages)
        T = m.T.value
        print(f"{title}: T = {T:.6f} s, {100 * (T / BEST - 1):.2e} % above T*; {results.solver.reason}")
        print(pyomo_fesd.switches(m))
        if stages is EQUAL:
            pyomo_fesd.plot(m, m.t, ['q', 'v', 'u', 'gear'], units={'q': 'q (m)', 'v': 'v (m/s)', 'u': 'u (m/s2)'}).savefig(PICTURE)


if __name__ == '__main__':
    main()
