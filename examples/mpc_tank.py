"""
Predictive control of a tank with a switching outlet
====================================================

A closed tank with feeds of liquid and gas has one outlet: liquid leaves while the level
is above it, gas while it is below, and where neither mode alone can hold the level it
slides at the outlet. The controller sets the opening of the valve every two seconds so
that the pressure follows a reference. The plant is not the model: its valve is smaller
and its feeds jump at times that nobody foresees, so the outlet changes its mode at such
times too. A moving-horizon estimator finds the present feeds from the last four
intervals, with the same switching model. The simulated plant has the right answer by
itself: every switch of it is an element boundary. ::

    above (M_L/rho_L > V_s):  dM_G/dt = F_G,      dM_L/dt = F_L - N
    below (M_L/rho_L < V_s):  dM_G/dt = F_G - N,  dM_L/dt = F_L,     N = k u (P - P_out)
    M_G R T/P + M_L/rho_L = V,    min  int w_P (P - P_ref)^2 + w_u (u - u_ref)^2 dt

Plant: gas_liquid_tank.py, after the paper, eq. (22) and (23).

**Why the answer is right.** The plant is simulated, not assumed: each interval is a
solution of its own, with its own valve and feeds, and every switch is an element
boundary. The loop has an answer at every step, most of them certified as local optima
of the plan. That a plan is no poor local optimum is checked by simulations with held
valves (``levels``), without which the loop follows one (see the benchmarks). The
picture obeys the modes: while the level is above the outlet no gas leaves, so the
pressure rises whatever the valve does; where the level slides, the valve holds the
reference.
"""

import random

import pyomo.dae as dae
import pyomo.environ as pyo
from gas_liquid_tank import P_OUT, RHO_L, V_S, R, T, V
from matplotlib.figure import Figure
from pyomo.contrib.mpc import IntervalData

import pyomo_fesd

INTERVAL, STAGES, ELEMENTS, NCP = 2.0, 5, 4, 3  # s
FEEDS = {'F_L': 2.5, 'F_G': 0.1}  # mol/s
START = {'M_G': 6.4, 'M_L': 255.0}  # mol
U_RANGE, U_REF = (0.02, 0.2), 0.1  # mol/(s atm)
WEIGHT_P, WEIGHT_U = 0.05, 20.0
VALVE = 0.93  # of the plant, relative to the model
PAST = 4  # intervals of the estimator
POOR = 5.0  # misfit above which another fit is tried
GUESSES = [FEEDS | {'F_L': share * FEEDS['F_L']} for share in (0.6, 1.0, 1.4)]
REFERENCES = (30.0, 24.0)  # atm, one after the other
HOLD = 15  # steps
PICTURE = 'mpc_tank.png'


def build(stages, valve=1.0, start=START):
    """Build the tank over some control stages."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[k * INTERVAL for k in range(stages + 1)])
    m.F_L, m.F_G = pyo.Var(initialize=2.5), pyo.Var(initialize=0.1)
    m.P_ref = pyo.Param(initialize=REFERENCES[0], mutable=True)
    m.M_G = pyo.Var(m.t, initialize=start['M_G'], bounds=(0.1, None))
    m.M_L = pyo.Var(m.t, initialize=start['M_L'], bounds=(1, 0.98 * V * RHO_L))
    m.dM_G, m.dM_L = dae.DerivativeVar(m.M_G), dae.DerivativeVar(m.M_L)
    m.P, m.N = pyo.Var(m.t, initialize=30.0), pyo.Var(m.t, initialize=2.5)
    m.u = pyo.Var(m.t, initialize=U_REF, bounds=U_RANGE)
    for name, amount in start.items():
        m.component(name)[0].fix(amount)
    m.gas_law = pyo.Constraint(
        m.t, rule=lambda m, t: m.P[t] * (V - m.M_L[t] / RHO_L) == m.M_G[t] * R * T
    )
    m.valve = pyo.Constraint(
        m.t, rule=lambda m, t: m.N[t] == valve * m.u[t] * (m.P[t] - P_OUT)
    )
    for feed in (m.F_L, m.F_G):
        feed.fix()

    @m.Disjunct(m.t)
    def above(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.M_L[t] / RHO_L >= V_S)
        d.gas = pyo.Constraint(expr=m.dM_G[t] == m.F_G)
        d.liquid = pyo.Constraint(expr=m.dM_L[t] == m.F_L - m.N[t])

    @m.Disjunct(m.t)
    def below(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.M_L[t] / RHO_L <= V_S)
        d.gas = pyo.Constraint(expr=m.dM_G[t] == m.F_G - m.N[t])
        d.liquid = pyo.Constraint(expr=m.dM_L[t] == m.F_L)

    @m.Disjunction(m.t)
    def outlet(m, t):
        return [m.above[t], m.below[t]]

    return m


def transform(m, elements=ELEMENTS, **options):
    """Apply both transformations, with some elements in each control stage."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, nfe=elements * (len(m.t) - 1), ncp=NCP, piecewise_constant=[m.u], **options
    )
    return m


def control_problem():
    """Build the control problem: the reference of the pressure over five stages."""
    m = build(STAGES)
    m.loss = dae.Integral(m.t, rule=stage_cost)
    m.cost = pyo.Objective(expr=m.loss)
    return transform(m)


def stage_cost(m, t):
    """Write the rate of the cost."""
    return WEIGHT_P * (m.P[t] - m.P_ref) ** 2 + WEIGHT_U * (m.u[t] - U_REF) ** 2


def plant():
    """Build the plant over one interval; its valve is smaller than in the model."""
    m = build(1, VALVE)
    m.loss = dae.Integral(m.t, rule=stage_cost)
    return pyomo_fesd.Plant(transform(m, 20), [m.u])


class Estimator:
    """Estimates the feeds from the states and controls of the last intervals.

    ``past`` holds an entry for each of them: the states at its end and the control.
    """

    def __init__(self, start=START):
        m = self.model = build(PAST, start=start)
        m.seen = pyo.Param(
            range(PAST + 1), START, initialize=lambda m, k, x: start[x], mutable=True
        )
        for name, feed in FEEDS.items():
            m.component(name).setlb(0)
            m.component(name).unfix()
            m.component(name).set_value(feed)
        # the last intervals count most; while the level slides, only the sum of the
        # feeds can be seen, and the nominal ones decide
        m.misfit = pyo.Objective(
            expr=sum(
                0.5 ** (PAST - k) * (w * (m.component(x)[t] - m.seen[k, x])) ** 2
                for k, t in enumerate(list(m.t)[1:], start=1)
                for x, w in (('M_G', 10.0), ('M_L', 1.0))
            )
            + 0.01 * sum((m.component(x) / f - 1) ** 2 for x, f in FEEDS.items())
        )
        m.u.fix()
        self._ends = list(m.t)
        transform(m)
        self._variables = list(m.component_data_objects(pyo.Var))
        self._interface = pyomo_fesd.MovingModelInterface(m)
        self._solver = pyo.SolverFactory('mpec_hybrid')
        self._solver.set_instance(m, parameters=[m.u, m.seen, m.M_G[0], m.M_L[0]])
        self.past = [(start, U_REF)]

    def __call__(self, states, control):
        """Take the states at the end of an interval; return the feeds."""
        m = self.model
        self.past = [*self.past, (states, control)][-PAST - 1 :]
        if len(self.past) <= PAST:
            return FEEDS
        self._interface.shift_values_by_time()
        controls, between = (
            [u for _, u in self.past[1:]],
            zip(self._ends, self._ends[1:]),
        )
        self._interface.load_data(IntervalData({m.u: controls}, list(between)))
        for k, (states, _) in enumerate(self.past):
            for name, amount in states.items():
                m.seen[k, name] = amount
        for name, amount in self.past[0][0].items():
            m.component(name)[0].set_value(amount)
        return self._fitted()

    def _fitted(self):
        """Fit the feeds to the past; compare a poor fit with one that has other modes.

        The fit is a local solution in the modes of the one before. The other one starts
        from the best of simulations with the feeds of before and with guesses.
        """
        before = {name: self.model.component(name).value for name in FEEDS}
        best = self._solve()
        if best[0] > POOR:
            self._simulate(min([before, *GUESSES], key=self._simulate))
            best = min(best, self._solve(), key=lambda fit: fit[0])
        if best[0] == float('inf'):
            return FEEDS
        for v, number in zip(self._variables, best[1]):
            v.set_value(number, skip_validation=True)
        return {name: self.model.component(name).value for name in FEEDS}

    def _solve(self):
        """Solve from the present values; return the misfit and all values."""
        found = self._solver.solve(self.model, warm_start=True, review=False)
        solved = found.solver.status == 'ok'
        misfit = pyo.value(self.model.misfit) if solved else float('inf')
        return misfit, [v.value for v in self._variables]

    def _simulate(self, feeds):
        """Simulate the past with some feeds; return the misfit."""
        fixed = [self.model.component(name) for name in FEEDS]
        for v, feed in zip(fixed, feeds.values()):
            v.fix(feed)
        try:
            pyomo_fesd.simulate(self.model)
            return pyo.value(self.model.misfit)
        except pyomo_fesd.FesdError:  # a tank that runs full or empty
            return float('inf')
        finally:
            for v in fixed:
                v.unfix()


class Disturbances:
    """Feeds of the plant: they jump at random, and return to their nominal values."""

    def __init__(self, seed=0):
        self._random, self.feeds = random.Random(seed), dict(FEEDS)

    def next(self):
        """Return the feeds of the next interval."""
        if self._random.random() < 0.2:
            self.feeds = {
                'F_L': FEEDS['F_L'] * self._random.choice((0.6, 1.0, 1.0, 1.4)),
                'F_G': FEEDS['F_G'] * self._random.choice((0.5, 1.0, 2.0)),
            }
        return self.feeds


def control(problem, rise=None, levels=5):
    """Build the controller; ``rise`` and ``levels`` question the shifted plan."""
    changing = [problem.P_ref, problem.F_L, problem.F_G]
    questions = {'rise': rise, 'levels': levels}
    return pyomo_fesd.Controller(problem, [problem.u], changing, **questions)


def loop(
    steps=60,
    seed=0,
    time_limit=None,
    build=control_problem,
    control=control,
    advanced=False,
):
    """Close the loop; return plant and the table of steps with the cost of each.

    With ``advanced`` each plan is prepared before its measurement is there.
    """
    problem, real, disturbances, losses = build(), plant(), Disturbances(seed), []
    controller, estimator = control(problem), Estimator()

    def before(number):
        reference = REFERENCES[number // HOLD % len(REFERENCES)]
        problem.P_ref.set_value(reference)
        real.model.P_ref.set_value(reference)
        if number:
            losses.append(pyo.value(real.model.loss))
            feeds = estimator(
                {'M_G': real.model.M_G[0].value, 'M_L': real.model.M_L[0].value},
                real.model.u[INTERVAL].value,
            )
            for name, feed in feeds.items():
                problem.component(name).set_value(feed)
        for name, feed in disturbances.next().items():
            real.model.component(name).set_value(feed)

    table = pyomo_fesd.receding_horizon(
        controller, real, steps, before, time_limit, advanced
    )
    table['cost'] = [*losses, pyo.value(real.model.loss)]
    return real, table


def draw(real, steps):
    """Draw level, pressure with its reference, valve, and the origin of each step."""
    table = real.trajectory()
    figure = Figure(figsize=(7, 6.5), layout='constrained')
    level, pressure, valve = figure.subplots(3, 1, sharex=True)
    level.plot(table['M_L'] / RHO_L)
    level.axhline(V_S, color='0.6', linewidth=0.8)
    level.set_ylabel('liquid volume (L)')
    pressure.plot(table['P'])
    reference = [REFERENCES[k // HOLD % 2] for k in range(len(steps))]
    pressure.step(steps.index, reference, 'k--', where='post', linewidth=0.8)
    pressure.set_ylabel('pressure (atm)')
    valve.step(steps.index, steps['u'], where='post', color='0.3')
    for number, (origin, some) in enumerate(steps.groupby('origin')):
        valve.plot(some.index, some['u'], '.', color=f'C{number}', label=origin)
    valve.set_ylabel('valve (mol/(s atm))')
    valve.set_xlabel('time (s)')
    valve.legend(loc='lower right', bbox_to_anchor=(1, 1), ncols=4, frameon=False)
    figure.savefig(PICTURE, dpi=150)


def main(steps=60):
    """Close the loop, count the origins of the answers, draw."""
    real, steps = loop(steps)
    print(steps['origin'].value_counts().to_string())
    print(f"median time of a step: {1e3 * steps['seconds'].median():.0f} ms")
    draw(real, steps)
    print(f'Level, pressure and valve over time: {PICTURE}')


if __name__ == '__main__':
    main()
