"""All branches of a small MPCC, each solved as an NLP: the answer that the solver is measured against.

Independent of ``pyomo_fesd``: the conditions are read here once more, and each branch goes through Pyomo's NL writer to the Ipopt
in casadi's wheel, from several starts.

    PYTHONPATH=.:tests python -m problems.branches [name ...]      confirms the values in ``mpcc_collection``
"""

import io
import itertools
import sys
import tempfile
from contextlib import redirect_stderr
from pathlib import Path

import casadi as ca
import numpy as np
import pyomo.environ as pyo
from pyomo.core.expr import InequalityExpression, RangedExpression
from pyomo.mpec import Complementarity

#: Ipopt may miss a constraint by this much at what counts as a solution.
FEASIBLE = 1e-7


def alternatives(condition):
    """The ways in which a condition can hold: for each a list of relations."""
    sides = condition._args
    ranged = [a for a in sides if isinstance(a, RangedExpression)]
    if ranged:
        low, body, high = ranged[0].args
        F = next(a for a in sides if a is not ranged[0])
        return [body == low, F >= 0], [body == high, F <= 0], [pyo.inequality(low, body, high), F == 0]
    # the constant of 'expr >= 0' stands first
    G, H = (a.args[1] for a in sides if isinstance(a, InequalityExpression) and a.args[0] == 0)
    return [G == 0, H >= 0], [H == 0, G >= 0]


def branches(model):
    """One clone of ``model`` for each branch, without complementarity."""
    count = len([*model.component_data_objects(Complementarity, active=True)])
    kinds = (range(len(alternatives(c))) for c in model.component_data_objects(Complementarity, active=True))
    for choice in itertools.product(*kinds) if count else [()]:
        branch = model.clone()
        conditions = [*branch.component_data_objects(Complementarity, active=True)]
        branch.branch = pyo.ConstraintList()
        for condition, k in zip(conditions, choice):
            condition.parent_component().deactivate()
            for relation in alternatives(condition)[k]:
                if relation is not True:
                    branch.branch.add(relation)
        yield choice, branch


def local_minima(branch, starts=8, seed=0):
    """Objectives (of the minimisation) of the KKT points that Ipopt finds from the model's values and from random ones."""
    if next(branch.component_data_objects(pyo.Objective, active=True), None) is None:
        branch.nothing = pyo.Objective(expr=0)
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, 'branch.nl'))
        branch.write(path, format='nl')
        nl = ca.NlpBuilder()
        nl.import_nl(path)
    quiet = {'print_time': False, 'ipopt': {'print_level': 0, 'sb': 'yes', 'tol': 1e-10, 'bound_relax_factor': 0.0}}
    solver = ca.nlpsol('s', 'ipopt', {'x': ca.vertcat(*nl.x), 'f': nl.f, 'g': ca.vertcat(*nl.g)}, quiet)
    random = np.random.default_rng(seed)
    low, high = np.array(nl.x_lb), np.array(nl.x_ub)
    found = []
    for k in range(starts):
        x0 = np.array(nl.x_init) if k == 0 else random.normal(size=len(nl.x)) * 10 ** random.uniform(-1, 1.5)
        with redirect_stderr(io.StringIO()):  # casadi's warnings of points where the model has no value
            r = solver(x0=np.clip(x0, low, high), lbx=low, ubx=high, lbg=nl.g_lb, ubg=nl.g_ub)
        g = np.asarray(r['g']).ravel()
        miss = np.concatenate([nl.g_lb - g, g - nl.g_ub]).max(initial=0.0)
        if solver.stats()['success'] and miss <= FEASIBLE:
            found.append(float(r['f']))
    return sorted({round(f, 7) for f in found})


def minima(model, starts=8):
    """Local minima of every branch that has any: {choice: objectives}, in the model's own sense."""
    sign = next((-1 if f.sense == pyo.maximize else 1 for f in model.component_data_objects(pyo.Objective)), 1)
    found = {choice: [sign * f for f in local_minima(branch, starts)] for choice, branch in branches(model)}
    return {choice: values for choice, values in found.items() if values}


if __name__ == '__main__':
    from problems import mpcc_collection

    for known in mpcc_collection.SOLVABLE:
        if sys.argv[1:] and known.name not in sys.argv[1:]:
            continue
        model = known.build()
        values = sorted(v for group in minima(model).values() for v in group)
        maximised = any(f.sense == pyo.maximize for f in model.component_data_objects(pyo.Objective))
        best = values[-1] if maximised else values[0]
        verdict = 'agrees' if abs(best - known.best) <= 1e-6 * max(1, abs(best)) else 'DIFFERS'
        print(f'{known.name:20} table {known.best:16.8f}  branches {best:16.8f}  {verdict}   all: {sorted(set(values))[:8]}')
