"""A model that is compiled once and solved many times, with other values of its parameters."""

from pyomo_fesd.errors import FesdError
from pyomo_fesd.mpcc.built import Built
from pyomo_fesd.mpcc.changes import Snapshot
from pyomo_fesd.mpcc.compile import compile_problem
from pyomo_fesd.mpcc.deadline import Deadline
from pyomo_fesd.mpcc.parameters import parameter_data
from pyomo_fesd.mpcc.problem import read_problem
from pyomo_fesd.mpcc.source import Contradiction


class Instance:
    """A compiled model with what was built for it.

    Parameters
    ----------
    model : Block
    options : ConfigDict
        of ``mpec_hybrid``
    timer : HierarchicalTimer
    parameters : list of components
        fixed variables and mutable Params, indexed or not, whose values may change

    Attributes
    ----------
    compiled : Compiled
    built : Built
    deadline : Deadline
        of all its NLP solvers; every solve sets it anew

    Raises
    ------
    FesdError
        for a model that is no MPCC, for what is no parameter
    Contradiction
        where fixed values alone violate a constraint
    """

    def __init__(self, model, options, timer, parameters=()):
        self.model, datas = model, parameter_data(parameters)
        problem = read_problem(model)
        self.compiled = compile_problem(problem, timer, options.working_dir, datas, options.user_scaling)
        self._problem, self._parameters, self._snapshot = problem, datas, None
        self.built, self.deadline = Built(self.compiled), Deadline()

    def keep(self):
        """Remember the model as it is compiled, so that ``refresh`` notices what it cannot follow."""
        self._snapshot = Snapshot(self._problem, self._parameters)

    def refresh(self):
        """Read parameters, start, bounds and fixed variables from the model again.

        Raises
        ------
        FesdError
            naming what has changed besides these
        Contradiction
            for a variable whose bounds cross
        """
        self._snapshot.check()
        self.compiled.refresh()


def kept_instance(model, options, timer, parameters):
    """An ``Instance`` to solve many times.

    Raises
    ------
    FesdError
        as ``Instance``, and where fixed values that are no parameters violate a constraint
    """
    try:
        instance = Instance(model, options, timer, parameters)
    except Contradiction as error:
        raise FesdError(model, f"fixed values alone leave no point: {error}", "list them in 'parameters', or change them") from None
    instance.keep()
    return instance
