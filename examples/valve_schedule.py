"""
Valve open or shut in each hour, beside a weir that switches by itself
======================================================================

A tank is fed, and a valve empties it in the hours in which it is open. Where the level
is above the weir, water spills. To open the valve has another price in every hour. When
should it be open? ::

    min  sum_k price_k y_k + penalty int spill dt
    s.t. dh/dt = inflow(t) - K y_k h - spill,  spill = weir max(0, h - H),  y_k = 0 or 1

First the relaxed problem, 0 <= y_k <= 1. *Sum-up rounding* of its answer gives a
schedule whose openings add up to the relaxed ones within one hour, at any time. Then
all 32 schedules are solved and certified, one by one. With a given schedule nothing is
left to choose, so each answer is a simulation, and the best one is the global optimum.

**Why the answer is right.** All 32 schedules are solved, each is a certified
simulation, and the printed table shows the best ones: no bound and no heuristic is
involved. The relaxed costs are below all of them, as they must be if its local optimum
is the global one. The warning about the weir concerns the relaxed problem, which only
suggests a schedule.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from matplotlib.figure import Figure

import pyomo_fesd

PRICES = (1.2, 0.8, 0.5, 1.5, 0.7)
HOURS = len(PRICES)
INFLOW, SWING, VALVE, WEIR, HEIGHT, PENALTY = 0.7, 0.5, 1.5, 3.0, 1.0, 2.0
PICTURE = 'valve_schedule.png'


def build():
    """Build the tank with a binary variable for each hour, ready for the solver."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=range(HOURS + 1))
    m.y = pyo.Var(range(HOURS), domain=pyo.Binary, initialize=0)
    m.time = pyomo_fesd.clock(m.t)
    m.h, m.spill = pyo.Var(m.t, initialize=0.8), pyo.Var(m.t, initialize=0)
    m.cost = pyo.Var(m.t, initialize=0)
    m.dh, m.dcost = dae.DerivativeVar(m.h), dae.DerivativeVar(m.cost)
    m.h[0].fix(0.8)
    m.cost[0].fix(0)

    @m.Constraint(m.t)
    def level(m, t):
        # the hour that ends at t contains it
        hour = max(0, -int(-t // 1) - 1)
        inflow = INFLOW + SWING * pyo.sin(m.time[t])
        return m.dh[t] == inflow - VALVE * m.y[hour] * m.h[t] - m.spill[t]

    @m.Constraint(m.t)
    def spilled(m, t):
        return m.dcost[t] == PENALTY * m.spill[t]

    @m.Disjunction(m.t)
    def weir(m, t):
        return [
            [m.h[t] <= HEIGHT, m.spill[t] == 0],
            [m.h[t] >= HEIGHT, m.spill[t] == WEIR * (m.h[t] - HEIGHT)],
        ]

    m.total = pyo.Objective(
        expr=m.cost[HOURS] + sum(PRICES[k] * m.y[k] for k in range(HOURS))
    )
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=10, ncp=3)
    return m


def relaxed():
    """Solve the relaxed problem; returns it with its rounding."""
    m = build()
    pyo.TransformationFactory('core.relax_integer_vars').apply_to(m)
    pyo.SolverFactory('mpec_hybrid').solve(m)
    y = [min(max(m.y[k].value, 0), 1) for k in range(HOURS)]
    return m, pyomo_fesd.sum_up_rounding([(1 - part, part) for part in y])


def draw(m, relaxed):
    """Draw the level of the best schedule, with its open hours, and the relaxed one."""
    figure = Figure(figsize=(8, 4.5), layout='constrained')
    axis = figure.subplots()
    for k in range(HOURS):
        if m.y[k].value > 0.5:
            axis.axvspan(k, k + 1, color='C0', alpha=0.12, linewidth=0)
    axis.plot(pyomo_fesd.trajectory(m)['h'], label='best schedule (shaded: valve open)')
    axis.plot(pyomo_fesd.trajectory(relaxed)['h'], '--', label='relaxed')
    axis.axhline(HEIGHT, color='0.4', linewidth=0.8)
    axis.annotate('weir', (0.05, HEIGHT), (0, 3), textcoords='offset points')
    axis.set_xlabel('time (h)')
    axis.set_ylabel('level h (m)')
    axis.legend()
    figure.savefig(PICTURE, dpi=150)


def main():
    """Relax, round, decide; print and draw."""
    fractions, rounded = relaxed()
    y = ', '.join(f'{fractions.y[k].value:.3f}' for k in range(HOURS))
    print(f'Relaxed: open for {y} of each hour, costs {pyo.value(fractions.total):.4f}')
    m = build()
    found = pyomo_fesd.decide_integers(m)
    schedules = found.table.set_index([f'y[{k}]' for k in range(HOURS)])
    costs = schedules.loc[tuple(rounded.modes), 'objective']
    print(
        f'Rounded: {rounded.modes.tolist()}, costs {costs:.4f}; openings differ by at '
        f'most {rounded.deviation:.3f} h, the bound is {rounded.bound:.0f} h'
    )
    print(
        f'Of {len(schedules)} schedules, {schedules["certified"].sum()} certified, the '
        f'best is {[round(m.y[k].value) for k in range(HOURS)]}: '
        f'costs {pyo.value(m.total):.4f}'
    )
    print(schedules['objective'].nsmallest(4).to_string())
    draw(m, fractions)


if __name__ == '__main__':
    main()
