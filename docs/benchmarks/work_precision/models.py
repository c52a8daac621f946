"""The problems of the study as Pyomo models with a Disjunction, on moving and on fixed elements.

A problem has ``moving(K, N, scheme)`` and ``fixed(K, N, scheme)``, which return the model, and ``read(found, m)``.
"""

from dataclasses import dataclass, field
from math import ceil
from types import ModuleType

import numpy as np
import pyomo.dae as dae
import pyomo.environ as pyo
from benchmarks.work_precision.systems import System
from pyomo.gdp import Disjunction

from pyomo_fesd.finite_elements.expansion import discretise

SCHEMES = {'Radau': 'LAGRANGE-RADAU', 'Gauss': 'LAGRANGE-LEGENDRE'}


@dataclass(frozen=True)
class SystemModel:
    """One of the small systems."""

    system: System

    def at(self, start):
        """The same with another initial value of the first state."""
        return SystemModel(self.system.at(start))

    def transformed(self):
        """The model after ``fesd.dcs``, in continuous time."""
        m = add_modes(plant(self.system), self.system)
        pyo.TransformationFactory('fesd.dcs').apply_to(m)
        return m

    def moving(self, K, N, scheme):
        """The model on moving elements."""
        m = self.transformed()
        pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=N, ncp=K, scheme=SCHEMES[scheme])
        return m

    def fixed(self, K, N, scheme):
        """The model on the grid of pyomo.dae; Disjunctions are added afterwards, because pyomo.dae cannot discretise them."""
        m = plant(self.system)
        pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=N, ncp=K, scheme=SCHEMES[scheme])
        return add_modes(m, self.system)

    def read(self, found, m):
        """Store end state, objective, initial state and controls in ``found``."""
        system = self.system
        end = state(m, system.horizon)
        if any(x.value is None for x in end):
            return
        found.state = [x.value for x in end]
        if system.objective is not None:
            found.objective = pyo.value(m.cost)
        if system.free_start:
            found.x0 = m.x[0, 0].value
        if system.control:
            found.control = [u.value for u in m.u.values()]


@dataclass(frozen=True)
class ControlModel:
    """A larger control problem, given by its module in ``benchmarks.ocp``."""

    module: ModuleType
    exact: dict = field(compare=False)

    def moving(self, K, N, scheme):
        """The model on moving elements."""
        return self.module.discretise(self.module.build(), elements=N // self.module.STAGES, ncp=K, scheme=SCHEMES[scheme])

    def fixed(self, K, N, scheme):
        """The model on equal elements; the control is constant on each control stage, as on moving ones."""
        m = self.module.build()
        stages = list(m.t)
        elements = [N // self.module.STAGES] * (len(stages) - 1)
        discretise(m, m.t, elements, K, SCHEMES[scheme], [m.u])
        m.hold = pyo.ConstraintList()
        for t in m.t:
            end = next(s for s in stages[1:] if t <= s)
            if t != end:
                for u, last in zip(m.u[t, ...], m.u[end, ...]):
                    m.hold.add(u == last)
        return m

    def read(self, found, m):
        """Store the objective in ``found``."""
        found.objective = pyo.value(m.cost, exception=False)


def plant(system):
    """States, controls and objective, without the modes."""
    m = pyo.ConcreteModel()
    control = system.control
    stages = control.stages if control else 1
    m.t = dae.ContinuousSet(initialize=np.linspace(0, system.horizon, stages + 1).tolist())
    m.i = pyo.RangeSet(0, len(system.x0) - 1)
    bounds = (lambda m, t, i: system.bounds[i]) if system.bounds else None
    m.x = pyo.Var(m.t, m.i, initialize=lambda m, t, i: system.x0[i], bounds=bounds)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for i in m.i:
        m.x[0, i].fix(system.x0[i])
    if system.free_start:
        m.x[0, 0].unfix()
        m.x[0, 0].setlb(system.free_start[0])
        m.x[0, 0].setub(system.free_start[1])
    if control:
        m.u = pyo.Var(range(1, stages + 1), initialize=control.guess, bounds=control[:2])
    if system.objective is not None:
        m.cost = pyo.Objective(expr=system.objective(state(m, system.horizon)))
    return m


def state(m, t):
    """States at one time."""
    return [m.x[t, i] for i in m.i]


def control_at(m, system, t):
    """Control of the control stage that contains t; a boundary belongs to the stage before it."""
    return m.u[max(1, ceil(t / system.horizon * system.control.stages - 1e-9))] if system.control else None


def add_modes(m, system):
    """Add both modes as a Disjunction."""

    def rates(t, side):
        return [m.dx[t, i] == rate for i, rate in zip(m.i, side(state(m, t), control_at(m, system, t)))]

    @m.Disjunction(m.t)
    def surface(m, t):
        c = system.switching(state(m, t))
        return [[c >= 0, *rates(t, system.above)], [c <= 0, *rates(t, system.below)]]

    return m


def smooth(m, weight):
    """Replace each Disjunction by a mixture of its modes; ``weight`` maps the switching function to the share of the first one."""
    m.mixture = pyo.ConstraintList()
    for choice in m.component_data_objects(Disjunction, active=True):
        (condition, *first), (_, *second) = (_sorted_constraints(mode) for mode in choice.disjuncts)
        share = weight(condition.body - condition.lower if condition.has_lb() else condition.upper - condition.body)
        for a, b in zip(first, second):
            m.mixture.add(share * (a.body - a.upper) + (1 - share) * (b.body - b.upper) == 0)
        choice.deactivate()
        for mode in choice.disjuncts:
            mode.indicator_var.fix(False)
            mode.deactivate()
    return m


def _sorted_constraints(mode):
    """Constraints of a mode, its one region condition before the equations."""
    return sorted(mode.component_data_objects(pyo.Constraint), key=lambda c: c.equality)
