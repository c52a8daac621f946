"""The gas-liquid tank simulated with the PyPI package nosnoc, for comparison.

Above the outlet (M_L/rho_L > V_s) liquid leaves, below it gas leaves:

    liquid mode:  dM_G = F_G,      dM_L = F_L - L
    gas mode:     dM_G = F_G - G,  dM_L = F_L,        L = G = k (P - P_out)

with P = M_G R T / (V - M_L/rho_L) eliminated. The liquid level reaches the outlet
at t_s and slides on it afterwards. All N finite elements form one problem (one
control stage, no objective), at the default options of nosnoc.
"""

from copy import deepcopy
from time import perf_counter

import casadi as ca
import numpy as np
from nosnoc import IrkSchemes, NosnocModel, NosnocOpts, NosnocSolver

F_L, F_G = 2.5, 0.1  # feeds, mol/s
V, V_S = 10.0, 5.0  # tank volume and volume below the outlet, L
R, T = 0.082057, 300.0  # gas constant, L atm/mol/K, and temperature, K
P_OUT = 1.0  # atm
K_VALVE = 0.1  # mol/s/atm
RHO_L = 50.0  # mol/L
M_G0, M_L0 = 6.83, 260.0  # mol
HORIZON = 20.0  # s

T_S = 9.354868538871  # exact switching time, s
M_G_END = 5.496072704665  # exact M_G(20 s), mol

SCHEMES = {'RADAU': IrkSchemes.RADAU_IIA, 'GAUSS': IrkSchemes.GAUSS_LEGENDRE}
LIQUID = 0  # column of the liquid mode in F


def tank_model():
    """The tank as a Filippov system; column LIQUID of F holds where c > 0."""
    M_G, M_L = ca.SX.sym('M_G'), ca.SX.sym('M_L')
    P = M_G * R * T / (V - M_L / RHO_L)
    outflow = K_VALVE * (P - P_OUT)
    liquid_mode = ca.vertcat(F_G, F_L - outflow)
    gas_mode = ca.vertcat(F_G - outflow, F_L)
    return NosnocModel(
        x=ca.vertcat(M_G, M_L),
        x0=np.array([M_G0, M_L0]),
        F=[ca.horzcat(liquid_mode, gas_mode)],
        c=[M_L / RHO_L - V_S],
        S=[np.array([[1], [-1]])],
        name='tank',
    )


def tank_options(N, K, scheme, comp_tol):
    """Options of nosnoc for N elements of K stages; all others stay at their default.

    nosnoc derives the Ipopt tolerance (comp_tol/100) from comp_tol and writes it into
    a dict shared by all instances, hence the copy. The homotopy stops at sigma_N,
    so that a tighter comp_tol is reached only with sigma_N lowered to it.
    """
    options = NosnocOpts(terminal_time=HORIZON, N_finite_elements=N, n_s=K, irk_scheme=SCHEMES[scheme], print_level=0)
    options.opts_casadi_nlp = deepcopy(NosnocOpts.opts_casadi_nlp)
    if comp_tol is not None:
        options.comp_tol = options.sigma_N = comp_tol
    return options


def switching_time(problem, w):
    """Element boundary across which the liquid multiplier theta jumps the most.

    The results of nosnoc list element lengths as 'switch_times', so it is found here.
    """
    (elements,) = problem.ind_theta  # one control stage
    theta = np.array([[w[stage[0][LIQUID]] for stage in element] for element in elements])
    jump = np.abs(theta[1:, 0] - theta[:-1, -1])
    return w[problem.ind_h].cumsum()[jump.argmax()]


def solve_tank_with_nosnoc(N, K, scheme='RADAU', comp_tol=None):
    """Simulate the tank with N finite elements of K stages, scheme 'RADAU' or 'GAUSS'.

    Returns the 'build' and 'solve' times in s, the Ipopt 'iterations' summed over the
    'nlps' solved in the homotopy, 't_s', 'M_G_end', and 'status' as nosnoc reports it,
    that is, of the last NLP. comp_tol=None leaves the default of nosnoc (1e-8).
    """
    start = perf_counter()
    solver = NosnocSolver(tank_options(N, K, scheme, comp_tol), tank_model())
    built = perf_counter()
    results = solver.solve()
    solved = perf_counter()

    iterations = [n for n in results['nlp_iter'] if n is not None]
    return {
        'build': built - start,
        'solve': solved - built,
        'iterations': sum(iterations),
        't_s': switching_time(solver.problem, results['w_sol']),
        'M_G_end': results['x_out'][0],
        'status': results['status'].name,
        'nlps': len(iterations),
    }


def main():
    """Print times, iterations and errors against the exact solution."""
    print('scheme  K    N  build/s  solve/s  NLPs  iterations  error t_s  error M_G(20)  status')
    for scheme, K in (('RADAU', 3), ('GAUSS', 2)):
        for N in (25, 50, 100):
            run = solve_tank_with_nosnoc(N, K, scheme)
            print(
                f"{scheme:6} {K:2} {N:4} {run['build']:8.2f} {run['solve']:8.2f} {run['nlps']:5} "
                f"{run['iterations']:11} {abs(run['t_s'] - T_S):10.1e} "
                f"{abs(run['M_G_end'] - M_G_END):14.1e}  {run['status']}"
            )


if __name__ == '__main__':
    main()
