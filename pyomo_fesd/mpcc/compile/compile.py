"""Compile an MPCC: Pyomo's NL writer -> casadi -> SX functions with exact sparse derivatives.

The NL file holds the model's own rows, then one row for every side of a pair that is not a plain variable, one for every
decision and one for every penalty term (``auxiliary_rows``).  casadi reads it (``nl_file``), each of these gets its address
(``nl_index``), and all of it becomes one scaled function (``assemble``).  Relaxations, branches and the LPEC are all formed from
the same SX graph, so neither another eps nor another branch needs another compilation.
"""

from pyomo.common.errors import InfeasibleConstraintException
from pyomo.common.timing import HierarchicalTimer

from pyomo_fesd.core import DeferredInterrupt, phase, refuse_foreign
from pyomo_fesd.mpcc.compile import nl_file
from pyomo_fesd.mpcc.compile.assemble import USER, assemble
from pyomo_fesd.mpcc.compile.auxiliary_rows import auxiliary_rows
from pyomo_fesd.mpcc.compile.conditionals import conditionals, resolved
from pyomo_fesd.mpcc.compile.model_values import Contradiction
from pyomo_fesd.mpcc.compile.mpcc_functions import MpccFunctions
from pyomo_fesd.mpcc.compile.parameters import parameter_symbols
from pyomo_fesd.mpcc.compile.read_mpcc import Mpcc
from pyomo_fesd.mpcc.compile.scaling import UserFactors


def compile_mpcc(
    problem: Mpcc,
    timer: HierarchicalTimer,
    folder=None,
    parameters=(),
    user_scaling: bool = True,
    natural_units: str = USER,
    check=lambda: None,
    conditions: bool = False,
) -> MpccFunctions:
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
        whether ``scaling_factor`` suffixes apply
    natural_units : str
        what shows the sizes of variables and rows that have no such factor: 'starts' (start values), 'coefficients' (of linear
        terms, bounds), 'auto' (start values where ``HomotopyHints.alike`` relates variables, coefficients of MPCCs that are
        linear or small), 'user' (nothing: they stay as they are, and so does the objective, which gets its unit in the other cases)
    check : callable
        called between the steps; an exception of its own ends them
    conditions : bool
        whether ``Expr_if`` may stand in rows: kinks that nothing resolves, as in a smooth static model

    Raises
    ------
    FesdError
        naming the component with a function that cannot be evaluated, before anything is solved
    Contradiction
        where fixed values alone violate a constraint
    """
    factors = UserFactors(user_scaling)
    with (
        DeferredInterrupt() as interrupt,
        parameter_symbols(problem.model, parameters) as symbols,
        auxiliary_rows(problem, symbols) as entries,
        interrupt.raising(),
    ):
        nl = _read(problem.model, symbols, timer, folder, check, conditions)
        check()
        with phase(timer, 'assemble'):
            return assemble(problem, entries, nl, symbols, factors, natural_units)


def _read(model, symbols, timer, folder, check, conditions):
    """The model as an ``NlModel``; where it is refused for an ``Expr_if``, again without these, if they are accepted."""
    try:
        return _through_file(model, symbols, timer, folder, check)
    except nl_file.HasConditions as refused:
        if not conditions:
            raise refused.error from None
    with conditionals(model) as found:
        return resolved(found, _through_file(model, symbols, timer, folder, check))


def _through_file(model, symbols, timer, folder, check):
    """The model, with its auxiliary rows, as an ``NlModel``."""
    with DeferredInterrupt() as interrupt, nl_file.folder_for(folder) as target, interrupt.raising():
        with phase(timer, 'write'):
            try:
                path, variables, constraints = nl_file.write(model, target)
            except InfeasibleConstraintException as error:
                raise Contradiction(str(error)) from None
        refuse_foreign(variables, model.model(), model)
        check()
        with phase(timer, 'import'):
            return nl_file.read(model, symbols, path, variables, constraints)
