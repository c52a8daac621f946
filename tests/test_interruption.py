"""Ctrl-C at random times: the model is as it was, no folder is left behind, and nothing turns it into another error."""

import gc
import logging
import os
import random
import signal
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor

import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from problems.running import seen, transform

import pyomo_fesd
from pyomo_fesd.core import DeferredInterrupt, interrupt_handled, interruptible, restored_on_error
from tests.models import dcs, signum

MPEC_HYBRID = pyo.SolverFactory('mpec_hybrid')


@pytest.fixture(autouse=True)
def ctrl_c():
    """Ctrl-C as in a terminal: a shell starts background processes, such as a CI job, with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where temporary files are made."""
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    return tmp_path


class Press:
    """A trace function that presses Ctrl-C at one line, counted over everything that runs; 0 for never."""

    def __init__(self, at):
        self.at, self.count, self.pressed = at, 0, False

    def __call__(self, frame, event, argument):
        self.count += 1
        if self.count == self.at:
            self.pressed = True
            signal.raise_signal(signal.SIGINT)
        return self

    def during(self, work, *args):
        """Return what ``work`` returns or raises."""
        before = sys.gettrace()
        sys.settrace(self)
        try:
            return work(*args)
        except BaseException as error:
            return error
        finally:
            sys.settrace(before)


def presses(work, build, number, seed=0):
    """``number`` runs of ``work``, each with Ctrl-C at a random line: the model, what a user saw of it before, and the answer."""
    work(build())
    lines = Press(0)
    lines.during(work, build())
    draw = random.Random(seed)
    for _ in range(number):
        m, press = build(), Press(draw.randint(1, lines.count))
        before = seen(m)
        answer = press.during(work, m)
        if press.pressed:
            yield m, before, answer


def fesd_dcs(m):
    pyo.TransformationFactory('fesd.dcs').apply_to(m)


def finite_elements(m):
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=2, ncp=2)


def with_absolute_value():
    m = pyo.ConcreteModel()
    m.x = pyo.Var(range(3), initialize=1.0)
    m.e = pyo.Expression(expr=abs(m.x[0] - m.x[1]))
    m.c = pyo.Constraint(range(3), rule=lambda m, i: abs(m.x[i]) + m.e <= 2)
    return m


def smooth(m):
    pyo.TransformationFactory('fesd.smooth_to_complementarity').apply_to(m)


@pytest.mark.parametrize(
    'work, build, number',
    [
        (fesd_dcs, signum, 40),
        (fesd_dcs, lambda: signum(discretised=True), 15),
        (finite_elements, lambda: dcs(signum()), 15),
        (smooth, with_absolute_value, 40),
    ],
    ids=['dcs', 'dcs on a grid', 'finite_elements', 'smooth'],
)
def test_a_transformation_is_undone(work, build, number):
    done = build()
    work(done)
    done, finished = seen(done), 0
    for m, before, answer in presses(work, build, number):
        assert isinstance(answer, KeyboardInterrupt), answer
        finished += seen(m) == done
        assert seen(m) in (before, done)
    # pressed in the last lines, when everything is written
    assert finished <= 1 + number // 10


class PressInLogging(Press):
    """One that counts and presses at the lines of logging only, some of which hold the lock that all loggers share."""

    def __call__(self, frame, event, argument):
        return super().__call__(frame, event, argument) if frame.f_code.co_filename == logging.__file__ else self


def is_free(lock):
    """Whether another thread can take a lock."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(lambda: lock.acquire(timeout=1.0) and not lock.release()).result()


def test_the_lock_of_logging_is_left(number=60):
    # in getLogger() and others of Python 3.11 it is taken a line before their try
    lines, draw = PressInLogging(0), random.Random(0)
    lines.during(finite_elements, dcs(signum()))
    for _ in range(number):
        press = PressInLogging(draw.randint(1, lines.count))
        answer = press.during(finite_elements, dcs(signum()))
        assert press.pressed and isinstance(answer, KeyboardInterrupt)
        assert is_free(logging._lock)


def components(m):
    return {block.name: set(block.component_map()) for block in m.block_data_objects()}


def activity(m):
    return {c.name: c.active for c in m.component_data_objects(descend_into=True) if hasattr(c, 'active')}


def moving():
    m = signum()
    m.y[0].fix(1.0)
    m.rest = pyo.Constraint(m.t, rule=lambda m, t: m.dy[t] == 0)
    return transform(m, 2, 2)


@pytest.mark.parametrize('build', [moving, lambda: small_mpccs.scholtes4()[0]], ids=['time', 'static'])
def test_a_solve_leaves_nothing_behind(build, folder):
    inside = components(build()), activity(build())
    for m, _, answer in presses(MPEC_HYBRID.solve, build, 25):
        if not isinstance(answer, KeyboardInterrupt):
            # the algorithm keeps its best point
            assert answer.solver.outcome == 'interrupted'
        assert (components(m), activity(m)) == inside
        assert not os.listdir(folder)


def test_a_simulation_says_so(folder):
    inside = components(moving())
    for m, _, answer in presses(pyomo_fesd.simulate, moving, 12):
        assert isinstance(answer, KeyboardInterrupt)
        assert components(m) == inside
        assert not os.listdir(folder)


def test_an_executable_leaves_no_file(folder):
    pytest.importorskip('pyomo_pounce')

    def solve(m):
        return MPEC_HYBRID.solve(m, nlp_solver='pounce')

    for _, _, answer in presses(solve, lambda: small_mpccs.scholtes4()[0], 10):
        assert isinstance(answer, KeyboardInterrupt) or answer.solver.outcome == 'interrupted'
        assert not os.listdir(folder)


# The tool


def press():
    signal.raise_signal(signal.SIGINT)


def test_it_waits_for_the_end_of_the_body():
    done = []
    with pytest.raises(KeyboardInterrupt), DeferredInterrupt() as interrupt:
        press()
        assert interrupt.pressed
        done.append('all')
    assert done == ['all']
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_it_does_not_wait_inside_raising():
    with pytest.raises(KeyboardInterrupt), DeferredInterrupt() as interrupt:
        with interrupt.raising():
            press()
            pytest.fail("not reached")


def swallow():
    try:
        press()
    except KeyboardInterrupt:
        pass


def convert():
    try:
        press()
    except KeyboardInterrupt:
        raise SystemError('a library') from None


@pytest.mark.parametrize('library', [swallow, convert])
def test_a_library_cannot_change_it(library):
    with pytest.raises(KeyboardInterrupt):
        interruptible(library)()


def test_what_was_caught_on_purpose_is_not_raised_again():
    @interruptible
    def work():
        with pytest.raises(KeyboardInterrupt), DeferredInterrupt() as interrupt, interrupt.raising():
            press()
        interrupt_handled()
        return 'best point'

    assert work() == 'best point'


def test_the_users_own_handler_is_called():
    called = []
    signal.signal(signal.SIGINT, lambda number, frame: called.append(number))
    with DeferredInterrupt():
        press()
        assert not called
    assert called == [signal.SIGINT]


def test_ignored_signals_stay_ignored():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with DeferredInterrupt() as interrupt:
        press()
    assert not interrupt.pressed and signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_other_threads_have_no_signals():
    def work():
        with DeferredInterrupt() as interrupt, interrupt.raising():
            answers.append(interrupt.pressed)

    answers = []
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert answers == [False]


def test_a_context_whose_entry_was_interrupted_does_not_touch_later_signals():
    """Ctrl-C in the last line of the entry of ``raising``: its generator is deleted at any later time."""
    before = signal.getsignal(signal.SIGINT)
    with DeferredInterrupt() as interrupt:
        entered = interrupt.raising()
        entered.__enter__()
    assert signal.getsignal(signal.SIGINT) is before
    del entered
    gc.collect()
    assert signal.getsignal(signal.SIGINT) is before
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def empty(m):
    with restored_on_error(m):
        pass


def test_a_press_anywhere_in_a_context_leaves_signals_as_they_were():
    m = signum()
    lines, before, lost = Press(0), signal.getsignal(signal.SIGINT), 0
    lines.during(empty, m)
    gc.freeze()  # each collection looks at what a press has left only
    for at in range(1, lines.count + 1, 1 + lines.count // 60):
        press = Press(at)
        answer = press.during(empty, m)
        lost += press.pressed and not isinstance(answer, KeyboardInterrupt)
        del answer
        gc.collect()
        assert signal.getsignal(signal.SIGINT) is before, at
    gc.unfreeze()
    # pressed in the deletion of a generator after the context
    assert lost <= 1
