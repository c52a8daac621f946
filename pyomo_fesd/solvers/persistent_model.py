"""A model that is compiled once and solved many times, with other values of its parameters."""

from pyomo_fesd.core import FesdError
from pyomo_fesd.mpcc import Contradiction, Deadline, Snapshot, SolverCache, compile_mpcc, parameter_data, read_mpcc
from pyomo_fesd.solvers.unready_models import refuse_integers, refuse_unready


class PersistentModel:
    """A compiled model with its NLP solvers.

    Parameters
    ----------
    model : Block
    options : ConfigDict
        of ``mpec_hybrid``
    timer : HierarchicalTimer
    parameters : list of components
        fixed variables and mutable Params, indexed or not, whose values may change
    deadline : Deadline, optional
        also of the compilation

    Attributes
    ----------
    compiled : MpccFunctions
    cache : SolverCache
    deadline : Deadline
        of all its NLP solvers; every solve sets it anew

    Raises
    ------
    FesdError
        for a model that is not an MPCC, and for a component that is not a parameter
    Contradiction
        where fixed values alone violate a constraint
    OutOfTime
        at the deadline
    """

    def __init__(self, model, options, timer, parameters=(), deadline=None):
        self.model, self.options, datas = model, options, parameter_data(parameters)
        self.deadline = deadline or Deadline()
        refuse_unready(model, 'mpec_hybrid')
        problem = read_mpcc(model)
        self.deadline.check()
        settings = options.user_scaling, options.natural_units
        self.compiled = compile_mpcc(problem, timer, options.working_dir, datas, *settings, self.deadline.check)
        refuse_integers(self.compiled.variables, 'mpec_hybrid')
        self._problem, self._parameters, self._snapshot = problem, datas, None
        self.cache = SolverCache(self.compiled)

    def keep(self):
        """Take a snapshot of the model, by which ``refresh`` detects changes that it cannot follow."""
        self._snapshot = Snapshot(self._problem, self._parameters)

    def refresh(self):
        """Read parameters, start, bounds and fixed variables from the model again.

        Raises
        ------
        FesdError
            naming any other change
        Contradiction
            for a variable whose bounds cross
        """
        self._snapshot.check()
        self.compiled.refresh()


def persistent_model(model, options, timer, parameters) -> PersistentModel:
    """A ``PersistentModel`` to solve many times.

    Raises
    ------
    FesdError
        as ``PersistentModel``, and where fixed values that are not parameters violate a constraint
    """
    try:
        kept = PersistentModel(model, options, timer, parameters)
    except Contradiction as error:
        raise FesdError(model, f"fixed values alone leave no point: {error}", "list them in 'parameters', or change them") from None
    kept.keep()
    return kept
