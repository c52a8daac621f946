"""Control stages and the moving grid that the problems share."""

import numpy as np
import pyomo.environ as pyo

import pyomo_fesd  # noqa: F401  registers the transformations
from pyomo_fesd.core import moving_grids


def ends(horizon, stages):
    """Labels of the times at which control stages begin and end."""
    return [round(horizon * k / stages, 9) for k in range(stages + 1)]


def clock(m, kind, length, speeds):
    """Add ``m.speed``, physical time in unit time where nothing is frozen, and return the keywords for ``moving_grid``.

    A stage with impacts takes longer than its physical time.  ``kind`` 'speed': all stages are equally long, and the speed is a
    control with the bounds ``speeds``.  'lengths': the speed is 1, and the length of each stage is a variable.
    """
    if kind == 'speed':
        m.speed = pyo.Var(m.t, initialize=1, bounds=speeds)
        return {'extra': [m.speed]}
    m.speed = pyo.Param(m.t, default=1)
    stages = pyo.RangeSet(len(m.t) - 1)
    m.stage_length = pyo.Var(stages, initialize=length, bounds=(max(1e-3, speeds[0]) * length, speeds[1] * length))
    return {'stage_lengths': m.stage_length}


def moving_grid(m, elements, piecewise_constant, extra=(), lengths='even', **options):
    """Apply ``fesd.finite_elements`` with ``elements`` elements in each control stage; ``lengths`` are their initial values."""
    number = elements * (len(m.t) - 1)
    options = {'nfe': number, 'piecewise_constant': [*piecewise_constant, *extra]} | options
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, **options)
    if lengths == 'uneven':
        _stretch(m, elements)
    return m


def _stretch(m, elements):
    """Every second element of a stage begins with 0.4 of the length of its neighbours."""
    shares = np.where(np.arange(elements) % 2, 0.4, 1.0)
    (moving,) = moving_grids(m).values()
    for n, r in moving.r.items():
        r.set_value((shares / shares.mean())[(n - 1) % elements])
