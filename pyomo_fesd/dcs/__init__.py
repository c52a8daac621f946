"""Transform Disjunctions and piecewise functions over time into a dynamic complementarity system: ``fesd.dcs``.

Read ``transformation.py`` (keywords and reverse maps), then ``writer.py``, which calls the steps in order: the piecewise functions
(``piecewise/``), the Disjunctions with their regions, equations and logic (``reading/``), the multipliers in the smallest form
(``forms/``), and the equations blended with them (``blending.py``), or copied where a Disjunction is built like a known one
(``blended_copies.py``).  ``source_maps.py`` records where each component came from.
``fesd.finite_elements`` does not call this room: it asks the record of switched systems (``core``) to write itself at new times.
"""

from pyomo_fesd.dcs.transformation import DynamicComplementaritySystem
from pyomo_fesd.dcs.writer import continues_everywhere
