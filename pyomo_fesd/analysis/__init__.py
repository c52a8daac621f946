"""Read-only studies of a model: ``report``, ``structure`` and ``branch_equations``.

model_size.py
    ``report``: counts of the variables, constraints and pairs that the solver will see
degrees_of_freedom.py
    ``structure``: equations against unknowns, and the blocks where they do not match
branch_equations.py
    ``branch_equations``: a copy for tools that know equations only

The solver plug-ins call ``structure`` to explain a failure.
"""

from pyomo_fesd.analysis.branch_equations import branch_equations
from pyomo_fesd.analysis.degrees_of_freedom import structure
from pyomo_fesd.analysis.model_size import report
