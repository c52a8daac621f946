"""An MPCC compiled once: Pyomo's NL writer -> casadi -> SX functions with exact sparse derivatives.

The NL file holds the model's own rows, then one row for every side of a pair that is not a plain variable, one for every
decision and one for every penalty term (``scratch``).  casadi reads it (``nl_file``), each of these is found again (``layout``),
and all of it becomes one scaled function (``assemble``).  Relaxations, branches and the LPEC are all formed from the same SX
graph, so neither eps nor a branch needs a rebuild.
"""

from pyomo.common.errors import InfeasibleConstraintException

from pyomo_fesd.mpcc import nl_file
from pyomo_fesd.mpcc.assemble import assemble
from pyomo_fesd.mpcc.parameters import symbols
from pyomo_fesd.mpcc.phase import phase
from pyomo_fesd.mpcc.scaling import UserFactors
from pyomo_fesd.mpcc.scratch import entries_of
from pyomo_fesd.mpcc.source import Contradiction
from pyomo_fesd.timeindex import refuse_foreign


def compile_problem(problem, timer, folder=None, parameters=(), user_scaling=True):
    """Compile ``problem``.

    Parameters
    ----------
    problem : Mpcc
    timer : HierarchicalTimer
    folder : path, optional
        where the NL file is to be written and kept; default: a temporary one
    parameters : list of VarData and ParamData
        fixed variables and mutable Params whose values may change in later solves
    user_scaling : bool
        whether ``scaling_factor`` suffixes are honoured

    Raises
    ------
    FesdError
        naming the component with a function that cannot be evaluated, before anything is solved
    Contradiction
        where fixed values alone violate a constraint
    """
    factors = UserFactors(user_scaling)
    with symbols(problem.model, parameters) as handles, entries_of(problem, handles) as entries:
        nl = _through_file(problem.model, handles, timer, folder)
        with phase(timer, 'assemble'):
            return assemble(problem, entries, nl, handles, factors)


def _through_file(model, handles, timer, folder):
    """The model, with all that stands on it now, as an ``Nl``."""
    with nl_file.folder_for(folder) as place:
        with phase(timer, 'write'):
            try:
                path, variables, constraints = nl_file.write(model, place)
            except InfeasibleConstraintException as error:
                raise Contradiction(str(error)) from None
        refuse_foreign(variables, model.model(), model)
        with phase(timer, 'import'):
            return nl_file.read(model, handles, path, variables, constraints)
