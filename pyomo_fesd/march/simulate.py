"""``simulate``: the solution of a system without freedom on its moving grid, or a start for all elements at once.

The march knows nothing of the future, and needs no homotopy over the whole horizon.

Takes: a model on a moving grid whose states at the first time are fixed.
Leaves: values of everything over time: the solution of a system without freedom (lengths are not equalised), or a start for
``mpec_hybrid`` with ``warm_start=True``.
Does not apply: to systems with freedom; inputs have to be given.
"""

from pyomo.common.collections import ComponentMap
from pyomo.common.gc_manager import PauseGC
from pyomo.common.timing import HierarchicalTimer
from pyomo.contrib.solver.common.factory import SolverFactory

from pyomo_fesd.errors import FesdError
from pyomo_fesd.indicators import set_indicators
from pyomo_fesd.march.march import March
from pyomo_fesd.march.timeless import solve_timeless
from pyomo_fesd.mpcc.phase import phase
from pyomo_fesd.records import records
from pyomo_fesd.review import review
from pyomo_fesd.timeindex import TimeIndex, derivatives, find_continuous_set
from pyomo_fesd.trajectory import trajectory


def simulate(model, wrt=None, inputs=(), timer=None, **options):
    """Simulate a system without freedom on its moving grid, element by element.

    Parameters
    ----------
    model : Block
        after ``fesd.finite_elements``; its states are fixed at the first time
    wrt : ContinuousSet, optional
    inputs : Var or list of Var
        variables over time that keep their present values, as a guess of controls; those that are named in
        ``piecewise_constant`` need not be named again
    timer : pyomo.common.timing.HierarchicalTimer, optional
        for the time of each phase
    options : options of ``mpec_hybrid`` for the small problems where modes change

    Returns
    -------
    pandas.DataFrame, the ``trajectory``; the model has the values

    Raises
    ------
    FesdError
        where the march cannot go on: more switches than elements (with the time at which they accumulate, if they do), a state
        that is not fixed at the first time, a variable that nothing determines.  The model has the values up to there.
    """
    wrt = find_continuous_set(model, wrt, 'simulate')
    if wrt not in records(model).grids:
        raise FesdError(wrt, "simulate: its elements are not movable", "apply fesd.finite_elements first")
    inputs = list(inputs) if isinstance(inputs, (list, tuple)) else [inputs]
    SolverFactory('mpec_hybrid', **options)  # refuses unknown options before anything is solved
    solve_timeless(model, wrt)
    ends = _fixed_later(model, wrt)
    timer = timer or HierarchicalTimer()
    try:
        with phase(timer, 'simulate'), PauseGC():
            with phase(timer, 'read'):
                march = March(model, wrt, inputs, options, timer)
            with phase(timer, 'march'):
                march.run()
            with phase(timer, 'review'):
                set_indicators(model)
                review(model)
            with phase(timer, 'trajectory'):
                return trajectory(model, wrt)
    finally:
        for v, given in ends.items():
            v.set_value(given, skip_validation=True)


def _fixed_later(model, wrt):
    """States that are fixed after the first time, as at the end of a control problem, with their values."""
    times, states = TimeIndex(wrt), [d.get_state_var() for d in derivatives(model, wrt)]
    return ComponentMap((v, v.value) for x in states for v in x.values() if v.fixed and times.time(v) != wrt.first())
