"""``simulate``: element-by-element simulation of a system with zero degrees of freedom.

Files in the order of the data's way: ``simulate`` (entry), ``timeless_equations``, of which ``static_equations`` are solved first,
and ``inputs`` (values known in advance), ``passes`` through all elements with the ``step_sizes`` of a plan and the ``progress`` so
far, ``element_solver`` (one element after the other, with the ``events`` between them).  ``without_grid`` lays elements for a model
without any: a few ``marching_elements`` in place of ``passes`` where all elements have the same equations.

One element: ``equation_reader`` reads its ``element_equations`` and tells which elements share compiled functions,
``determinacy`` refuses undetermined unknowns, ``element_class`` solves it: by Newton's method while the active set is known
(``casadi_expressions``, ``element_functions`` with their ``element_scale``, ``element_residuals``, ``element_signs``, ``newton``,
``active_set_step``), by ``element_mpcc`` on an ``element_model`` of its own where it is not.
``largest_residuals`` explains failures.  ``first_guess`` is what ``mpec_hybrid`` calls where nothing is free.
"""

from pyomo_fesd.simulation import first_guess
from pyomo_fesd.simulation.progress import TooFewElements
from pyomo_fesd.simulation.scalar_results import evaluate_scalars
from pyomo_fesd.simulation.simulate import simulate, states_fixed_later
from pyomo_fesd.simulation.timeless_equations import timeless_equations
