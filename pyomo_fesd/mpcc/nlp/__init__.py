"""NLP solvers behind one contract: ``nlp_solver(name)`` is a class that is built once for a graph and solves with changing bounds.

Read in this order: ``solver`` (the contract ``NlpSolver``, the table of names, option checks), ``deadline``, ``casadi_solvers``
(Ipopt and Uno in casadi's wheel) with ``hessian_shift``, ``cyipopt_solver`` (the system's Ipopt), ``executable_solvers`` (any
solver that reads NL files) with ``sx_to_pyomo``.  A new solver is a subclass of ``NlpSolver`` with a row in ``NLP_SOLVERS``.
"""

from pyomo_fesd.mpcc.nlp.casadi_solvers import PlainIpopt
from pyomo_fesd.mpcc.nlp.deadline import Deadline, OutOfTime
from pyomo_fesd.mpcc.nlp.solver import DIVERGING, NEWTON, STALLED, Fall, NlpResult, Stall, check_options, nlp_solver
