"""States with given rates, and the whole path from a clone to a certified solution."""

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity
from pyomo.util import check_units

import pyomo_fesd

units = pyo.units


def plant(end, unit=None, **starts):
    """States over time (s) by name, each with its derivative and the one unit."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    for name, start in starts.items():
        x = pyo.Var(m.t, initialize=start, units=unit)
        m.add_component(name, x)
        m.add_component('d' + name, dae.DerivativeVar(x, wrt=m.t, units=None if unit is None else unit / units.s))
        x[0].fix(start)
    return m


def rate(m, name, rule):
    """dx/dt by a rule (m, t)."""
    m.add_component('ode_' + name, pyo.Constraint(m.t, rule=lambda m, t: m.component('d' + name)[t] == rule(m, t)))


def solved(m, nfe=8, ncp=3, clone=True, hysteresis=()):
    """A clone, transformed and solved; certified, and without a warning."""
    m = m.clone() if clone else m
    pyo.TransformationFactory('fesd.dcs').apply_to(m, hysteresis=list(hysteresis))
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=nfe, ncp=ncp)
    if hysteresis:
        pyomo_fesd.simulate(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=bool(hysteresis))
    assert results.solver.stationarity == 'B' and not results.solver.warnings
    return m


def switching_times(m):
    """When anything switches."""
    return [s.time for s in pyomo_fesd.switches(m)]


def added(block):
    """(variables, equations, conditions) that an addition declares on one block; not what is generated from them."""
    kinds = (pyo.Var, pyo.Constraint, Complementarity)
    return tuple(len(list(block.component_data_objects(kind, descend_into=False))) for kind in kinds)


def assert_units_consistent(block):
    """Check the units of all equations by Pyomo, and of the sides of the conditions, which Pyomo leaves out."""
    for equation in block.component_data_objects(pyo.Constraint):
        check_units.assert_units_consistent(equation)
    for condition in block.component_data_objects(Complementarity):
        for relation in condition._args:
            used = [units.get_units(part) for part in relation.args if any(True for _ in identify_variables(part))]
            assert used and None not in used
