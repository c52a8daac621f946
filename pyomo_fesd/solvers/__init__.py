"""Pyomo's solver plug-ins ``mpec_hybrid`` and ``casadi_ipopt``, for both of Pyomo's solver interfaces; ``certify``.

Read in this order: ``mpec_hybrid`` (puts the parts of ``pyomo_fesd.mpcc`` together) with ``options`` (one row each),
``persistent_model`` (``set_instance``: compiled once, solved many times) and ``unready_models`` (models that are refused),
``simulated_start`` (a simulation where nothing is free), ``even_elements`` (of a solution), ``user_names`` (of what is violated),
``casadi_ipopt`` (plain NLPs) with ``singular_start`` and ``stand_in`` (for the names of an executable), ``plugin`` (code of both).
Here, and not in ``mpcc``, solvers know of time: indicators of disjuncts, diagnostics, models that are not discretised.
"""

from pyomo_fesd.solvers.casadi_ipopt import CasadiIpopt, LegacyCasadiIpopt
from pyomo_fesd.solvers.mpec_hybrid import LegacyMpecHybrid, MpecHybrid, certified_model, certify
from pyomo_fesd.solvers.options import MpecHybridConfig
from pyomo_fesd.solvers.simulated_start import register_simulation
from pyomo_fesd.solvers.unready_models import refuse_unready
from pyomo_fesd.solvers.user_names import user_names
