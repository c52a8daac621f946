"""Optimal control of a published reactor with a switch and a path constraint, against smoothing on a fixed grid.

    python docs/benchmarks/idaes/ocp.py

The isothermal CSTR of IDAES' caprese tests with its flow in five control stages: as much product as possible leaves at their ends,
while the reactant stays below a limit.  Its feed is diluted while the product is above 1.5.  Every answer is replayed: its flows in
the event-located reference.  Writes ocp.csv.  Needs the extra [idaes].
"""

import sys
from functools import partial
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).parents[2]))

import pyomo.environ as pyo
from benchmarks.common.rows import Rows
from benchmarks.idaes.cases.reactors import dilute
from benchmarks.idaes.reference import Equations, integrate

import pyomo_fesd  # noqa: F401  registers the transformations

HERE = Path(__file__).parent
#: Ends of control stages; the largest concentration of A; bounds of the flow.
STAGES, LIMIT, FLOW = (1.0, 2.0, 3.0, 4.0, 5.0), 2.0, (0.5, 2.0)
NFE, WIDTHS = (10, 20), (0.1, 0.01, 0.001)
COLUMNS = ('method', 'elements', 'objective', 'replayed', 'largest A', 'seconds', 'status')


def published(nfe):
    from idaes.apps.caprese.tests.test_simple_model import make_model

    return make_model(nfe=nfe)


def problem(nfe):
    """The published model with an objective, bounds and free flows."""
    m = published(nfe)
    for t in m.time:
        m.flow_in[t].unfix()
        m.flow_in[t].setlb(FLOW[0])
        m.flow_in[t].setub(FLOW[1])
        if t > 0:
            m.conc[t, 'A'].setub(LIMIT)
    m.product = pyo.Objective(expr=sum(m.flow_in[t] * m.conc[t, 'B'] for t in STAGES), sense=pyo.maximize)
    return m


def stage_of(t):
    """The end of the control stage that a label belongs to."""
    return next(end for end in STAGES if t <= end + 1e-9)


def moving(nfe):
    """Elements that move."""
    m = problem(nfe)
    dilute(m)
    pyo.TransformationFactory('fesd.dcs').apply_to(m, wrt=m.time)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, wrt=m.time, stages=list(STAGES[:-1]), piecewise_constant=[m.flow_in]
    )
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    return m, f'{results.solver.termination_condition} {results.solver.stationarity}'


def smoothed(nfe, width):
    """A fixed grid, the switch as a hyperbolic tangent."""
    m = problem(nfe)
    m.conc_in[:, 'A'].unfix()

    def feed(m, t):
        return m.conc_in[t, 'A'] == 4.5 - 0.5 * pyo.tanh((m.conc[t, 'B'] - 1.5) / width)

    m.dilution = pyo.Constraint(m.time, rule=feed)
    m.held = pyo.Constraint(
        m.time, rule=lambda m, t: pyo.Constraint.Skip if t in STAGES else m.flow_in[t] == m.flow_in[stage_of(t)]
    )
    results = pyo.SolverFactory('casadi_ipopt').solve(m, raise_exception_on_nonoptimal_result=False, load_solutions=True)
    return m, str(results.solver.termination_condition)


def replay(flows):
    """Objective and largest concentration of A under given flows."""
    m = published(10)
    for t in m.time:
        m.flow_in[t].fix(flows[stage_of(t)])
    dilute(m)
    stages = [(end, Equations(m, m.time, end)) for end in STAGES]
    total, largest = 0.0, 0.0
    for n, end in enumerate(STAGES, start=1):
        path = integrate(stages[:n], longest=0.01)
        total += flows[end] * path.end[f'conc[{_label(m, end)},B]']
        largest = path.scale[f'conc[{_label(m, end)},A]']
    return total, largest


def _label(m, end):
    return m.conc[end, 'A'].name.partition('[')[2].partition(',')[0]


def measure(method, nfe, solve):
    """One row."""
    clock = process_time()
    m, status = solve()
    seconds = process_time() - clock
    replayed, largest = replay({t: m.flow_in[t].value for t in STAGES})
    row = {'method': method, 'elements': nfe, 'objective': pyo.value(m.product), 'replayed': replayed}
    return row | {'largest A': largest, 'seconds': round(seconds, 2), 'status': status}


def main():
    """Measure all rows."""
    rows = Rows(HERE / 'ocp.csv', ('method', 'elements'), COLUMNS, fresh=True)
    for nfe in NFE:
        rows.add(measure('moving elements', nfe, partial(moving, nfe)))
        for width in WIDTHS:
            rows.add(measure(f'smoothing {width:g}', nfe, partial(smoothed, nfe, width)))


if __name__ == '__main__':
    main()
