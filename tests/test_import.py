"""``import pyomo_fesd`` registers everything with Pyomo and loads only what it needs; the rest is loaded when it is used."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import pyomo_fesd

#: Packages and rooms that take long to import.
HEAVY = {'numpy', 'scipy', 'pandas', 'matplotlib', 'networkx', 'casadi', 'highspy'}
#: Packages that a solve without pictures, tables and structural analysis does not need.
UNUSED = {'pandas', 'matplotlib', 'networkx'}
REPORT = """
import json, sys
import pyomo.environ as pyo
before = set(sys.modules)
import pyomo_fesd
{body}
new = set(sys.modules) - before
print(json.dumps(sorted({{name.split('.')[0] for name in new}} | {{name for name in new if name.startswith('pyomo_fesd')}})))
"""
REGISTERED = """
from pyomo.contrib.solver.common.factory import SolverFactory
for name in ('fesd.dcs', 'fesd.smooth_to_complementarity', 'fesd.finite_elements'):
    assert name in pyo.TransformationFactory and pyo.TransformationFactory.doc(name)
for name in ('mpec_hybrid', 'casadi_ipopt'):
    assert name in SolverFactory and name in pyo.SolverFactory and SolverFactory.doc(name)
"""
SOLVE = """
import pyomo.dae as dae
from pyomo.common.timing import HierarchicalTimer
from pyomo.gdp import Disjunction
m = pyo.ConcreteModel()
m.t = dae.ContinuousSet(bounds=(0, 2))
m.x = pyo.Var(m.t, initialize=-1.0)
m.dx = dae.DerivativeVar(m.x)
m.x[0].fix(-1)
m.speed = Disjunction(m.t, rule=lambda m, t: [[m.x[t] <= 0, m.dx[t] == 1], [m.x[t] >= 0, m.dx[t] == 3]])
pyo.TransformationFactory('fesd.dcs').apply_to(m)
pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=2, ncp=2)
timer = HierarchicalTimer()
results = pyo.SolverFactory('mpec_hybrid').solve(m, timer=timer)
assert results.solver.termination_condition == 'optimal' and 'simulate' in timer.timers
"""


def loaded(body):
    """Names of the packages, and of our modules, that a process loads beside ``pyomo.environ``."""
    done = subprocess.run([sys.executable, '-c', REPORT.format(body=body)], capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_the_import_registers_everything_and_loads_nothing_else():
    found = loaded(REGISTERED)
    assert not found & HEAVY
    assert {name for name in found if name.startswith('pyomo_fesd')} == {'pyomo_fesd'}


def test_a_solve_simulates_first_and_loads_no_tables_and_pictures():
    found = loaded(SOLVE)
    assert not found & UNUSED
    assert {'casadi', 'pyomo_fesd.simulation'} <= found


def test_every_public_name_is_found_in_its_room_and_known_to_type_checkers():
    tree = ast.parse(Path(pyomo_fesd.__file__).read_text())
    (checked,) = (node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == 'TYPE_CHECKING')
    written = {(node.module, alias.name) for node in checked.body for alias in node.names}
    assert written == {(f'pyomo_fesd.{room}', name) for name, room in pyomo_fesd._HOMES.items()} | {('pyomo_fesd', 'units')}
    assert {name for _, name in written} == {*pyomo_fesd.__all__, '__version__'} <= set(dir(pyomo_fesd))
    assert all(getattr(pyomo_fesd, name) is not None for _, name in written)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'sumulate'"):
        pyomo_fesd.sumulate  # noqa: B018
