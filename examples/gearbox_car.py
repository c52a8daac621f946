"""
Gearbox car: minimum time with hysteresis
=========================================

A car is to cover 150 m from rest to rest in the shortest time. Its gearbox changes up
at 15 m/s and down at 10 m/s; in between the previous gear stays engaged. Full
throttle takes 3 s to 15 m/s in gear A and 2/3 s more to 25 m/s in B; from there full
brake takes 1 s down to 10 m/s in B and 2 s more in A. These phases cover 92 1/3 m of
the 150 m, so with a control that may change at any time the exact optimum is T* =
11/3 + 52/15 + 3 = 152/15 = 10.1333 s. The control is constant on each control stage
and the final time T is a variable. Where the stages meet at 55/152 and 107/152 of the
horizon the exact optimum is reached; on equal stages it is out of reach. ::

    gear A (v up to 15):   dv/dt = u        gear B (v down to 10):   dv/dt = 3 u
    dq/dt = v,   |u| <= 5,   0 <= v <= 25

Units: m, s. Source: Nurkanovic and Diehl (2022), time-optimal control with
hysteresis.

**Why the answer is right.** T* is the optimum of continuous time. On the stages that
allow it the printed T is 2e-11 off, with the gear changes after 3 s and 8.133333 s. On
ten equal stages it cannot be reached: T is 0.9 % longer and certified as a local
optimum. That no better one exists there is not proven.
"""

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd

DISTANCE, V_MAX, U_MAX, UP, DOWN = 150, 25, 5, 15, 10
T_BEST = 152 / 15
HORIZON = 152  # labels in T/152, so that the best stage boundaries are integers
BEST_STAGES = [0, 55, 107, 152]
PICTURE = 'gearbox_car.png'


def equal_stages(number):
    """Boundaries of equal control stages."""
    return [round(HORIZON * k / number, 6) for k in range(number + 1)]


def build(stages, guess=11.0):
    """Build the time-optimal problem with these control stages and a guess of T."""
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
    """Apply both transformations, with a number of elements for each control stage."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.gear])
    number = elements * (len(m.t) - 1)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, nfe=number, ncp=2, piecewise_constant=[m.u]
    )
    return m


def simulate_guess(m):
    """Simulate throttle, coast, brake: obeys the gearbox but does not arrive."""
    for t in m.t:
        m.u[t].value = (
            U_MAX if t <= HORIZON / 3 else 0 if t <= 0.7 * HORIZON else -U_MAX
        )
    pyomo_fesd.simulate(m)


def solve(stages, elements=3, **options):
    """Build, transform, simulate, solve; returns the model and the results."""
    m = transform(build(stages), elements)
    simulate_guess(m)
    return m, pyo.SolverFactory('mpec_hybrid').solve(
        m, **{'relaxation': 'elastic', **options}
    )


def describe(name, m, results):
    """Print the answer."""
    late = m.T.value / T_BEST - 1
    print(
        f'{name}: T = {m.T.value:.8f} s, {late:+.1e} relative to 152/15 s '
        f'({results.solver.reason}).'
    )
    for switch in pyomo_fesd.switches(m):
        print(
            f'  gear {switch.before} -> {switch.after} after '
            f'{switch.time / HORIZON * m.T.value:.6f} s'
        )


def draw(m, figure):
    """Draw velocity, control and gear over time in seconds."""
    frame = pyomo_fesd.trajectory(m)
    seconds = frame.index / HORIZON * m.T.value
    speed, control = figure.subplots(2, 1, sharex=True)
    for gear, color in (('A', 'C0'), ('B', 'C1')):
        on = (frame[f'gear: {gear}'] > 0.5).astype(int)
        # an element's gear holds from its left boundary on
        speed.plot(
            seconds,
            frame['v'].where(on + on.shift(-1, fill_value=0) > 0),
            '.-',
            color=color,
            label=f'gear {gear}',
        )
    for threshold in (UP, DOWN):
        speed.axhline(threshold, color='C3', linewidth=0.6)
    speed.set_ylabel('velocity v (m/s)')
    speed.legend()
    control.step(seconds, frame['u'], where='pre')
    control.set_ylabel('control u (m/s²)')
    control.set_xlabel('time (s)')
    for switch in pyomo_fesd.switches(m):
        for axis in (speed, control):
            axis.axvline(
                switch.time / HORIZON * m.T.value,
                color='0.4',
                linestyle='--',
                linewidth=0.8,
            )


def main():
    """Solve on the best stages, then on ten equal ones; print and draw."""
    from matplotlib.figure import Figure

    whole = Figure(figsize=(11, 5), layout='constrained')
    cases = {
        'stages meet at 55/152 and 107/152 of T': BEST_STAGES,
        'ten equal stages': equal_stages(10),
    }
    for part, (name, stages) in zip(whole.subfigures(1, 2), cases.items()):
        m, results = solve(stages)
        describe(name, m, results)
        part.suptitle(f'{name}: T = {m.T.value:.4f} s')
        draw(m, part)
    whole.savefig(PICTURE, dpi=150)
    print(f'Velocity and control over time: {PICTURE}')


if __name__ == '__main__':
    main()
