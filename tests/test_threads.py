"""Threads that build, transform, solve and simulate models of their own get their own results and leave the process as it was."""

import logging
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pyomo.environ as pyo
import pytest
from problems.running import solve, transform

import pyomo_fesd
from pyomo_fesd.core import withheld_messages
from tests.models import add_modes, scalar_ode

THREADS = 4


def signum(number):
    """Starts at -s with the rate k below zero and 1 above, so it switches at s / k and ends at 2 - s / k."""
    s, k = 1 + number / 8, 2 + number / 2
    m = scalar_ode(-s)
    m.y[0].fix(1.0)
    m.still = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    add_modes(m, lambda m, t: [m.x[t] <= 0, m.dx[t] == k], lambda m, t: [m.x[t] >= 0, m.dx[t] == 1])
    return m, s / k


def run(step, number):
    """The time of the switch and the end as found, and as they are."""
    m, time = signum(number)
    step(transform(m, 3 + number % 2, 2))
    return [*(s.time for s in pyomo_fesd.switches(m)), m.x[2].value], [time, 2 - time]


def at_once(work, numbers):
    """What ``work`` returns for each number, with threads that take turns often.

    Without our lock on transformations, 1 to 3 of 12 rounds fail with this interval, and with 1e-5 s.
    """
    interval = sys.getswitchinterval()
    sys.setswitchinterval(5e-4)
    try:
        with ThreadPoolExecutor(THREADS) as pool:
            return list(pool.map(work, numbers))
    finally:
        sys.setswitchinterval(interval)


@pytest.mark.parametrize(
    'step',
    [solve, pyomo_fesd.simulate, partial(solve, nlp_options={'mu_init': 0.05}), partial(solve, tee=True)],
    ids=['solve', 'simulate', 'options', 'tee'],
)
def test_threads_with_models_of_their_own(step):
    before, level = (sys.stdout, sys.stderr), logging.getLogger('pyomo.dae').handlers
    for found, expected in at_once(partial(run, step), range(2 * THREADS)):
        assert found == pytest.approx(expected, abs=1e-6)
    assert (sys.stdout, sys.stderr) == before
    assert logging.getLogger('pyomo.dae').handlers is level


def test_the_log_of_casadi_ipopt_in_threads():
    def root(number):
        m = pyo.ConcreteModel()
        m.x = pyo.Var(bounds=(0, None), initialize=1.0)
        m.c = pyo.Constraint(expr=m.x**2 == 2 + number)
        pyo.SolverFactory('casadi_ipopt').solve(m, tee=number % 2 == 0)
        return m.x.value

    before = sys.stdout, sys.stderr
    assert at_once(root, range(8)) == pytest.approx([(2 + number) ** 0.5 for number in range(8)])
    assert (sys.stdout, sys.stderr) == before


def test_an_executable_in_threads():
    pytest.importorskip('pyomo_pounce')
    before = sys.stdout, sys.stderr
    for found, expected in at_once(partial(run, partial(solve, nlp_solver='pounce')), range(THREADS)):
        assert found == pytest.approx(expected, abs=1e-6)
    assert (sys.stdout, sys.stderr) == before


def test_messages_are_withheld_for_one_thread_only(caplog):
    logger = logging.getLogger('pyomo_fesd')
    with withheld_messages('pyomo_fesd') as messages:
        logger.warning("mine")
        logging.getLogger('pyomo_fesd.below').warning("below")
        logging.getLogger('pyomo_fesd_elsewhere').warning("elsewhere")
        other = threading.Thread(target=lambda: logger.warning("of another thread"))
        other.start()
        other.join()
    logger.warning("afterwards")
    assert [record.getMessage() for record in messages] == ["mine", "below"]
    assert [record.getMessage() for record in caplog.records] == ["elsewhere", "of another thread", "afterwards"]
