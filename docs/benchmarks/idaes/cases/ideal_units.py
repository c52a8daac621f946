"""IDAES' Pump and Valve under the names that a script gives to the Helmholtz units."""

import pyomo.environ as pyo
from idaes.core import declare_process_block_class
from idaes.models.unit_models.pressure_changer import PumpData
from idaes.models.unit_models.valve import ValveData
from pyomo.common.config import ConfigValue


@declare_process_block_class('LiquidPump')
class LiquidPumpData(PumpData):
    """Pump whose efficiency is called isentropic."""

    def build(self):
        super().build()
        self.efficiency_isentropic = pyo.Reference(self.efficiency_pump)


@declare_process_block_class('LiquidValve')
class LiquidValveData(ValveData):
    """Valve that takes the keyword ``phase``, and is initialised with its flow where the outlet pressure is fixed too."""

    CONFIG = ValveData.CONFIG()
    CONFIG.declare('phase', ConfigValue(default='Liq'))

    def initialize_build(self, **options):
        fixed = [v for v in self.outlet.pressure.values() if v.fixed]
        given = {v.name: v.value for v in fixed}
        for v in fixed:
            v.unfix()
        super().initialize_build(**options)
        for v in fixed:
            v.fix(given[v.name])
