"""IDAES' own dynamic models on movable elements: what pyomo.dae finds at the same lengths, unit model by unit model."""

import logging
import warnings
from functools import partial

import pyomo.dae as dae
import pyomo.environ as pyo
import pytest
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunction

pytest.importorskip('idaes', reason="needs the extra: pip install -e '.[idaes]'")

logging.getLogger('idaes').setLevel(logging.ERROR)
with warnings.catch_warnings():
    warnings.simplefilter('ignore')  # marks of IDAES' own tests that are not registered here
    from idaes.apps.caprese.examples.cstr_model import make_model as make_cstr
    from idaes.core.util.tests.test_pid_initialization import make_model as make_pid
from idaes.core.util import scaling  # noqa: E402

import pyomo_fesd  # noqa: E402
from pyomo_fesd.core import is_generated  # noqa: E402
from pyomo_fesd.core.time_index import TimeIndex, derivatives  # noqa: E402
from tests.idaes.plants import PLANTS  # noqa: E402

#: Parts of the horizon that three elements have when they have moved.
MOVED = (0.5, 1.7, 0.8)


def by_order(m):
    """Variables of the plant by name and number of their time."""
    labels, times = {t: k for k, t in enumerate(m.fs.time)}, TimeIndex(m.fs.time)
    plants_own = (v for v in m.component_data_objects(pyo.Var) if not is_generated(v))
    return {(name, labels.get(label)): v for v in plants_own for label, name in [times.split(v)]}


def answer(m, start=None):
    """Solve a plant without freedom, perhaps from another answer; returns the values by name and number of their time.

    Where Ipopt stops within its tolerance depends on the machine.  Rates are differences of contents that are 1e5 times larger, so
    the solve goes on to round-off; there Ipopt may call the step too short.
    """
    variables = by_order(m)
    for key, given in (start or {}).items():
        variables[key].set_value(given, skip_validation=True)
    solver = pyo.SolverFactory('casadi_ipopt')
    pyo.assert_optimal_termination(solver.solve(m, options={'tol': 1e-8}))
    solver.solve(m, options={'tol': 1e-12})
    return {key: v.value for key, v in variables.items() if v.value is not None}


def collocation(m, nfe=3, ncp=2):
    pyo.TransformationFactory('dae.collocation').apply_to(m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp)
    return m


def moving(m, lengths=(1, 1, 1), **options):
    """Movable elements, their lengths given."""
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m.fs, wrt=m.fs.time, **options)
    grid = m.fs.component('_pyomo_fesd_elements__time')
    grid.stage_length.deactivate()
    for n, r in enumerate(lengths, start=1):
        grid.r[n].fix(r)
    return m


def plain(plant):
    m = collocation(plant.build())
    plant.specify(m)
    return m


def discretisation_equations(m):
    """Names that IDAES looks up."""
    return [c.name for c in m.component_objects(pyo.Constraint) if 'disc_eq' in c.local_name]


def largest_difference(one, other):
    assert one.keys() == other.keys()
    return max(abs(one[k] - other[k]) / max(1, abs(one[k])) for k in one)


@pytest.mark.parametrize('name', PLANTS)
def test_at_nominal_lengths_the_answer_is_that_of_plain_collocation(name):
    plant = PLANTS[name]
    before, plain_one = moving(plant.build(), nfe=3, ncp=2), plain(plant)
    plant.specify(before)
    assert discretisation_equations(before) == discretisation_equations(plain_one) != []
    found = pyomo_fesd.structure(before)
    assert not found.problem and found.degrees_of_freedom == 0
    exact = answer(plain_one)
    assert largest_difference(exact, answer(before)) <= 1e-9
    after = moving(plain(plant))
    assert largest_difference(exact, answer(after)) <= 1e-9
    r = after.fs.component('_pyomo_fesd_elements__time').r
    for derivative in derivatives(after, after.fs.time):
        for equation in derivative.parent_block().component(derivative.local_name + '_disc_eq').values():
            assert any(v.parent_component() is r for v in identify_variables(equation.expr))


@pytest.mark.parametrize('name', PLANTS)
def test_elements_that_have_moved_are_those_of_a_grid_laid_there(name):
    plant = PLANTS[name]
    m = plant.build()
    end = m.fs.time.last()
    for boundary in (MOVED[0], MOVED[0] + MOVED[1]):
        m.fs.time.add(boundary * end / 3)
    m.fs.time._fe = list(m.fs.time)  # pyomo.dae reads boundaries that are added to a set only when it is constructed
    collocation(m)
    plant.specify(m)
    moved = moving(plant.build(), MOVED, nfe=3, ncp=2)
    plant.specify(moved)
    # labels are rounded to 1e-6; from another start stiff kinetics may lead to another solution
    exact = answer(m)
    assert largest_difference(exact, answer(moved, exact)) <= 1e-6
    assert [t for t in m.fs.time] == pytest.approx(list(pyomo_fesd.physical_time(moved, moved.fs.time).values()), abs=1e-5)


@pytest.mark.parametrize('make', [make_pid, partial(make_cstr, horizon=1)])
def test_flowsheets_that_idaes_discretises_itself(make):
    exact = answer(make(ntfe=3))
    assert largest_difference(exact, answer(moving(make(ntfe=3)))) <= 1e-9


# What engineers do to a flowsheet before


def level_control(**options):
    plant = PLANTS['level control']
    m = moving(plant.build(), nfe=3, ncp=2, **options)
    plant.specify(m)
    return m


def test_what_idaes_switches_off_at_the_first_time_stays_off():
    pid = level_control().fs.pid
    first, *others = pid.flowsheet().time
    assert not pid.mv_integration_eqn[first].active
    assert all(pid.mv_integration_eqn[t].active for t in others)


def test_transformed_constraints_and_scaling_factors_do_not_change_the_answer():
    plant, answers = PLANTS['mixer and CSTR'], []
    for order in ('plain', 'scaled before', 'scaled after'):
        m = plain(plant)
        if order == 'scaled after':
            moving(m)
        if order != 'plain':
            scaling.set_scaling_factor(m.fs.cstr.control_volume.volume, 10)
            scaling.calculate_scaling_factors(m)
            for row in m.fs.cstr.control_volume.enthalpy_balances.values():
                scaling.constraint_scaling_transform(row, 1e-6)
            scaling.scale_time_discretization_equations(m, m.fs.time, 1 / 100)
        if order == 'scaled before':
            moving(m)
        answers.append(answer(m))
    assert max(largest_difference(answers[0], other) for other in answers[1:]) <= 1e-7


def test_initial_conditions_that_idaes_fixes():
    """The two-phase vessel starts at rest: derivatives of the first time are fixed, not states."""
    plant = PLANTS['two-phase vessel']
    m = moving(plant.build(), nfe=3, ncp=2)
    plant.specify(m)
    cv, first = m.fs.heater.control_volume, m.fs.time.first()
    assert all(v.fixed and v.value == 0 for v in cv.material_accumulation[first, ...])
    assert not any(v.fixed for v in cv.material_holdup.values())
    answer(m)
    m.fs.unfix_initial_conditions()
    assert pyomo_fesd.structure(m).degrees_of_freedom > 0


def test_a_flowsheet_within_a_flowsheet():
    """The inner flowsheet has the time of the outer one; transformed alone, or with it."""
    from idaes.core import FlowsheetBlock

    for target in ('outer', 'inner'):
        m = pyo.ConcreteModel()
        m.fs = FlowsheetBlock(dynamic=True, time_set=[0, 2], time_units=pyo.units.s)
        m.fs.sub = FlowsheetBlock(dynamic=True)
        m.fs.sub.x = pyo.Var(m.fs.time, initialize=1)
        m.fs.sub.dx = dae.DerivativeVar(m.fs.sub.x, wrt=m.fs.time)
        m.fs.sub.x[0].fix(-2)

        @m.fs.sub.Disjunct(m.fs.time)
        def below(d, t):
            d.region = pyo.Constraint(expr=d.parent_block().x[t] <= 0)
            d.ode = pyo.Constraint(expr=d.parent_block().dx[t] == 3)

        @m.fs.sub.Disjunct(m.fs.time)
        def above(d, t):
            d.region = pyo.Constraint(expr=d.parent_block().x[t] >= 0)
            d.ode = pyo.Constraint(expr=d.parent_block().dx[t] == 1)

        m.fs.sub.sign = Disjunction(m.fs.time, rule=lambda fs, t: [fs.below[t], fs.above[t]])
        home = m.fs if target == 'outer' else m.fs.sub
        pyo.TransformationFactory('fesd.dcs').apply_to(home, wrt=m.fs.time)
        pyo.TransformationFactory('fesd.finite_elements').apply_to(home, wrt=m.fs.sub.time, nfe=4, ncp=2)
        pyo.assert_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))
        assert [s.time for s in pyomo_fesd.switches(m, m.fs.time)] == pytest.approx([2 / 3], abs=1e-9)


def test_without_wrt_a_plant_with_space_asks_for_it():
    with pytest.raises(pyomo_fesd.FesdError, match='several ContinuousSets'):
        pyo.TransformationFactory('fesd.finite_elements').apply_to(PLANTS['tube'].build().fs, nfe=2, ncp=2)


def test_report_and_structure_of_units():
    plant = PLANTS['mixer and CSTR']
    m = moving(plant.build(), nfe=3, ncp=2)
    plant.specify(m)
    table = pyomo_fesd.report(m.fs, blocks=True)
    assert {'mixer', 'cstr', 'feed_expanded', 'all'} <= set(table.index)
    # one more is the sum of the lengths' own block; every other constraint stands in a unit
    assert table.loc['all', 'constraints'] == pyomo_fesd.report(m.fs)['constraints'] == table['constraints'][:-1].sum()
    m.fs.cstr.volume[0].unfix()
    m.fs.mixer.lye.temperature[0].unfix()
    found = pyomo_fesd.structure(m)
    assert found.degrees_of_freedom == 2 and not found.surplus
    assert 'fs.cstr.control_volume' in found.problem
