"""The message of an error has three parts, and survives a worker process."""

import pickle

import pyomo.environ as pyo

from pyomo_fesd.core.errors import FesdError


def test_component_cause_and_fix():
    m = pyo.ConcreteModel()
    m.x = pyo.Var([1])
    error = FesdError(m.x[1], "it is wrong", "put it right")
    assert str(error) == 'x[1]: it is wrong\n    Fix: put it right'
    assert (error.component, error.cause, error.fix) == ('x[1]', 'it is wrong', 'put it right')


def test_it_can_be_pickled():
    error = FesdError('x', "it is wrong", "put it right")
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is FesdError and str(copy) == str(error)
