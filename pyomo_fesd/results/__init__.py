"""Results on physical time: trajectories, switches, plots and switching functions of a transformed model.

Read ``physical_time`` first (labels and elements), then ``disjunction_modes`` and ``complementarity_modes`` (which mode is active),
then what users call: ``trajectory``, ``switches`` and ``plot``.  ``element_table`` writes a trajectory while elements march along.
``switching_functions`` reads c, p, n and nu for diagnostics and refinement; ``indicators`` sets the Booleans of disjuncts after a
solve.
"""

from pyomo_fesd.results.element_table import ElementTable
from pyomo_fesd.results.indicators import set_indicators
from pyomo_fesd.results.physical_time import element_lengths, physical_time
from pyomo_fesd.results.plot import plot
from pyomo_fesd.results.switches import SWITCHES, ElementSwitches, Switch, labelled_switches, switches
from pyomo_fesd.results.switching_functions import SwitchingFunction, largest_value, switching_functions
from pyomo_fesd.results.trajectory import columns_over_time, jumps_that_happen, trajectory
