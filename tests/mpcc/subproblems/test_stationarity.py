"""The certificate judges points, whoever found them."""

import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from problems.parts import parts

import pyomo_fesd
from pyomo_fesd.core import FesdError, homotopy_hints
from pyomo_fesd.mpcc.subproblems.lpec import Lpec
from pyomo_fesd.mpcc.subproblems.side_constraints import sort_sides
from pyomo_fesd.mpcc.subproblems.stationarity import SHOWN, Stationarity, certify_point


def test_the_origin_of_the_toy_is_refused_with_a_direction_of_descent():
    model, _ = small_mpccs.toy(0.0, 0.0)
    certificate = pyomo_fesd.certify(model)
    assert certificate.grade is Stationarity.DESCENT
    assert not certificate.certified
    assert certificate.value < -1
    assert certificate.biactive == 1


def test_a_certificate_prints_its_grade_residuals_and_the_largest_entries_of_the_direction():
    refused, certified = (str(pyomo_fesd.certify(small_mpccs.toy(x, 0.0)[0])) for x in (0.0, 1.0))
    assert refused.splitlines() == [
        Stationarity.DESCENT.value,
        "violation 0.0e+00, complementarity 0.0e+00, bi-active pairs: 1",
        "slope of the objective along the direction: -2",
        "  y +1",
    ]
    assert certified.splitlines()[0] == Stationarity.B.value and len(certified.splitlines()) == 2


def test_a_certificate_prints_only_so_many_entries():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(9), bounds=(0, None), initialize=lambda m, i: i + 1)
    m.total = pyo.Objective(expr=pyo.quicksum(m.x.values()))
    lines = str(pyomo_fesd.certify(m)).splitlines()
    assert len(lines) == 3 + SHOWN + 1 and lines[-1] == "  and 3 others"


@pytest.mark.parametrize('x, y', [(1.0, 0.0), (0.0, 1.0)])
def test_both_minima_of_the_toy_are_certified(x, y):
    model, _ = small_mpccs.toy(x, y)
    assert pyomo_fesd.certify(model).grade is Stationarity.B


def test_a_minimum_without_multipliers_is_certified():
    model, _ = small_mpccs.ralph1()
    model.x.value = model.y.value = 0.0
    assert pyomo_fesd.certify(model).certified


def test_a_point_that_is_not_complementary_is_called_infeasible():
    model, _ = small_mpccs.toy(0.5, 0.5)
    certificate = pyomo_fesd.certify(model)
    assert certificate.grade is Stationarity.INFEASIBLE
    assert certificate.complementarity == pytest.approx(0.5)


def test_a_point_that_violates_a_constraint_is_called_infeasible():
    model, _ = small_mpccs.toy(1.0, 0.0)
    model.k = pyo.Constraint(expr=model.x <= 0.5)
    certificate = pyomo_fesd.certify(model)
    assert certificate.grade is Stationarity.INFEASIBLE
    assert certificate.violation == pytest.approx(0.5)


def test_certify_leaves_nothing_on_the_model_and_no_value_changed():
    model, _ = small_mpccs.bard1()
    before = [v.value for v in model.component_data_objects(pyo.Var)]
    names = set(model.component_map())
    pyomo_fesd.certify(model)
    assert set(model.component_map()) == names
    assert [v.value for v in model.component_data_objects(pyo.Var)] == before
    assert all(c.active for c in model.c.values())


def test_a_model_without_values_is_not_judged():
    model, _ = small_mpccs.toy()
    model.y.value = None
    with pytest.raises(FesdError, match=r'(?s)y: has no value that could be judged\n.*solve the model first'):
        pyomo_fesd.certify(model)


@pytest.mark.parametrize('patience, grade', [(None, Stationarity.LIMITED), (0.0, Stationarity.DESCENT)])
def test_without_time_a_point_that_only_a_guide_bound_holds_is_one_that_descends(patience, grade):
    m = small_mpccs.pair(1.0, 0.0)
    m.h = pyo.Var(bounds=(0, None), initialize=0.5)
    m.f = pyo.Objective(expr=(m.x - 1) ** 2 + (m.h - 0.2) ** 2)
    homotopy_hints(m).guide_bounds[m.h] = (0.5, 2)
    p = parts(m)
    p.compiled.narrow()
    lpec = Lpec(p.compiled, sort_sides(p.compiled), {})
    certificate = certify_point(p.compiled, lpec, p.compiled.x0, p.subsolves.tolerances, patience=patience)
    assert certificate.grade is grade and not certificate.certified
