"""The gas-liquid tank simulated with the PyPI package nosnoc, for comparison.

Above the outlet (M_L/rho_L > V_s) liquid leaves, below it gas leaves:

    liquid mode:  dM_G = F_G,      dM_L = F_L - L
    gas mode:     dM_G = F_G - G,  dM_L = F_L,        L = G = k (P - P_out)

with P = M_G R T / (V - M_L/rho_L) eliminated.  All N finite elements form one problem (one control stage, no objective), at the
default options of nosnoc.
"""

from time import perf_counter

import casadi as ca
import gas_liquid_tank as plant
import numpy as np
from benchmarks.common.nosnoc_peer import options, work
from nosnoc import NosnocModel, NosnocSolver

#: Column of the liquid mode in F.
LIQUID = 0


def tank_model():
    """The tank as a Filippov system; column LIQUID of F applies where c > 0."""
    M_G, M_L = ca.SX.sym('M_G'), ca.SX.sym('M_L')
    P = M_G * plant.R * plant.T / (plant.V - M_L / plant.RHO_L)
    outflow = plant.VALVE * (P - plant.P_OUT)
    liquid_mode = ca.vertcat(plant.F_G, plant.F_L - outflow)
    gas_mode = ca.vertcat(plant.F_G - outflow, plant.F_L)
    return NosnocModel(
        x=ca.vertcat(M_G, M_L),
        x0=np.array([plant.M_G0, plant.M_L0]),
        F=[ca.horzcat(liquid_mode, gas_mode)],
        c=[M_L / plant.RHO_L - plant.V_S],
        S=[np.array([[1], [-1]])],
        name='tank',
    )


def switching_time(problem, w):
    """Element boundary across which the multiplier theta of the liquid mode jumps the most.

    The results of nosnoc list element lengths as 'switch_times', so the time is computed here.
    """
    (elements,) = problem.ind_theta  # one control stage
    theta = np.array([[w[point[0][LIQUID]] for point in element] for element in elements])
    jump = np.abs(theta[1:, 0] - theta[:-1, -1])
    return w[problem.ind_h].cumsum()[jump.argmax()]


def solve_tank_with_nosnoc(N, K, scheme='RADAU', tolerance=None):
    """Simulate the tank with N finite elements of K collocation points.

    Returns the 'build' and 'solve' times in s, the 'nlps' of the homotopy and the sum of their 'iterations', 't_s', 'M_G_end', and
    the 'status' that nosnoc reports, which is that of the last NLP.
    """
    started = perf_counter()
    settings = options(scheme, tolerance, terminal_time=plant.HORIZON, N_finite_elements=N, n_s=K, print_level=0)
    solver = NosnocSolver(settings, tank_model())
    built = perf_counter()
    results = solver.solve()
    solved = perf_counter()
    return {
        'build': built - started,
        'solve': solved - built,
        't_s': switching_time(solver.problem, results['w_sol']),
        'M_G_end': results['x_out'][0],
        'status': results['status'].name,
    } | work(results)
