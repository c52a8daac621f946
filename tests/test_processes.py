"""Two processes with one working_dir: each solves its own model, and no link is followed."""

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor

import pyomo.environ as pyo
import pytest
from problems import small_mpccs
from pyomo.contrib.solver.common.factory import SolverFactory as SolverFactoryV2

from pyomo_fesd import FesdError


def roots(folder, number):
    """Solve a model again and again in ``folder``; returns all values found."""
    found = []
    for _ in range(10):
        m = pyo.ConcreteModel()
        m.x = pyo.Var(range(100), bounds=(0, None), initialize=1.0)
        m.c = pyo.Constraint(m.x.index_set(), rule=lambda m, i: m.x[i] ** 2 == number)
        SolverFactoryV2('casadi_ipopt').solve(m, working_dir=folder)
        found += [v.value for v in m.x.values()]
    return found


@pytest.mark.skipif('fork' not in multiprocessing.get_all_start_methods(), reason="new processes import everything again")
def test_processes_with_one_folder_solve_their_own_models(tmp_path):
    with ProcessPoolExecutor(2, multiprocessing.get_context('fork')) as pool:
        futures = [pool.submit(roots, str(tmp_path), number) for number in (4, 9)]
    for future, root in zip(futures, (2.0, 3.0)):
        assert future.result() == pytest.approx([root] * 1000)
    assert len(list(tmp_path.glob('*.nl'))) == 20


def test_no_link_is_followed(tmp_path):
    precious = tmp_path / 'precious'
    precious.write_text('of another program')
    folder = tmp_path / 'work'
    folder.mkdir()
    os.symlink(precious, folder / 'model.nl')
    pyo.SolverFactory('mpec_hybrid').solve(small_mpccs.toy()[0], working_dir=str(folder))
    assert precious.read_text() == 'of another program'


@pytest.mark.parametrize('solver', ['mpec_hybrid', 'casadi_ipopt'])
def test_a_folder_that_does_not_exist_is_refused(solver, tmp_path):
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=1.0)
    m.c = pyo.Constraint(expr=m.x**2 == 2)
    with pytest.raises(FesdError, match=r"(?s)working_dir='.*nowhere'.*cannot be written.*Fix: "):
        SolverFactoryV2(solver).solve(m, working_dir=str(tmp_path / 'nowhere'))
    assert m.x.value == 1.0
