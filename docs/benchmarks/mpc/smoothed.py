"""Smoothed predictive control on a fixed grid: the usual NMPC, solved by Ipopt, of the same three plants.

The modes are blended by tanh(c/eps), the relay of the heater is replaced by a smooth heater without a memory, and the valve of the
IDAES flowsheet is IDAES' own smooth bound with its default eps.  Elements and points are as many as on the moving grid.
"""

import time

import idaes_level
import mpc_heater
import mpc_tank
import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.contrib.mpc import DynamicModelInterface, ScalarData

import pyomo_fesd

#: Widths of the smoothing: of the liquid volume (L), and of the temperature (degrees).
VOLUME_EPS, HEAT_EPS = 0.005, 1.0


def tank():
    """The tank with its modes blended."""
    m = mpc_tank.build(mpc_tank.STAGES)
    for name in ('outlet', 'above', 'below'):
        m.del_component(name)
    m.share = pyo.Expression(m.t, rule=lambda m, t: _step((m.M_L[t] / mpc_tank.RHO_L - mpc_tank.V_S) / VOLUME_EPS))
    m.gas = pyo.Constraint(m.t, rule=lambda m, t: m.dM_G[t] == m.F_G - (1 - m.share[t]) * m.N[t])
    m.liquid = pyo.Constraint(m.t, rule=lambda m, t: m.dM_L[t] == m.F_L - m.share[t] * m.N[t])
    m.loss = dae.Integral(m.t, rule=mpc_tank.stage_cost)
    m.cost = pyo.Objective(expr=m.loss)
    return _collocate(m, m.t, m.u, mpc_tank.ELEMENTS, mpc_tank.NCP)


def heater():
    """The store with a smooth heater: on below the set point, off above it."""
    m = mpc_heater.build(mpc_heater.STAGES)
    m.del_component('relay')
    m.heater = pyo.Constraint(m.t, rule=lambda m, t: m.q[t] == mpc_heater.POWER * _step((m.s[t] - m.y[t]) / HEAT_EPS))
    m.cost = pyo.Objective(expr=m.loss)
    m = _collocate(m, m.t, m.v, mpc_heater.ELEMENTS, mpc_heater.NCP)
    m.price.fix(mpc_heater.CHEAP)
    return m


def idaes():
    """The flowsheet with IDAES' own smooth bound."""
    import idaes_mpc

    m = idaes_mpc.flowsheet(idaes_mpc.STAGES, lambda m: m)
    m.cost = pyo.Objective(expr=m.fs.loss / idaes_mpc.INTERVAL)
    pid, fs = m.fs.pid, m.fs
    # applied to the flowsheet, so that pyomo.dae builds its Integral again
    _collocate(fs, fs.time, None, idaes_mpc.ELEMENTS, idaes_mpc.NCP)
    idaes_level.specify(m)
    pid.setpoint.unfix()
    pid.setpoint.setlb(0.3)
    pid.setpoint.setub(1.6)
    _hold(m, fs.time, pid.setpoint, [k * idaes_mpc.INTERVAL for k in range(idaes_mpc.STAGES + 1)])
    return m


def _step(c):
    return 0.5 * (1 + pyo.tanh(c))


def _collocate(m, wrt, u, elements, ncp):
    stages = list(wrt)
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=wrt, nfe=elements * (len(stages) - 1), ncp=ncp)
    if u is not None:
        _hold(m, wrt, u, stages)
    return m


def _hold(m, wrt, u, stages):
    _, m.held = DynamicModelInterface(m, wrt).get_piecewise_constant_constraints([u], stages)


class SmoothedControl:
    """Steps like those of ``pyomo_fesd.Controller``; without a solution the shifted plan goes on."""

    def __init__(self, problem, wrt, control, interval):
        self._problem, self._u, self._dt, self._plan = problem, control, interval, False
        self.interface = DynamicModelInterface(problem, wrt)
        self._solver = pyo.SolverFactory('casadi_ipopt')

    def step(self, measured, modes=(), time_limit=None):
        """The answer of one step."""
        began = time.perf_counter()
        if self._plan:
            self.interface.shift_values_by_time(self._dt)
        self.interface.load_data(measured, time_points=[self.interface.time.first()])
        self._plan = True
        before = [(v, v.value) for v in self._problem.component_data_objects(pyo.Var)]
        results = self._solver.solve(self._problem, load_solutions=True)
        solved = pyo.check_optimal_termination(results)
        if not solved:
            for v, number in before:
                v.set_value(number, skip_validation=True)
        control = ScalarData({self._u: self._u[self.interface.time.at(2)].value})
        seconds = time.perf_counter() - began
        return pyomo_fesd.ControlStep(control, 'smoothed' if solved else 'plan', False, str(results.solver.message), None, seconds)
