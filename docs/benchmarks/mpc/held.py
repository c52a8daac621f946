"""Objectives of simulations with held controls from two measured states of the tank's loop (seed 1), with the estimated feeds.

    .venv/bin/python docs/benchmarks/mpc/held.py

Writes held.csv.  The objectives of the plans in these steps are in steps_tank_pyomo_fesd.csv, at the times 72 and 90.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import mpc_tank
import pandas as pd
import pyomo.environ as pyo

from pyomo_fesd import simulate

#: Step -> reference, states and feeds.
STEPS = {
    36: (30.0, {'M_G': 6.439527, 'M_L': 250.0}, {'F_L': 2.718546, 'F_G': 0.027843}),
    45: (24.0, {'M_G': 8.296604, 'M_L': 250.0}, {'F_L': 2.776099, 'F_G': 0.111637}),
}
LEVELS = (0.02, 0.05, 0.08, 0.1, 0.12, 0.15, 0.2)


def main():
    """Simulate each state with each control."""
    m, rows = mpc_tank.control_problem(), []
    for step, (reference, states, feeds) in STEPS.items():
        m.P_ref.set_value(reference)
        for name, number in states.items():
            m.component(name)[0].set_value(number)
        for name, number in feeds.items():
            m.component(name).set_value(number)
        for u in LEVELS:
            for t in m.t:
                m.u[t].set_value(u)
            simulate(m, m.t, inputs=[m.u])
            rows.append({'step': step, 'u': u, 'objective': pyo.value(m.cost)})
    pd.DataFrame(rows).to_csv(Path(__file__).with_name('held.csv'), index=False, float_format='%.5g')


if __name__ == '__main__':
    main()
