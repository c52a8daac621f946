"""Replace piecewise functions over time by complementarity: ``Piecewise``, ``PiecewiseLinearFunction`` and ``Expr_if``.

Read ``piecewise_rewriter.py``, which finds the functions in a model and calls the rule for each: ``univariate.py`` (one argument),
``multivariate.py`` and ``simplices.py`` (several arguments, over a ``regular_triangulation.py``), ``expr_if.py``.  A rule sees one
time of one component, a ``rewrite_context.py``.  ``breakpoints.py`` writes each boundary q = b once however many functions share
it, in a block for each quantity (``generated_blocks.py``); ``replaced_constraints.py`` holds the constraints with the new
expressions.
"""

from pyomo_fesd.dcs.piecewise.piecewise_rewriter import PiecewiseRewriter, may_contain_functions
from pyomo_fesd.dcs.piecewise.replaced_constraints import replacement_of
