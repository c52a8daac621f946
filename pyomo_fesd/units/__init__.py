"""Additions to unit models that switch: ``m.fs.weir = pyomo_fesd.units.weir(m.fs.time, level=..., crest=..., flow=...)``.

Each function takes Vars and expressions over time of any Pyomo block, with or without IDAES, and returns a Block over time to be
added to the model.  Read over_time.py first, which reads these quantities at each time; then

weir.py, check_valve.py (both by one_way.py), saturation.py, split_range.py, vle.py
    complementarity conditions
relay.py with relief_valve.py and pump.py, anti_windup.py
    Disjunctions, for ``fesd.dcs``
scaling.py
    scaling factors for a flowsheet
"""

from pyomo_fesd.units.anti_windup import anti_windup
from pyomo_fesd.units.check_valve import check_valve
from pyomo_fesd.units.pump import pump
from pyomo_fesd.units.relay import relay
from pyomo_fesd.units.relief_valve import relief_valve
from pyomo_fesd.units.saturation import saturation
from pyomo_fesd.units.scaling import scale_by_values
from pyomo_fesd.units.split_range import split_range
from pyomo_fesd.units.vle import vle
from pyomo_fesd.units.weir import weir

__all__ = [
    'anti_windup',
    'check_valve',
    'pump',
    'relay',
    'relief_valve',
    'saturation',
    'scale_by_values',
    'split_range',
    'vle',
    'weir',
]
