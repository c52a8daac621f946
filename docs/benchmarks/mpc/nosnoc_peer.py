"""Predictive control of the tank with the PyPI package nosnoc 0.2.0: the same problem, built once, solved at every step."""

import time

import casadi as ca
import mpc_tank as plant
import numpy as np
from benchmarks.common.nosnoc_peer import options
from nosnoc import NosnocModel, NosnocOcp, NosnocSolver, Status
from pyomo.contrib.mpc import ScalarData

import pyomo_fesd


class NosnocControl:
    """Steps like those of ``pyomo_fesd.Controller``; parameters are read from the Pyomo model ``problem``, which gets the control.

    Where nosnoc reports no success, its last control is applied all the same: the origin says so.
    """

    def __init__(self, problem):
        self._problem = problem
        gas, liquid, u, p = ca.SX.sym('M_G'), ca.SX.sym('M_L'), ca.SX.sym('u'), ca.SX.sym('p', 3)
        F_L, F_G, P_ref = ca.vertsplit(p)
        pressure = gas * plant.R * plant.T / (plant.V - liquid / plant.RHO_L)
        out = u * (pressure - plant.P_OUT)
        model = NosnocModel(
            x=ca.vertcat(gas, liquid),
            x0=np.array(list(plant.START.values())),
            F=[ca.horzcat(ca.vertcat(F_G, F_L - out), ca.vertcat(F_G - out, F_L))],
            c=[liquid / plant.RHO_L - plant.V_S],
            S=[np.array([[1], [-1]])],
            u=u,
            p_global=p,
            p_global_val=self._parameters(),
        )
        rate = plant.WEIGHT_P * (pressure - P_ref) ** 2 + plant.WEIGHT_U * (u - plant.U_REF) ** 2
        low, high = plant.U_RANGE
        ocp = NosnocOcp(lbu=np.array([low]), ubu=np.array([high]), u_guess=np.array([plant.U_REF]), f_q=rate)
        settings = options(
            *('RADAU',),
            terminal_time=plant.INTERVAL * plant.STAGES,
            N_stages=plant.STAGES,
            N_finite_elements=plant.ELEMENTS,
            n_s=plant.NCP,
            print_level=0,
        )
        self._solver = NosnocSolver(settings, model, ocp)

    def _parameters(self):
        m = self._problem
        return np.array([m.F_L.value, m.F_G.value, m.P_ref.value])

    def step(self, measured, modes=(), time_limit=None):
        """The answer of one step."""
        began = time.perf_counter()
        self._solver.set('x0', np.array([measured.get_data_from_key('M_G[*]'), measured.get_data_from_key('M_L[*]')]))
        self._solver.set('p_global', self._parameters())
        results = self._solver.solve()
        u = float(np.clip(np.ravel(results['u_list'][0])[0], *plant.U_RANGE))
        for v in self._problem.u.values():
            v.set_value(u)
        solved = results['status'] is Status.SUCCESS
        seconds = time.perf_counter() - began
        origin = 'nosnoc' if solved else 'nosnoc, no success'
        return pyomo_fesd.ControlStep(ScalarData({self._problem.u: u}), origin, False, results['status'].name, None, seconds)
