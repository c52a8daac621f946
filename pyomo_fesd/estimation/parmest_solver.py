"""``parmest_solver``: let ``pyomo.contrib.parmest`` solve with another solver than the Ipopt that it names in its code."""

from collections.abc import Iterator
from contextlib import contextmanager

from pyomo.opt import SolverFactory

from pyomo_fesd.core import FesdError

#: The solver that parmest's ``theta_est`` names.
REPLACED = 'ipopt'


@contextmanager
def parmest_solver(name: str = 'mpec_hybrid', **options) -> Iterator[None]:
    """Solve with another solver where ``pyomo.contrib.parmest`` asks for Ipopt's executable, within the body.

    ``Estimator.theta_est``, ``theta_est_bootstrap`` and the others have Ipopt in their code; ``cov_est`` takes the name of a
    solver.  Not for several threads at once.

    Parameters
    ----------
    name : str
        of a solver that Pyomo's ``SolverFactory`` knows: ``'mpec_hybrid'`` for experiments with switches, ``'casadi_ipopt'`` for
        others without an executable
    options : its options

    Raises
    ------
    FesdError
        for a solver that Pyomo does not know
    """
    # parmest takes longer to import than the rest of this room, which states at a time do not need
    from pyomo.contrib.parmest import parmest

    if not SolverFactory(name).available(exception_flag=False):
        raise FesdError(f"parmest_solver('{name}')", "Pyomo does not find this solver", "take 'mpec_hybrid' or 'casadi_ipopt'")
    factory = parmest.SolverFactory

    def replaced(asked, *args, **kwds):
        return SolverFactory(name, **options) if asked == REPLACED else factory(asked, *args, **kwds)

    parmest.SolverFactory = replaced
    try:
        yield
    finally:
        parmest.SolverFactory = factory
