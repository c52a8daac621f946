"""Car with a gearbox that has hysteresis, as fast as possible over 150 m from rest to rest.

    gear A (v up to 15):   dv/dt = u          gear B (v down to 10):   dv/dt = 3 u          dq/dt = v

|u| <= 5, 0 <= v <= 25.  Up at 15, down at 10: between the two the last gear stays in.  Full throttle takes 3 s to 15 m/s in A and
2/3 s more to 25 m/s in B; from there full brake takes 1 s down to 10 m/s in B and 2 s more in A.  That makes 92 1/3 m of the 150,
so with u free at any time

    T* = 11/3 + 52/15 + 3 = 152/15 = 10.1333 s.

The control is held on each of several stages, which share the time T; T itself is a variable.  Where the stages meet at 55/152 and
107/152 of the way through, the optimum is reached; on equal stages it is not.

Units: m, s.  Source: Nurkanovic and Diehl (2022), time-optimal control with hysteresis.
"""

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd

DISTANCE, V_MAX, U_MAX, UP, DOWN = 150, 25, 5, 15, 10
T_BEST = 152 / 15
HORIZON = 152  # in units of T/152, so that the best stages are round
BEST_STAGES = [0, 55, 107, 152]
PICTURE = 'gearbox_car.png'


def equal_stages(number):
    """Boundaries of equal control stages."""
    return [round(HORIZON * k / number, 6) for k in range(number + 1)]


def build(stages, guess=11.0):
    """Time-optimal, with these control stages and a guess of T."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=stages)
    m.T = pyo.Var(initialize=guess, bounds=(1, 50))
    m.q, m.v = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0, bounds=(0, V_MAX))
    m.u = pyo.Var(m.t, initialize=1, bounds=(-U_MAX, U_MAX))
    m.dq, m.dv = dae.DerivativeVar(m.q), dae.DerivativeVar(m.v)
    m.q[0].fix(0)
    m.v[0].fix(0)
    m.way = pyo.Constraint(m.t, rule=lambda m, t: m.dq[t] == m.T / HORIZON * m.v[t])

    @m.Disjunct(m.t)
    def A(d, t):
        d.until = pyo.Constraint(expr=m.v[t] <= UP)
        d.ode = pyo.Constraint(expr=m.dv[t] == m.T / HORIZON * m.u[t])

    @m.Disjunct(m.t)
    def B(d, t):
        d.until = pyo.Constraint(expr=m.v[t] >= DOWN)
        d.ode = pyo.Constraint(expr=m.dv[t] == m.T / HORIZON * 3 * m.u[t])

    @m.Disjunction(m.t)
    def gear(m, t):
        return [m.A[t], m.B[t]]

    m.A[0].indicator_var.fix(True)
    m.arrive = pyo.Constraint(expr=m.q[HORIZON] == DISTANCE)
    m.stop = pyo.Constraint(expr=m.v[HORIZON] == 0)
    m.duration = pyo.Objective(expr=m.T)
    return m


def transform(m, elements=3):
    """Both transformations, with so many elements in each stage."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m, memory=[m.gear])
    number = elements * (len(m.t) - 1)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=number, ncp=2, piecewise_constant=[m.u])
    return m


def simulate_guess(m):
    """Throttle, coast, brake: a start that keeps the law of the gearbox, though it does not arrive."""
    for t in m.t:
        m.u[t].value = U_MAX if t <= HORIZON / 3 else 0 if t <= 0.7 * HORIZON else -U_MAX
    pyomo_fesd.simulate(m)


def solve(stages, elements=3, **options):
    """Built, transformed, simulated and solved; returns the model and the solver's results."""
    m = transform(build(stages), elements)
    simulate_guess(m)
    return m, pyo.SolverFactory('mpec_hybrid').solve(m, **{'relaxation': 'elastic', **options})


def tell(name, m, results):
    """Say in words what was found."""
    late = m.T.value / T_BEST - 1
    print(f'{name}: T = {m.T.value:.8f} s, {late:+.1e} relative to 152/15 s ({results.solver.reason}).')
    for switch in pyomo_fesd.switches(m):
        print(f'  gear {switch.before} -> {switch.after} after {switch.time / HORIZON * m.T.value:.6f} s')


def draw(m, figure):
    """Velocity, control and gear over time in seconds."""
    frame = pyomo_fesd.trajectory(m)
    seconds = frame.index / HORIZON * m.T.value
    speed, control = figure.subplots(2, 1, sharex=True)
    for gear, color in (('A', 'C0'), ('B', 'C1')):
        on = (frame[f'gear: {gear}'] > 0.5).astype(int)
        # an element belongs to its gear from its left boundary on
        speed.plot(seconds, frame['v'].where(on + on.shift(-1, fill_value=0) > 0), '.-', color=color, label=f'gear {gear}')
    for threshold in (UP, DOWN):
        speed.axhline(threshold, color='C3', linewidth=0.6)
    speed.set_ylabel('velocity v (m/s)')
    speed.legend()
    control.step(seconds, frame['u'], where='pre')
    control.set_ylabel('control u (m/s²)')
    control.set_xlabel('time (s)')
    for switch in pyomo_fesd.switches(m):
        for axis in (speed, control):
            axis.axvline(switch.time / HORIZON * m.T.value, color='0.4', linestyle='--', linewidth=0.8)


def main():
    """The best stages, where the answer is known, then ten equal ones."""
    from matplotlib.figure import Figure

    whole = Figure(figsize=(11, 5), layout='constrained')
    cases = {'stages meet at 55/152 and 107/152 of T': BEST_STAGES, 'ten equal stages': equal_stages(10)}
    for part, (name, stages) in zip(whole.subfigures(1, 2), cases.items()):
        m, results = solve(stages)
        tell(name, m, results)
        part.suptitle(f'{name}: T = {m.T.value:.4f} s')
        draw(m, part)
    whole.savefig(PICTURE, dpi=150)
    print(f'Velocity and control over time: {PICTURE}')


if __name__ == '__main__':
    main()
