"""Water as an ideal gas or as an incompressible liquid, with the names of IDAES' iapws95, whose library casadi cannot call.

States are those of iapws95: flow, molar enthalpy, pressure.  Heat capacities and the density of the liquid are constant.
"""

from enum import Enum

import pyomo.environ as pyo
from idaes.core import (
    Component,
    EnergyBalanceType,
    LiquidPhase,
    MaterialBalanceType,
    MaterialFlowBasis,
    PhysicalParameterBlock,
    StateBlock,
    StateBlockData,
    VaporPhase,
    declare_process_block_class,
)
from idaes.core.util import scaling as iscale
from idaes.core.util.initialization import fix_state_vars, revert_state_vars
from pyomo.common.config import ConfigValue
from pyomo.environ import units

PhaseType = Enum('PhaseType', 'MIX LG L G')


@declare_process_block_class('Iapws95ParameterBlock')
class IdealWaterParameters(PhysicalParameterBlock):
    """One phase: gas with ``phase_presentation=PhaseType.G``, else liquid."""

    CONFIG = PhysicalParameterBlock.CONFIG()
    CONFIG.declare('phase_presentation', ConfigValue(default=PhaseType.L))

    def build(self):
        super().build()
        self._state_block_class = IdealWaterStateBlock  # noqa: F821  IDAES' decorator makes it, below
        self.is_gas = self.config.phase_presentation is PhaseType.G
        if self.is_gas:
            self.Vap = VaporPhase()
        else:
            self.Liq = LiquidPhase()
        self.H2O = Component()
        heat, energy = units.J / units.mol / units.K, units.J / units.mol
        self.R = pyo.Param(initialize=8.314462618, units=heat)
        self.mw = pyo.Param(initialize=0.01801528, units=units.kg / units.mol)
        self.cp = pyo.Param(initialize=36.0 if self.is_gas else 75.3, units=heat)
        self.temperature_ref = pyo.Param(initialize=400.0 if self.is_gas else 273.15, units=units.K)
        self.enth_ref = pyo.Param(initialize=48900.0 if self.is_gas else 0.0, units=energy)
        self.dens_liq = pyo.Param(initialize=55388.0, units=units.mol / units.m**3)

    @classmethod
    def define_metadata(cls, obj):
        names = ('flow_mol', 'enth_mol', 'pressure', 'temperature', 'dens_mol', 'flow_vol')
        obj.add_properties({name: {'method': None} for name in names})
        obj.add_default_units({'time': units.s, 'length': units.m, 'mass': units.kg, 'amount': units.mol, 'temperature': units.K})


class _IdealWaterStates(StateBlock):
    """Nothing has to be solved: all properties are expressions of the states."""

    def initialize(self, state_args=None, state_vars_fixed=False, hold_state=False, **options):
        flags = None if state_vars_fixed else fix_state_vars(self, state_args)
        if hold_state:
            return flags
        self.release_state(flags)

    def release_state(self, flags, **options):
        if flags is not None:
            revert_state_vars(self, flags)


@declare_process_block_class('IdealWaterStateBlock', block_class=_IdealWaterStates)
class IdealWaterState(StateBlockData):
    """Properties at one place."""

    def build(self):
        super().build()
        p = self.params
        self.flow_mol = pyo.Var(initialize=100.0, units=units.mol / units.s)
        self.enth_mol = pyo.Var(initialize=p.enth_ref.value + 40 * p.cp.value, units=units.J / units.mol)
        self.pressure = pyo.Var(initialize=1e5, bounds=(1, 1e9), units=units.Pa)
        self.temperature = pyo.Expression(expr=p.temperature_ref + (self.enth_mol - p.enth_ref) / p.cp)
        self.dens_mol = pyo.Expression(expr=self.pressure / (p.R * self.temperature) if p.is_gas else p.dens_liq)
        self.flow_vol = pyo.Expression(expr=self.flow_mol / self.dens_mol)
        self.energy_internal_mol = pyo.Expression(expr=self.enth_mol - self.pressure / self.dens_mol)
        self.dens_mass_phase = pyo.Expression(p.phase_list, rule=lambda b, phase: b.dens_mol * p.mw)

    def get_material_flow_terms(self, p, j):
        return self.flow_mol

    def get_enthalpy_flow_terms(self, p):
        return self.flow_mol * self.enth_mol

    def get_material_density_terms(self, p, j):
        return self.dens_mol

    def get_energy_density_terms(self, p):
        return self.dens_mol * self.energy_internal_mol

    def default_material_balance_type(self):
        return MaterialBalanceType.componentTotal

    def default_energy_balance_type(self):
        return EnergyBalanceType.enthalpyTotal

    def get_material_flow_basis(self):
        return MaterialFlowBasis.molar

    def define_state_vars(self):
        return {'flow_mol': self.flow_mol, 'enth_mol': self.enth_mol, 'pressure': self.pressure}

    def calculate_scaling_factors(self):
        super().calculate_scaling_factors()
        for component, factor in (('flow_mol', 1e-2), ('enth_mol', 1e-4), ('pressure', 1e-5), ('temperature', 1e-2)):
            self._give_factor(self.component(component), factor)
        self._give_factor(self.dens_mol, 1e-2)
        self._give_factor(self.energy_internal_mol, 1e-4)

    @staticmethod
    def _give_factor(component, factor):
        if iscale.get_scaling_factor(component) is None:
            iscale.set_scaling_factor(component, factor)
