"""The one model of initialisation.py that ends at another solution: a column of trays with component flows as states.

    python docs/benchmarks/idaes/column.py

Prints the flow at the top and the largest residual, evaluated by Pyomo, after IDAES' initialisation and solve and after a second
solve with a smaller tolerance.  Needs the extra [idaes].
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import pyomo.environ as pyo
from benchmarks.idaes.cases.published import fixture

import pyomo_fesd


def residual(m):
    """The largest residual of the active equations."""
    equations = m.component_data_objects(pyo.Constraint, active=True)
    return max(abs(pyo.value(c.body) - pyo.value(c.upper)) for c in equations if c.equality)


def main():
    """Solve the column as IDAES' test does, then again."""
    with pyomo_fesd.casadi_ipopt.stand_in():
        from idaes.models_extra.column_models.tests import test_tray_column as test

        m = fixture(test.TestBTXIdealFcTP, 'btx_fctp')
        m.fs.unit.initialize()
        for tolerance in (1e-6, 1e-8):
            results = pyo.SolverFactory('ipopt').solve(m, options={'tol': tolerance})
            top = [pyo.value(flow) for flow in m.fs.unit.condenser.distillate.vars['flow_mol_comp'].values()]
            print(
                f'tol {tolerance:g}: {results.solver.message}, {sum(top):.4f} mol/s at the top, largest residual {residual(m):.1e}'
            )


if __name__ == '__main__':
    main()
