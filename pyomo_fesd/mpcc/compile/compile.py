"""Compile an MPCC: Pyomo's expressions -> classes of rows -> casadi functions with exact sparse derivatives.

The model's own rows, sides of pairs, decisions and penalty terms are read as linear and nonlinear parts (``row_reader``,
``entries``).  Nonlinear parts of equal form become one class with one derivative (``grouped_rows``), and all of it becomes one
scaled function (``assemble``).  Relaxations, branches and the LPEC are all formed from these functions, so neither another eps nor
another branch needs another compilation.
"""

from pyomo.common.timing import HierarchicalTimer

from pyomo_fesd.core import DeferredInterrupt, phase
from pyomo_fesd.mpcc.compile import nl_file
from pyomo_fesd.mpcc.compile.assemble import USER, assemble
from pyomo_fesd.mpcc.compile.model_rows import model_rows
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
    expanded: bool = False,
    conditions: bool = False,
) -> MpccFunctions:
    """Compile ``problem``.

    Parameters
    ----------
    problem : Mpcc
    timer : HierarchicalTimer
    folder : path, optional
        where an NL file of the model is to be written and kept; default: there is none
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
    expanded : bool
        whether each function is to be a casadi graph of its own (SX), however large the model is: the baselines of the MPCC study
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
    with DeferredInterrupt() as interrupt, parameter_symbols(problem.model, parameters) as symbols, interrupt.raising():
        if folder:
            nl_file.write(problem, folder)
        with phase(timer, 'read'):
            rows = model_rows(problem, symbols, conditions)
        check()
        with phase(timer, 'assemble'):
            return assemble(problem, rows, symbols, factors, natural_units, expanded)
