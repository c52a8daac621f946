"""Right limits: what depends on states that jump enters an element with its value after the jump."""

import pyomo.environ as pyo
import pytest
from pyomo.core.expr.visitor import identify_variables

import pyomo_fesd
from tests.models import dcs
from tests.problems import air_friction, dumped, quadratic_drag, weir
from tests.problems.running import LEGENDRE, RADAU, move


def marched(m, nlps=4):
    """Simulated, then solved from there and certified, with at most so many NLPs."""
    pyomo_fesd.simulate(m)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True)
    assert results.solver.stationarity == 'B' and results.solver.nlps <= nlps
    return m


def times(m, name):
    """When something switches."""
    return [s.time for s in pyomo_fesd.switches(m) if s.disjunction == name]


def copies(m):
    """Numbers of copied variables and equations."""
    home = m._pyomo_fesd_elements_t.jumps
    return len(home.copy), len(home.copied)


@pytest.mark.parametrize('form, scheme', [('heaviside', RADAU), ('heaviside', LEGENDRE), ('stewart', RADAU)])
def test_a_disjunction_on_a_state_that_jumps(form, scheme):
    m = marched(move(dcs(air_friction.build(), form=form), 10, 2, scheme=scheme))
    impacts, tops, end = air_friction.exact()
    assert times(m, 'impact') == pytest.approx(impacts, abs=1e-7)
    assert times(m, 'drag') == pytest.approx(sorted([*impacts, *tops]), abs=1e-7)
    assert (m.q[air_friction.END].value, m.v[air_friction.END].value) == pytest.approx(end, abs=1e-7)


@pytest.mark.parametrize('form, number', [('heaviside', (2, 1)), ('stewart', (3, 2))])
def test_parts_and_multipliers_get_one_copy_a_boundary(form, number):
    m = move(dcs(air_friction.build(), form=form), 4, 2)
    assert copies(m) == tuple(3 * n for n in number)


@pytest.mark.parametrize('level, scheme', [('algebraic', RADAU), ('algebraic', LEGENDRE), ('state', RADAU)])
def test_a_hand_written_condition_on_what_follows_from_a_state_that_jumps(level, scheme):
    # its twelve elements are uneven: branches with more even ones are tried
    m = marched(move(dumped.build(level), 12, 2, scheme=scheme), nlps=60)
    assert times(m, 'dump') == pytest.approx(dumped.DUMPS, abs=1e-7)
    assert times(m, 'weir') == pytest.approx(sorted([*dumped.FULL, *dumped.DUMPS]), abs=1e-7)
    assert m.V[dumped.END].value == pytest.approx(dumped.FINAL, abs=1e-7)
    # an expression of states needs no copy, a level that an equation gives one copy of both
    assert copies(m) == ((11, 11) if level == 'algebraic' else (0, 0))


@pytest.mark.parametrize('scheme, ncp, nfe', [(RADAU, 4, 12), (LEGENDRE, 4, 12)])
def test_a_kink_of_a_state_that_jumps(scheme, ncp, nfe):
    m = marched(move(quadratic_drag.build(nfe, ncp, scheme), nfe, ncp))
    first, top, second = quadratic_drag.events()
    assert quadratic_drag.END < second
    assert times(m, 'impact') == pytest.approx([first], abs=1e-7)
    assert times(m, 'up.complementarity') == pytest.approx([first, top], abs=1e-7)
    assert m.v[quadratic_drag.END].value == pytest.approx(quadratic_drag.FINAL, abs=1e-7)
    # the part s of each boundary, defined by its pair; the acceleration, which follows from it, is not copied
    assert copies(m) == (nfe - 1, 0)


def test_only_what_depends_on_the_jump_is_copied():
    m = dumped.build()
    m.far = pyo.Var(m.t, initialize=0)
    m.chain = pyo.Constraint(m.t, rule=lambda m, t: m.far[t] == m.h[t] + m.c[t])
    move(m, 4, 2)
    assert copies(m) == (3, 3)
    mentioned = {v.local_name for c in m._pyomo_fesd_elements_t.jumps.copied.values() for v in identify_variables(c.body)}
    assert not any(name.startswith(('far', 'h')) for name in mentioned)


def test_without_a_jump_nothing_is_copied():
    m = move(weir.build(), 4, 2)
    assert m._pyomo_fesd_elements_t.component('jumps') is None
    assert not m._pyomo_fesd_elements_t.sign_after


def test_a_side_after_a_jump_keeps_its_sign():
    m = move(dumped.build('state'), 4, 2)
    rows = m._pyomo_fesd_elements_t.sign_after
    assert {index[1] for index in rows} == {2, 3, 4}
    for row in rows.values():
        assert pyo.value(row.lower) == 0
