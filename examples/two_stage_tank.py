"""
Two-stage decision: how large a storm tank, before the storm is known
=====================================================================

The size S of a tank is bought now; the flow u of the pump is set when the storm is
known. Above S water goes over the weir, in every storm at other times. ::

    min  price S + sum_k p_k (left v_k(T)^2 + int energy u_k^2 + penalty spill_k^2 dt)
    s.t. dv_k/dt = inflow_k - u_k - spill_k,     spill_k = weir max(0, v_k - S)

All storms with the common size in one model are the *extensive form*, which
``mpec_hybrid`` solves directly. Progressive hedging of mpi-sppy solves storm by storm
instead, on as many processes as there are: each storm has a size of its own, and terms
in its objective pull the sizes together. Two algorithms that share no step agree. Each
answer is certified as a local optimum; that it is the global one is not proven. ::

    pip install mpi-sppy mpi4py
    mpiexec -n 2 python examples/two_stage_tank.py

**Why the answer is right.** The extensive form and progressive hedging share no step,
and their sizes and costs agree (a test asks for 5e-3 m3 and 1e-4). Another test fixes
the size beside the answer, optimises the rest, and finds higher costs on both sides.
"""

from importlib.util import find_spec

import pyomo.dae as dae
import pyomo.environ as pyo
from matplotlib.figure import Figure

import pyomo_fesd

HORIZON = 4  # h
PRICE, ENERGY, PENALTY, LEFT = 1.0, 0.5, 4.0, 0.8
WEIR = 4.0  # 1/h
PUMP = 1.0  # largest flow, m3/h
#: Times (h) and inflows (m3/h) of each storm, all equally probable.
STORMS = {
    'drizzle': {0: 0.6, 2: 0.4, 4: 0.4},
    'shower': {0: 2.6, 1: 0.2, 4: 0.2},
    'storm': {0: 1.0, 1: 3.2, 2: 0.3, 4: 0.3},
    'long_rain': {0: 1.6, 3: 0.5, 4: 0.5},
}
PICTURE = 'two_stage_tank.png'


def build(storm):
    """Build the tank in one storm, with its size as a variable and its costs."""
    m = pyo.ConcreteModel()
    m.size = pyo.Var(bounds=(0, 5), initialize=1.0)
    m.t = dae.ContinuousSet(bounds=(0, HORIZON))
    m.inflow = pyomo_fesd.signal(m.t, STORMS[storm], kind='stepped')
    m.v = pyo.Var(m.t, bounds=(0, None), initialize=0.5)
    m.cost = pyo.Var(m.t, initialize=0)
    m.u = pyo.Var(bounds=(0, PUMP), initialize=0.5)
    m.spill = pyo.Var(m.t, initialize=0)
    m.dv, m.dcost = dae.DerivativeVar(m.v), dae.DerivativeVar(m.cost)
    m.v[0].fix(0)
    m.cost[0].fix(0)

    @m.Constraint(m.t)
    def volume(m, t):
        return m.dv[t] == m.inflow[t] - m.u - m.spill[t]

    @m.Constraint(m.t)
    def running_cost(m, t):
        return m.dcost[t] == ENERGY * m.u**2 + PENALTY * m.spill[t] ** 2

    @m.Disjunction(m.t)
    def weir(m, t):
        return [
            [m.v[t] <= m.size, m.spill[t] == 0],
            [m.v[t] >= m.size, m.spill[t] == WEIR * (m.v[t] - m.size)],
        ]

    m.purchase = pyo.Expression(expr=PRICE * m.size)
    m.total = pyo.Objective(
        expr=m.purchase + m.cost[HORIZON] + LEFT * m.v[HORIZON] ** 2
    )
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=6, ncp=3)
    return m


def extensive_form():
    """Solve all storms in one model; returns it, with a block for each storm."""
    m = pyo.ConcreteModel()
    for name in STORMS:
        m.add_component(name, build(name))
        m.component(name).total.deactivate()
    first, *others = map(m.component, STORMS)
    m.same = pyo.ConstraintList(rule=(other.size == first.size for other in others))
    m.total = pyo.Objective(
        expr=sum(storm.total.expr for storm in (first, *others)) / len(STORMS)
    )
    pyo.SolverFactory('mpec_hybrid').solve(m)
    return m


def scenario_creator(name, **_):
    """Build a storm as mpi-sppy asks for it: with its probability and its size."""
    from mpisppy.utils import sputils

    m = build(name)
    m._mpisppy_probability = 1 / len(STORMS)
    sputils.attach_root_node(m, m.purchase, [m.size])
    return m


def progressive_hedging(rho=2.0, iterations=40, accuracy=1e-3):
    """Solve storm by storm with mpi-sppy; returns its PH object and the costs."""
    from mpisppy.opt.ph import PH

    options = {
        'solver_name': 'mpec_hybrid',
        'PHIterLimit': iterations,
        'defaultPHrho': rho,
        'convthresh': accuracy,  # mean distance from the mean size
        'warmstart_subproblems': True,
        'verbose': False,
        'display_progress': False,
        'display_timing': False,
    }
    hedging = PH(options, list(STORMS), scenario_creator)
    _, costs, _ = hedging.ph_main()
    return hedging, costs


def draw(m):
    """Draw the volumes of the extensive form and its size."""
    figure = Figure(figsize=(8, 4.5), layout='constrained')
    axis = figure.subplots()
    for name in STORMS:
        storm = m.component(name)
        volume = pyomo_fesd.trajectory(storm, storm.t).filter(regex=r'(^|\.)v$')
        label = f'{name.replace("_", " ")}, pump {storm.u.value:.2f} m³/h'
        axis.plot(volume, label=label)
    axis.axhline(m.component(name).size.value, color='0.4', linestyle='--')
    axis.set_xlabel('time (h)')
    axis.set_ylabel('volume (m³); dashed: size of the tank')
    figure.legend(loc='outside lower center', ncols=2)
    figure.savefig(PICTURE, dpi=150)


def main():
    """Solve by progressive hedging, if mpi-sppy is there, and as one model."""
    rank = 0
    if find_spec('mpisppy'):
        hedging, costs = progressive_hedging()
        rank = hedging.cylinder_rank
        sizes = hedging.gather_var_values_to_rank0()
    if rank == 0:
        m = extensive_form()
        size = m.component(next(iter(STORMS))).size.value
        print(f'Extensive form: size {size:.4f} m3, costs {pyo.value(m.total):.5f}')
        if find_spec('mpisppy'):
            print(f'Progressive hedging on {hedging.n_proc} process(es):')
            for (name, _), own in sizes.items():
                print(f'  {name}: size {own:.4f} m3')
            print(f'  costs {costs:.5f}')
        draw(m)


if __name__ == '__main__':
    main()
