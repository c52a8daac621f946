"""Post-solve diagnostics of a moving grid that the certificate does not cover.

``review`` calls the others and logs their messages; each is a function ``(model, wrt, switching functions) -> messages``:
``uniqueness`` (both modes lead away from a boundary), ``missed_crossings`` (a switch between two collocation points),
``collapsed_elements``, ``uneven_elements`` and ``varied_inputs`` (values on labels).  The room reads results and moving
grids, and changes nothing on the model.
"""

from pyomo_fesd.diagnostics.missed_crossings import missed_crossings
from pyomo_fesd.diagnostics.review import MarchReview, diagnose
