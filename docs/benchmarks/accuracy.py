"""Accuracy control: what ``pyomo_fesd.refine`` returns for a tolerance, beside the true error and the best uniform grid.

    python docs/benchmarks/accuracy.py [--only NAME] [--fresh]

writes accuracy.csv and accuracy.png beside this file; rows that are there already are skipped.  ``best N`` is the smallest number
of equal elements (within 5 %) whose true error is below the tolerance, found by trying.
"""

import argparse
import sys
import time
from bisect import bisect_left
from dataclasses import dataclass, field
from math import acos, cos, exp, pi, sin
from pathlib import Path

import numpy as np
import pandas as pd
import pyomo.dae as dae
import pyomo.environ as pyo
from matplotlib.figure import Figure
from pyomo.gdp import Disjunction
from scipy.integrate import solve_ivp

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / 'examples'))

import bouncing_ball  # noqa: E402
import gas_liquid_tank  # noqa: E402
import oscillator  # noqa: E402
import signum  # noqa: E402
import thermostat  # noqa: E402

import pyomo_fesd  # noqa: E402

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
#: Nodes nearer than this to a state jump are on either side of it.
BESIDE = 1e-6
#: Numbers of elements that are tried in search of the best one.
TRIED = sorted({round(8 * 1.05**k) for k in range(110)})
STIFF, LEVEL = 1e4, 0.5
CONTROL_HORIZON, VALVE, OBJECTIVE = 25, 1.0, 250.0


@dataclass(frozen=True)
class Problem:
    """A problem with a known answer.

    Attributes
    ----------
    build : function without arguments
        the model
    states : function of time
        ``{name of a Var: exact value}`` at the nodes
    switches : list of float
        exact times
    memory : str or None
        name of a Disjunction with memory
    values : dict
        exact values by what is to be evaluated, a function of the model
    """

    build: object
    states: object = lambda t: {}
    switches: tuple = ()
    memory: str = None
    values: dict = field(default_factory=dict)

    def model(self):
        """The model after ``fesd.dcs``."""
        m = self.build()
        pyo.TransformationFactory('fesd.dcs').apply_to(m, memory=[m.component(self.memory)] if self.memory else [])
        return m

    def error(self, m):
        """The largest true error at all element boundaries, of switching times and of the values, relative to max(1, |value|)."""
        found = [s.time for s in pyomo_fesd.switches(m)]
        if len(found) != len(self.switches):
            return np.inf
        errors = [_relative(a, b) for a, b in zip(found, self.switches)]
        errors += [_relative(evaluate(m), exact) for evaluate, exact in self.values.items()]
        time_of = pyomo_fesd.physical_time(m)
        for label in m.t.get_finite_elements():
            if min((abs(time_of[label] - t) for t in self.switches), default=1) > BESIDE:
                for name, exact in self.states(time_of[label]).items():
                    exact = exact if isinstance(exact, tuple) else (exact,)
                    data = [v for i, v in m.component(name).items() if (i[0] if isinstance(i, tuple) else i) == label]
                    errors += [_relative(v.value, x) for v, x in zip(data, exact)]
        return max(errors)


def _relative(a, b):
    return abs(a - b) / max(1.0, abs(b))


def stiff(rate=STIFF):
    """Prothero and Robinson: x' = -rate (x - cos t) - sin t down to 1/2, then -1; from x(0) = 1 the solution is cos t at first."""
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
    m.M_G, m.M_L = pyo.Var(m.t, initialize=6.824494, bounds=(0, None)), pyo.Var(m.t, initialize=260, bounds=(0, None))
    m.u = pyo.Var(m.t, initialize=0.12, bounds=(0, 0.15))
    m.dM_G, m.dM_L = dae.DerivativeVar(m.M_G), dae.DerivativeVar(m.M_L)
    m.M_G[0].fix(6.824494)
    m.M_L[0].fix(260)

    def flow(m, t):
        return VALVE * m.u[t] * (m.M_G[t] * 0.0820573661 * tank.T / (tank.V - m.M_L[t] / tank.RHO_L) - tank.P_OUT)

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


def _turning(t):
    """The oscillator: around one way inside the circle, the other way outside."""
    r, angle = exp(t - 1), 2 * pi * (t - 1)
    return {'x': (r * cos(angle), -r * sin(angle) if t <= 1 else r * sin(angle))}


def _bouncing(t):
    since = (t + bouncing_ball.FIRST) % (2 * bouncing_ball.FIRST)
    v = bouncing_ball.GRAVITY * bouncing_ball.FIRST
    return {'q': v * since - bouncing_ball.GRAVITY * since**2 / 2, 'v': v - bouncing_ball.GRAVITY * since}


def _heated(t):
    y, last, heating = float(thermostat.START), 0.0, True
    for switch in (*thermostat.switching_times(), np.inf):
        end, rest = min(t, switch), 50.0 if heating else 0.0
        y, last, heating = rest + (y - rest) * exp(-(end - last) / 5), end, not heating
        if switch >= t:
            return {'y': y}


def _end_of_tank(name):
    return lambda m: pyo.value(m.component(name)[gas_liquid_tank.HORIZON])


PROBLEMS = {
    'signum': Problem(signum.build, lambda t: {'x': min(3 * t - 2, t - signum.SWITCH)}, (signum.SWITCH,)),
    'oscillator': Problem(oscillator.build, _turning, (1.0,)),
    'tank': Problem(
        gas_liquid_tank.build,
        switches=(gas_liquid_tank.EXACT['t_s'],),
        values={_end_of_tank(name): gas_liquid_tank.EXACT[name] for name in ('M_G', 'P')},
    ),
    'thermostat': Problem(thermostat.build, _heated, tuple(thermostat.switching_times()), memory='relay'),
    'bouncing ball': Problem(bouncing_ball.build, _bouncing, tuple(bouncing_ball.impacts())),
    'stiff': Problem(stiff, lambda t: {'x': cos(t) if t <= acos(LEVEL) else LEVEL - (t - acos(LEVEL))}, (acos(LEVEL),)),
}


def controlled_answer():
    """Switching time and M_G at the end with u = 0.1: event-located to 1e-13, then the slide in closed form."""
    tank, RT = gas_liquid_tank, 0.0820573661 * gas_liquid_tank.T

    def flow(M_G, M_L):
        return 0.1 * VALVE * (M_G * RT / (tank.V - M_L / tank.RHO_L) - tank.P_OUT)

    def falls(t, x):
        return x[1] - tank.RHO_L * tank.V_S

    falls.terminal = True
    found = solve_ivp(
        lambda t, x: [tank.F_G, tank.F_L - flow(*x)], (0, 20), [6.824494, 260], 'DOP853', events=falls, rtol=1e-13, atol=1e-13
    )
    t_s, (M_G, _) = found.t_events[0][0], found.y_events[0][0]
    rate, rest = 0.1 * VALVE * RT / (tank.V - tank.V_S), tank.F_L + tank.F_G + 0.1 * VALVE * tank.P_OUT
    return t_s, rest / rate + (M_G - rest / rate) * exp(-rate * (CONTROL_HORIZON - t_s))


_T_S, _M_G = controlled_answer()
PROBLEMS['controlled tank'] = Problem(
    controlled_tank,
    switches=(_T_S,),
    values={lambda m: pyo.value(m.cost): OBJECTIVE, lambda m: pyo.value(m.M_G[CONTROL_HORIZON]): _M_G},
)


def refined(problem, tolerance, **options):
    """What ``refine`` does for a tolerance: its answer, and the true error."""
    m = problem.model()
    found = pyomo_fesd.refine(m, tolerance, **options)
    return found, problem.error(m)


def uniform(problem, number, tolerance):
    """The true error on a number of equal elements, solved as ``refine`` does; infinite without a solution."""
    m = problem.model()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=number, ncp=3)
    try:
        if m.component('cost') is None:
            pyomo_fesd.simulate(m, branch_tol=max(1e-12, 1e-3 * tolerance))
        else:
            pyo.SolverFactory('mpec_hybrid').solve(m, branch_tol=max(1e-12, 1e-3 * tolerance))
    except pyomo_fesd.FesdError:
        return np.inf
    return problem.error(m)


def best_number(problem, tolerance, enough):
    """The smallest number of equal elements that is enough, to 5 %; ``enough`` is known to be so."""
    numbers = [n for n in TRIED if n <= enough]
    place = bisect_left(numbers, True, key=lambda n: uniform(problem, n, tolerance) <= tolerance)
    return numbers[place] if place < len(numbers) else enough


def measure(name, tolerance):
    """One row."""
    problem, started = PROBLEMS[name], time.perf_counter()
    found, error = refined(problem, tolerance)
    seconds = time.perf_counter() - started
    table = found.table
    best = best_number(problem, tolerance, int(table['elements'].iloc[-1]))
    return {
        'problem': name,
        'tolerance': tolerance,
        'reached': found.reached,
        'estimate': found.error,
        'true error': error,
        'rounds': len(table),
        'N': table['elements'].iloc[-1],
        'N of all rounds': table['elements'].sum(),
        'best N': best,
        'seconds': seconds,
    }


def draw(table):
    """True errors and estimates against the tolerance; elements beside the best number."""
    figure = Figure(figsize=(10, 4.2), layout='constrained')
    errors, numbers = figure.subplots(1, 2)
    for k, (name, rows) in enumerate(table.groupby('problem', sort=False)):
        errors.loglog(rows['tolerance'], np.maximum(rows['true error'], 1e-14), 'o-', color=f'C{k}', label=name)
        errors.loglog(rows['tolerance'], np.maximum(rows['estimate'], 1e-14), 'x:', color=f'C{k}')
        numbers.loglog(rows['best N'], rows['N'], 'o-', color=f'C{k}', label=name)
    ends = [min(TOLERANCES), max(TOLERANCES)]
    errors.loglog(ends, ends, color='0.4', linewidth=0.8)
    errors.set_xlabel('tolerance asked for')
    errors.set_ylabel('true error (o), estimate (x)')
    errors.legend(fontsize='small')
    ends = np.array([table['best N'].min(), table['best N'].max()])
    for factor in (1, 2):
        numbers.loglog(ends, factor * ends, color='0.4', linewidth=0.8, linestyle='-' if factor == 1 else ':')
    numbers.set_xlabel('best number of equal elements')
    numbers.set_ylabel('elements of refine')
    return figure


def main():
    """Measure what is missing, write the table, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', help="name of one problem")
    parser.add_argument('--fresh', action='store_true', help="measure again what is there")
    chosen, path = parser.parse_args(), HERE / 'accuracy.csv'
    table = pd.read_csv(path) if path.exists() and not chosen.fresh else pd.DataFrame(columns=['problem', 'tolerance'])
    done = set(zip(table['problem'], table['tolerance']))
    for name in [chosen.only] if chosen.only else PROBLEMS:
        for tolerance in TOLERANCES:
            if (name, tolerance) not in done:
                row = pd.DataFrame([measure(name, tolerance)])
                print(row.to_string(header=table.empty, index=False), flush=True)
                table = row if table.empty else pd.concat([table, row], ignore_index=True)
                table.to_csv(path, index=False, float_format='%.4g')
    draw(table).savefig(HERE / 'accuracy.png', dpi=150)


if __name__ == '__main__':
    main()
