"""Problems of the refinement study: plants that switch, with exact solutions."""

from dataclasses import dataclass, field
from math import acos, cos, exp, pi, sin

import bouncing_ball
import gas_liquid_tank
import numpy as np
import oscillator
import pyomo.dae as dae
import pyomo.environ as pyo
import signum
import thermostat
from benchmarks.common.exact import thermostat_temperature
from pyomo.gdp import Disjunction
from scipy.integrate import solve_ivp

import pyomo_fesd

#: Element boundaries nearer than this to a state jump are not compared: they may lie on either side of it.
NEAR_A_SWITCH = 1e-6
STIFF, LEVEL = 1e4, 0.5
CONTROL_HORIZON, VALVE, OBJECTIVE = 25, 1.0, 250.0
#: Gas constant of the tank with control, L atm/(mol K), and its initial gas holdup, mol.
R, M_G0 = 0.0820573661, 6.824494


@dataclass(frozen=True)
class Problem:
    """A problem with an exact solution.

    Attributes
    ----------
    build : function without arguments
        builds the model
    states : function of time
        ``{name of a Var: exact value}``; a tuple for an indexed state
    switches : sequence of float
        exact switching times
    hysteresis : str or None
        name of a Disjunction with hysteresis
    values : dict
        exact values by the function of the model that evaluates them
    """

    build: object
    states: object = lambda t: {}
    switches: tuple = ()
    hysteresis: str = None
    values: dict = field(default_factory=dict)

    def model(self):
        """The model after ``fesd.dcs``."""
        m = self.build()
        pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.component(self.hysteresis)] if self.hysteresis else [])
        return m

    def error(self, m):
        """Largest error of states at element boundaries, of switching times and of values, each relative to max(1, |exact|)."""
        found = [s.time for s in pyomo_fesd.switches(m)]
        if len(found) != len(self.switches):
            return np.inf
        errors = [_relative(a, b) for a, b in zip(found, self.switches)]
        errors += [_relative(evaluate(m), exact) for evaluate, exact in self.values.items()]
        return max([*errors, *self._errors_of_states(m)])

    def _errors_of_states(self, m):
        time_of = pyomo_fesd.physical_time(m)
        for label in m.t.get_finite_elements():
            time = time_of[label]
            if min((abs(time - t) for t in self.switches), default=1) > NEAR_A_SWITCH:
                for name, exact in self.states(time).items():
                    values = [v.value for i, v in m.component(name).items() if (i[0] if isinstance(i, tuple) else i) == label]
                    yield from map(_relative, values, exact if isinstance(exact, tuple) else (exact,))


def _relative(value, exact):
    return abs(value - exact) / max(1.0, abs(exact))


def stiff(rate=STIFF):
    """Prothero and Robinson: x' = -rate (x - cos t) - sin t down to 1/2, then -1; with x(0) = 1 the first part is x = cos t."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.x = pyo.Var(m.t, initialize=1)
    m.dx = dae.DerivativeVar(m.x)
    m.x[0].fix(1)
    s = pyomo_fesd.clock(m, m.t)
    m.mode = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.x[t] >= LEVEL, m.dx[t] == -rate * (m.x[t] - pyo.cos(s[t])) - pyo.sin(s[t])],
            [m.x[t] <= LEVEL, m.dx[t] == -1],
        ],
    )
    return m


def controlled_tank():
    """The gas-liquid tank with its valve as a control: min int 100 (u - 0.1)^2 dt + M_L(25), 0 <= u <= 0.15; u = 0.1, J = 250."""
    tank = gas_liquid_tank
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, CONTROL_HORIZON))
    m.M_G, m.M_L = pyo.Var(m.t, initialize=M_G0, bounds=(0, None)), pyo.Var(m.t, initialize=tank.M_L0, bounds=(0, None))
    m.u = pyo.Var(m.t, initialize=0.12, bounds=(0, 0.15))
    m.dM_G, m.dM_L = dae.DerivativeVar(m.M_G), dae.DerivativeVar(m.M_L)
    m.M_G[0].fix(M_G0)
    m.M_L[0].fix(tank.M_L0)

    def flow(m, t):
        return VALVE * m.u[t] * (m.M_G[t] * R * tank.T / (tank.V - m.M_L[t] / tank.RHO_L) - tank.P_OUT)

    m.outlet = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.M_L[t] / tank.RHO_L >= tank.V_S, m.dM_G[t] == tank.F_G, m.dM_L[t] == tank.F_L - flow(m, t)],
            [m.M_L[t] / tank.RHO_L <= tank.V_S, m.dM_G[t] == tank.F_G - flow(m, t), m.dM_L[t] == tank.F_L],
        ],
    )
    m.spent = dae.Integral(m.t, rule=lambda m, t: 100 * (m.u[t] - 0.1) ** 2)
    m.cost = pyo.Objective(expr=m.spent + m.M_L[CONTROL_HORIZON])
    return m


def controlled_answer():
    """Switching time and final M_G with u = 0.1: an event located to 1e-13, then the slide in closed form."""
    tank, RT = gas_liquid_tank, R * gas_liquid_tank.T

    def flow(M_G, M_L):
        return 0.1 * VALVE * (M_G * RT / (tank.V - M_L / tank.RHO_L) - tank.P_OUT)

    def falls(t, x):
        return x[1] - tank.RHO_L * tank.V_S

    falls.terminal = True
    found = solve_ivp(
        lambda t, x: [tank.F_G, tank.F_L - flow(*x)], (0, 20), [M_G0, tank.M_L0], 'DOP853', events=falls, rtol=1e-13, atol=1e-13
    )
    t_s, (M_G, _) = found.t_events[0][0], found.y_events[0][0]
    rate, rest = 0.1 * VALVE * RT / (tank.V - tank.V_S), tank.F_L + tank.F_G + 0.1 * VALVE * tank.P_OUT
    return t_s, rest / rate + (M_G - rest / rate) * exp(-rate * (CONTROL_HORIZON - t_s))


def _oscillating(t):
    """State of the oscillator: it turns one way inside the unit circle, the other way outside."""
    r, angle = exp(t - 1), 2 * pi * (t - 1)
    return {'x': (r * cos(angle), -r * sin(angle) if t <= 1 else r * sin(angle))}


def _bouncing(t):
    since = (t + bouncing_ball.FIRST) % (2 * bouncing_ball.FIRST)
    v = bouncing_ball.GRAVITY * bouncing_ball.FIRST
    return {'q': v * since - bouncing_ball.GRAVITY * since**2 / 2, 'v': v - bouncing_ball.GRAVITY * since}


def _end_of_tank(name):
    return lambda m: pyo.value(m.component(name)[gas_liquid_tank.HORIZON])


_T_S, _M_G = controlled_answer()
PROBLEMS = {
    'signum': Problem(signum.build, lambda t: {'x': min(3 * t - 2, t - signum.SWITCH)}, (signum.SWITCH,)),
    'oscillator': Problem(oscillator.build, _oscillating, (1.0,)),
    'tank': Problem(
        gas_liquid_tank.build,
        switches=(gas_liquid_tank.EXACT['t_s'],),
        values={_end_of_tank(name): gas_liquid_tank.EXACT[name] for name in ('M_G', 'P')},
    ),
    'thermostat': Problem(
        thermostat.build, lambda t: {'y': thermostat_temperature(t)}, tuple(thermostat.switching_times()), hysteresis='relay'
    ),
    'bouncing ball': Problem(bouncing_ball.build, _bouncing, tuple(bouncing_ball.impacts())),
    'stiff': Problem(stiff, lambda t: {'x': cos(t) if t <= acos(LEVEL) else LEVEL - (t - acos(LEVEL))}, (acos(LEVEL),)),
    'controlled tank': Problem(
        controlled_tank,
        switches=(_T_S,),
        values={lambda m: pyo.value(m.cost): OBJECTIVE, lambda m: pyo.value(m.M_G[CONTROL_HORIZON]): _M_G},
    ),
}
