"""``fesd.finite_elements``: collocation on elements with variable lengths, whose boundaries find the switches.

The transformation reads the switched systems that other transformations recorded, discretises with pyomo.dae, and writes a
``MovingGrid``.  Read its files in this order:

- ``transformation`` calls all others, in the order of its ``_apply_to``; ``options`` declares its keywords
- ``expansion``, ``collocation``: pyomo.dae's discretisation, also of Disjuncts
- ``lengths``, ``fixed_points``, ``free_time``, ``quadrature``, ``controls``: time on moving elements
- ``time_complementarities``, ``mixed_complementarity``, ``continuity``, ``algebraic_graph``: conditions and their continuity
- ``cross_complementarity``, ``state_jumps``, ``hysteresis``, ``right_limits``, ``mode_limits``, ``relations``: the laws of
  switching
- ``contacts``, ``impulse_balance``, ``impact_laws``, ``friction_impulses``, ``curved_contacts``: rigid contacts
- ``equilibration``, ``sliding_exit``: the lengths
- ``changes`` at boundaries, with ``neighbour_branches``, ``coincidences``, ``arrivals``, ``chain_of_elements``: hints for the
  homotopy
- ``recollocation``, ``inner_points``: more points in the elements of a model that is discretised already
- ``given_inputs``, ``explicit_time``, ``untaken_kinks``, ``spatial_sets``, ``first_mode``: inputs, warnings and refusals
"""

from pyomo_fesd.finite_elements.equilibration import TINY
from pyomo_fesd.finite_elements.explicit_time import differ
from pyomo_fesd.finite_elements.first_mode import refuse_first_mode, refuse_first_modes
from pyomo_fesd.finite_elements.hysteresis import LEFT, RIGHT
from pyomo_fesd.finite_elements.lengths import LEAST
from pyomo_fesd.finite_elements.recollocation import recollocate
from pyomo_fesd.finite_elements.transformation import FiniteElements, lay_elements
