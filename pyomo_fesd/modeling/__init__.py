"""Additions to the modelling language, called while the model is written, before or after discretisation.

nonsmooth_functions.py, on positive_parts.py
    ``maximum``, ``minimum``, ``absolute``, ``positive_part``, ``clip`` in constraints (theory, eq. 8)
clock.py
    physical time as a state, for right-hand sides that depend on time
signal.py, on time_series.py
    time series as inputs
state_jump.py, projection.py
    jumps of states, states confined to a set
contact.py, on sticking_contact.py, friction.py
    rigid bodies that touch, those that must not slip, dry friction of any force law
rules.py
    checks of the rules of these Blocks
"""

from pyomo_fesd.modeling.clock import clock
from pyomo_fesd.modeling.contact import contact
from pyomo_fesd.modeling.friction import friction
from pyomo_fesd.modeling.nonsmooth_functions import absolute, clip, maximum, minimum, positive_part
from pyomo_fesd.modeling.projection import projection
from pyomo_fesd.modeling.signal import signal
from pyomo_fesd.modeling.state_jump import state_jump
