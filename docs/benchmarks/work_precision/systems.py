"""The small problems of the work-precision study, in one form for all methods.

    dx/dt = above(x, u) where c(x) > 0,   below(x, u) where c(x) < 0

The functions only add, multiply and divide, so they serve Pyomo, casadi and numpy alike.  An objective is a function of the end
state; a cost over time is a state.  ``exact`` holds what is known: x at the end by number of the state, the time at which the
surface is reached, objective, start, controls, and dx(T)/dx0.
"""

from dataclasses import dataclass, replace
from typing import Callable, NamedTuple

import gas_liquid_tank as tank
import oscillator
import signum


class Control(NamedTuple):
    """One control between two bounds, constant on each of ``stages`` equal control stages."""

    lower: float
    upper: float
    guess: float
    stages: int


@dataclass(frozen=True)
class System:
    """Two modes and the known values of the solution."""

    name: str
    x0: tuple
    horizon: float
    switching: Callable
    #: gradient of c, for the sliding mode by hand
    gradient: Callable
    above: Callable
    below: Callable
    exact: dict
    #: bounds of the states where a problem needs them (big-M does everywhere)
    bounds: tuple = ()
    control: Control = None
    objective: Callable = None
    #: bounds of the first state at time 0, if that is free
    free_start: tuple = ()
    #: a linear form of the same system, if there is one
    linear: 'System' = None
    #: step of x0 for the difference quotient dx(T)/dx0, for problems that ask for it
    step: float = None

    @property
    def simulation(self):
        """Whether there are zero degrees of freedom."""
        return self.control is None and not self.free_start

    def at(self, start):
        """The same with another initial value of the first state."""
        return replace(self, x0=(start, *self.x0[1:]))


def _linear(A):
    return lambda x, u: [sum(a * z for a, z in zip(row, x)) for row in A]


def _outflow(x, opening=tank.VALVE, gas_constant=tank.R):
    """Flow through the valve of the tank."""
    return opening * (x[0] * gas_constant * tank.T / (tank.V - x[1] / tank.RHO_L) - tank.P_OUT)


SIGNUM = System(
    name='signum',
    x0=(-2.0,),
    horizon=signum.END,
    switching=lambda x: x[0],
    gradient=lambda x: [1.0],
    above=lambda x, u: [1.0],
    below=lambda x, u: [3.0],
    bounds=((-5, 5),),
    exact={'state': {0: signum.FINAL}, 'switch': signum.SWITCH},
)

TANK = System(
    name='tank',
    x0=(tank.M_G0, tank.M_L0),
    horizon=tank.HORIZON,
    switching=lambda x: x[1] / tank.RHO_L - tank.V_S,
    gradient=lambda x: [0.0, 1 / tank.RHO_L],
    above=lambda x, u: [tank.F_G, tank.F_L - _outflow(x)],
    below=lambda x, u: [tank.F_G - _outflow(x), tank.F_L],
    exact={'state': {0: tank.EXACT['M_G'], 1: tank.V_S * tank.RHO_L}, 'switch': tank.EXACT['t_s']},
)

# The optimum is u = 0.1 with a cost of exactly 250: any other opening costs more than it saves.
R_CONTROL, WEIGHT = 0.0820573661, 100.0
TANK_CONTROL = System(
    name='tank control',
    x0=(6.824494, tank.M_L0, 0.0),
    horizon=25.0,
    switching=TANK.switching,
    gradient=lambda x: [0.0, 1 / tank.RHO_L, 0.0],
    above=lambda x, u: [tank.F_G, tank.F_L - _outflow(x, u, R_CONTROL), WEIGHT * (u - 0.1) ** 2],
    below=lambda x, u: [tank.F_G - _outflow(x, u, R_CONTROL), tank.F_L, WEIGHT * (u - 0.1) ** 2],
    control=Control(0.0, 0.15, 0.05, 5),
    objective=lambda x: x[2] + x[1],
    exact={'state': {0: 5.4850070279964}, 'switch': 9.37452581906, 'objective': 250.0, 'control': 0.1},
)

# |x|^2 grows in both modes like exp(2 t); as a third state it makes the switching function linear.
OSCILLATOR_LINEAR = System(
    name='oscillator',
    x0=(*oscillator.X0, oscillator.X0[0] ** 2),
    horizon=oscillator.HORIZON,
    switching=lambda x: x[2] - 1,
    gradient=lambda x: [0.0, 0.0, 1.0],
    above=lambda x, u: [*_linear(oscillator.A_OUTSIDE)(x, u), 2 * x[2]],
    below=lambda x, u: [*_linear(oscillator.A_INSIDE)(x, u), 2 * x[2]],
    bounds=((-5, 5), (-5, 5), (0, 10)),
    exact={'state': dict(enumerate(oscillator.X_END)), 'switch': oscillator.SWITCH},
)

OSCILLATOR = System(
    name='oscillator',
    x0=oscillator.X0,
    horizon=oscillator.HORIZON,
    switching=lambda x: x[0] ** 2 + x[1] ** 2 - 1,
    gradient=lambda x: [2 * x[0], 2 * x[1]],
    above=_linear(oscillator.A_OUTSIDE),
    below=_linear(oscillator.A_INSIDE),
    linear=OSCILLATOR_LINEAR,
    exact=OSCILLATOR_LINEAR.exact,
)

SENSITIVITY = replace(SIGNUM, name='sensitivity', x0=(-1.0,), step=1e-3, exact={'sensitivity': 1 / 3})

# int_0^2 x^2 dt + (x(2) - 5/3)^2 over x0; the integral is a state
FALSE_MINIMA = System(
    name='false minima',
    x0=(-1.0, 0.0),
    horizon=2.0,
    switching=lambda x: x[0],
    gradient=lambda x: [1.0, 0.0],
    above=lambda x, u: [1.0, x[0] ** 2],
    below=lambda x, u: [3.0, x[0] ** 2],
    free_start=(-2.0, -0.8),
    objective=lambda x: x[1] + (x[0] - 5 / 3) ** 2,
    exact={'objective': 1.523772775374957, 'x0': -1.427572232082767},
)

SYSTEMS = {s.name: s for s in (SIGNUM, TANK, TANK_CONTROL, OSCILLATOR, SENSITIVITY, FALSE_MINIMA)}


@dataclass
class Found:
    """Result of a method: status, whether it claims success, seconds, values and work."""

    status: str
    claimed: bool
    build: float
    solve: float
    state: list = None
    switch: float = None
    objective: float = None
    x0: float = None
    control: list = None
    sensitivity: float = None
    iterations: int = None
    nlps: int = None


def reached(times, values):
    """Time at which the switching function first reaches zero, at a grid point or interpolated between two; None if never."""
    zero = 1e-4 * max(map(abs, values))
    side = values[0] > 0
    for n in range(1, len(times)):
        if abs(values[n]) <= zero:
            return times[n]
        if (values[n] > 0) != side:
            share = values[n - 1] / (values[n - 1] - values[n])
            return times[n - 1] + share * (times[n] - times[n - 1])
    return None


def errors(exact, found):
    """Error of each known quantity, relative to max(1, |exact|)."""

    def error(value, truth):
        return abs(value - truth) / max(1.0, abs(truth))

    result = {}
    for name in ('switch', 'objective', 'x0', 'sensitivity'):
        if name in exact and getattr(found, name) is not None:
            result[name] = error(getattr(found, name), exact[name])
    if 'state' in exact and found.state is not None:
        result['state'] = max(error(found.state[i], truth) for i, truth in exact['state'].items())
    if 'control' in exact and found.control is not None:
        result['control'] = max(error(u, exact['control']) for u in found.control)
    return result
