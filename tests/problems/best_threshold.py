"""A thermostat whose upper threshold is a variable: the cost of a threshold by its exact phases.

Heating y' = a - k y up to the threshold, cooling y' = -k y down to ``low``, from y(0) = 15 with the heater on; the cost is
int w (y - wish)^2 + price (while the heater is on) dt over the horizon.  Each phase is an exponential.
"""

from dataclasses import dataclass
from math import exp, log

import pyomo.dae as dae
import pyomo.environ as pyo

import pyomo_fesd

START, RATE, HEAT = 15.0, 0.2, 10.0


@dataclass(frozen=True)
class Case:
    """The numbers of one problem."""

    horizon: float = 1.6
    low: float = 17.0
    wish: float = 19.7
    weight: float = 10.0
    price: float = 10.0

    def cost(self, high: float) -> float:
        """The exact cost of a threshold."""
        return sum(
            self._phase(y - limit, limit - self.wish, duration) + self.price * duration * (limit > 0)
            for y, limit, duration in self.phases(high)
        )

    def phases(self, high: float) -> list[tuple[float, float, float]]:
        """Temperature at the beginning, limit of the exponential and duration of each phase."""
        t, y, found = 0.0, START, []
        while t < self.horizon:
            limit, goal = (0.0, self.low) if len(found) % 2 else (HEAT / RATE, high)
            found.append((y, limit, min(log((y - limit) / (goal - limit)) / RATE, self.horizon - t)))
            t, y = t + found[-1][-1], goal
        return found

    def _phase(self, k, b, duration):
        """int w (b + k exp(-RATE t))^2 dt."""
        once, twice = ((1 - exp(-n * RATE * duration)) / (n * RATE) for n in (1, 2))
        return self.weight * (b * b * duration + 2 * b * k * once + k * k * twice)


def build(case: Case, guess: float, nfe: int, ncp: int = 3) -> pyo.ConcreteModel:
    """Build the problem on moving elements, with the simulation of a guess."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, case.horizon))
    m.high = pyo.Var(initialize=guess, bounds=(case.low + 0.5, 25))
    m.y, m.J = pyo.Var(m.t, initialize=START), pyo.Var(m.t, initialize=0)
    m.dy, m.dJ, m.price = dae.DerivativeVar(m.y), dae.DerivativeVar(m.J), pyo.Var(m.t, initialize=0)
    m.y[0].fix(START)
    m.J[0].fix(0)
    m.rate = pyo.Constraint(m.t, rule=lambda m, t: m.dJ[t] == case.weight * (m.y[t] - case.wish) ** 2 + m.price[t])

    @m.Disjunct(m.t)
    def heating(d, t):
        d.until = pyo.Constraint(expr=m.y[t] <= m.high)
        d.ode = pyo.Constraint(expr=m.dy[t] == HEAT - RATE * m.y[t])
        d.price = pyo.Constraint(expr=m.price[t] == case.price)

    @m.Disjunct(m.t)
    def cooling(d, t):
        d.until = pyo.Constraint(expr=m.y[t] >= case.low)
        d.ode = pyo.Constraint(expr=m.dy[t] == -RATE * m.y[t])
        d.price = pyo.Constraint(expr=m.price[t] == 0)

    @m.Disjunction(m.t)
    def relay(m, t):
        return [m.heating[t], m.cooling[t]]

    m.heating[0].indicator_var.fix(True)
    m.cost = pyo.Objective(expr=m.J[case.horizon])
    pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.relay])
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=nfe, ncp=ncp)
    pyomo_fesd.simulate(m)
    return m
