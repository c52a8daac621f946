"""Integer variables beside switches: an outer loop over their values, each solved and certified by ``mpec_hybrid``.

Read in this order: ``decide_integers`` (the loop) and ``sum_up_rounding`` (a first choice from relaxed values).
"""

from pyomo_fesd.integers.decide_integers import IntegerDecision, decide_integers
from pyomo_fesd.integers.sum_up_rounding import RoundedModes, sum_up_rounding
