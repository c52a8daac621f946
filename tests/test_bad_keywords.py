"""A keyword with a value of a wrong kind is an error at once: it names caller, keyword and value, and the model is as it was."""

from math import inf, nan

import numpy as np
import pyomo.environ as pyo
import pytest
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2

import pyomo_fesd
from pyomo_fesd import FesdError
from tests.models import dcs, finite_elements, signum, snapshot

#: No keyword takes these.
NEVER = [nan, object()]
#: Numbers take none of these, and positive ones not these either.
NO_NUMBERS = ['a', None, [], {}, True, *NEVER]
NOT_POSITIVE = [0, -1, inf, *NO_NUMBERS]


def transform(name):
    return lambda m, **keywords: pyo.TransformationFactory(f'fesd.{name}').apply_to(m, **keywords)


def v2(name):
    return lambda m, **keywords: SolverFactoryV2(name).solve(m, **keywords)


def legacy(name):
    return lambda m, **keywords: pyo.SolverFactory(name).solve(m, **keywords)


def raw():
    m = signum()
    m.y[0].fix(1.0)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    return m


def ready():
    return dcs(raw())


def discretised():
    return finite_elements(ready())


#: Caller, its model, keyword, bad values.
CASES = [
    *((transform('dcs'), raw, name, [0, 'a', *NEVER]) for name in ('targets', 'wrt', 'hysteresis', 'defines')),
    (transform('dcs'), raw, 'form', ['two', 1, None, *NEVER]),
    (transform('dcs'), raw, 'fom', ['stewart']),
    *((transform('finite_elements'), ready, name, [2.5, *NOT_POSITIVE]) for name in ('nfe', 'ncp')),
    (transform('finite_elements'), ready, 'nfe', [[0], ['a'], [1, 2, 3]]),
    (transform('finite_elements'), ready, 'ncp', [13, 60]),
    (transform('finite_elements'), ready, 'fixed_points', ['a', None, 0.5, True, [0], [-1.0], [nan], ['a'], *NEVER]),
    (transform('finite_elements'), ready, 'rho', [-1, inf, *NO_NUMBERS]),
    (transform('finite_elements'), ready, 'length_bounds', [-1, 1, *NO_NUMBERS]),
    *(
        (transform('finite_elements'), ready, name, ['a', -1.0, [1.0], *NEVER])
        for name in ('wrt', 'scheme', 'cross_complementarity', 'equilibration', 'piecewise_constant', 'continuous', 'final_time')
    ),
    *((transform('finite_elements'), ready, name, ['a', 2.5, [], ['a'], *NEVER]) for name in ('stage_lengths', 'stages')),
    (transform('smooth_to_complementarity'), raw, 'largest_eps', [-1, *NO_NUMBERS]),
    (pyomo_fesd.simulate, discretised, 'time_limit', [-1, 'a', [], *NEVER]),
    (pyomo_fesd.simulate, discretised, 'inputs', [0, None, 'a', ['a'], *NEVER]),
    (pyomo_fesd.simulate, discretised, 'timer', [1, 'a', *NEVER]),
    (pyomo_fesd.simulate, discretised, 'branch_tl', [1e-9]),
    (pyomo_fesd.refine, ready, 'tolerance', NOT_POSITIVE),
    (pyomo_fesd.refine, ready, 'max_rounds', [1, 2.5, *NOT_POSITIVE]),
    (pyomo_fesd.refine, ready, 'nfe', [0, 2.5, 'a', {}, *NEVER]),
    (pyomo_fesd.refine, ready, 'ncp', [2.5, *NOT_POSITIVE]),
    (pyomo_fesd.refine, ready, 'time_limit', [-1, 'a', [], *NEVER]),
    *((pyomo_fesd.refine, ready, name, ['a', 2.5, *NEVER]) for name in ('scheme', 'quantities', 'wrt', 'no_such_option')),
    *(
        (call, discretised, name, NOT_POSITIVE)
        for call in (pyomo_fesd.certify, v2('mpec_hybrid'), legacy('mpec_hybrid'))
        for name in ('feasibility_tol', 'starts')
    ),
    *((v2('mpec_hybrid'), discretised, name, NOT_POSITIVE) for name in ('eps_init', 'gap_tol', 'biactive_tol', 'trust_radius')),
    *(
        (v2('mpec_hybrid'), discretised, name, ['a', 2.5, None, *NEVER])
        for name in ('lpec', 'mode', 'relaxation', 'nlp_solver', 'warm_start', 'user_scaling')
    ),
    *((v2('mpec_hybrid'), discretised, name, ['a', -1, [], *NEVER]) for name in ('nlp_options', 'time_limit', 'executor')),
    *((legacy(name), discretised, 'timelimit', ['a', -1, *NEVER]) for name in ('mpec_hybrid', 'casadi_ipopt')),
    *((legacy(name), discretised, 'no_such_option', [1, None]) for name in ('mpec_hybrid', 'casadi_ipopt')),
    (pyomo_fesd.plot, discretised, 'names', [1, nan, [1], True]),
    (pyomo_fesd.plot, discretised, 'units', ['a', 1, [1]]),
    *(
        (call, discretised, 'wrt', ['a', 1, np.float64(2.0)])
        for call in (pyomo_fesd.plot, pyomo_fesd.trajectory, pyomo_fesd.switches, pyomo_fesd.physical_time, pyomo_fesd.clock)
    ),
]


@pytest.mark.parametrize('call, build, keyword, values', CASES, ids=lambda given: given if isinstance(given, str) else '')
def test_a_value_of_a_wrong_kind(call, build, keyword, values):
    m = build()
    before = snapshot(m)
    for given in values:
        with pytest.raises(FesdError, match=r'^[^\n]+\n    Fix: [^\n]+$') as error:
            call(m, **{keyword: given})
        assert 'pyomo_fesd_' not in str(error.value)
    assert snapshot(m) == before


def test_what_is_meant_is_accepted():
    m = ready()
    transform('finite_elements')(m, nfe=np.int64(2), ncp=np.float64(2.0), rho=0, piecewise_constant=[], stages=None)
    pyomo_fesd.simulate(m, time_limit=100, inputs=[])
    legacy('mpec_hybrid')(m, timelimit=None, warm_start=True, tee=None)
    assert pyomo_fesd.plot(m, names='x').axes[0].get_ylabel() == 'x'


@pytest.mark.parametrize(
    'keywords',
    [{'tolerance': t} for t in (-1, nan, inf, 'a', None, [])]
    + [{'kind': k} for k in ('cubic', [], None)]
    + [{'units': u} for u in ('kg', 1, [])]
    + [{'times': t} for t in (['a', 1, 2], [0, nan, 2], 1, None)]
    + [{'values': v} for v in ([0, nan, 1], 'a', 1)],
    ids=str,
)
def test_signals(keywords):
    m = raw()
    before = snapshot(m)
    with pytest.raises(FesdError, match='signal: '):
        m.u = pyomo_fesd.signal(m.t, **({'times': [0, 1, 2], 'values': [0, 1, 2]} | keywords))
    assert snapshot(m) == before


@pytest.mark.parametrize('part', ['guard', 'reset', 'guard value', 'reset value', 'sets'])
@pytest.mark.parametrize('given', [None, 'a', True, nan, [1]], ids=str)
def test_state_jumps(part, given):
    m = raw()
    laws = {'guard': lambda m, t: m.x[t], 'reset': lambda m, t: [(m.x[t], 1.0)]}
    laws |= {part: given} if part in laws else {}
    laws |= {'guard': lambda m, t: given} if part == 'guard value' else {}
    laws |= {'reset': lambda m, t: [(m.x[t], given)]} if part == 'reset value' else {}
    before = snapshot(m)
    if part == 'sets' and given == [1]:
        return  # a set for Pyomo
    with pytest.raises(FesdError):
        m.jump = pyomo_fesd.state_jump(given if part == 'sets' else m.t, **laws)
    assert snapshot(m) == before
