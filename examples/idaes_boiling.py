"""
IDAES property package through boiling to dryness
=================================================

1 mol of benzene and toluene, 50/50, at 760 mmHg, is heated with 100 W from 340 K
until it boils and until it is dry, with an IDAES property package. IDAES' SmoothVLE
lets both phases exist at all temperatures, in equilibrium at T_eq, and smooths max
and min. ``fesd.smooth_to_complementarity`` makes them exact, with two pairs at each
time; the elements find the times of the first bubble and of the last drop.
``smaller`` is the same vessel without bubble and dew point: ``pyomo_fesd.units.vle``,
one condition. Data and exact times are those of ``flash``. ::

    dh/dt = Q,     h = h(T, P, z)
    T_eq = min(max(T, T_bubble), T_dew),     x_i p_i(T_eq) = y_i P

**Why the answer is right.** The times are those of the bubble and the dew point of the
mixture. Two models that share no equation of equilibrium, the property package with
exact max and min, and ``units.vle``, find both. The smoothed package has an error that
is printed beside.
"""

import logging
from math import log10

import numpy as np
import pandas as pd
import pyomo.dae as dae
import pyomo.environ as pyo
from flash import (
    ANTOINE,
    CP_LIQUID,
    CP_VAPOUR,
    DUTY,
    EXACT,
    FEED,
    HORIZON,
    LATENT,
    T0,
    T_B,
    dew_point,
    equilibrium_ratio,
    heated,
)
from idaes.core import Component, FlowsheetBlock, LiquidPhase, VaporPhase
from idaes.models.properties.modular_properties.base.generic_property import (
    GenericParameterBlock,
)
from idaes.models.properties.modular_properties.eos.ideal import Ideal
from idaes.models.properties.modular_properties.phase_equil import SmoothVLE
from idaes.models.properties.modular_properties.phase_equil.bubble_dew import (
    IdealBubbleDew,
)
from idaes.models.properties.modular_properties.phase_equil.forms import fugacity
from idaes.models.properties.modular_properties.pure import NIST
from idaes.models.properties.modular_properties.state_definitions import FTPx
from matplotlib.figure import Figure
from scipy.optimize import brentq

import pyomo_fesd
from pyomo_fesd.units import vle

logging.getLogger('idaes').setLevel(logging.ERROR)

PRESSURE = 101325.0  # Pa, 760 mmHg
MMHG_PER_BAR = 760 / 1.01325
units = pyo.units
HEAT, HEAT_CAPACITY = units.J / units.mol, units.J / units.mol / units.K
TEMPERATURE = 'fs.vessel.temperature'
PICTURE = 'idaes_boiling.png'


class Caloric:
    """Constant heat capacities; latent heat at the bubble point of the feed."""

    class enth_mol_liq_comp:
        @staticmethod
        def build_parameters(component):
            """No parameters."""

        @staticmethod
        def return_expression(b, component, T):
            """Enthalpy of the liquid, from T0."""
            return CP_LIQUID * HEAT_CAPACITY * (T - T0 * units.K)

    class enth_mol_ig_comp:
        @staticmethod
        def build_parameters(component):
            """No parameters."""

        @staticmethod
        def return_expression(b, component, T):
            """Enthalpy of the vapour."""
            return (
                LATENT + CP_LIQUID * (T_B - T0)
            ) * HEAT + CP_VAPOUR * HEAT_CAPACITY * (T - T_B * units.K)

    class dens_mol_liq_comp:
        @staticmethod
        def build_parameters(component):
            """No parameters."""

        @staticmethod
        def return_expression(b, component, T):
            """Density, used only away from the reference pressure."""
            return 1e4 * units.mol / units.m**3


def component(name, critical):
    """One component of the package, with Antoine's equation in bar and K."""
    A, B, C = ANTOINE[name]
    coefficients = {
        'A': A - log10(MMHG_PER_BAR),
        'B': (B, units.K),
        'C': (C - 273.15, units.K),
    }
    return {
        'type': Component,
        'enth_mol_liq_comp': Caloric,
        'enth_mol_ig_comp': Caloric,
        'dens_mol_liq_comp': Caloric,
        'pressure_sat_comp': NIST,
        'phase_equilibrium_form': {('Vap', 'Liq'): fugacity},
        'parameter_data': {
            'temperature_crit': (critical, units.K),
            'pressure_sat_comp_coeff': coefficients,
        },
    }


PACKAGE = {
    'components': {
        'benzene': component('benzene', 562.2),
        'toluene': component('toluene', 591.8),
    },
    'phases': {
        'Liq': {'type': LiquidPhase, 'equation_of_state': Ideal},
        'Vap': {'type': VaporPhase, 'equation_of_state': Ideal},
    },
    'base_units': dict(
        time=units.s,
        length=units.m,
        mass=units.kg,
        amount=units.mol,
        temperature=units.K,
    ),
    'state_definition': FTPx,
    'state_bounds': {
        'flow_mol': (0, 1, 10, units.mol / units.s),
        'temperature': (300, 340, 500, units.K),
        'pressure': (5e4, PRESSURE, 1e6, units.Pa),
    },
    'pressure_ref': (PRESSURE, units.Pa),
    'temperature_ref': (T0, units.K),
    'phases_in_equilibrium': [('Vap', 'Liq')],
    'phase_equilibrium_state': {('Vap', 'Liq'): SmoothVLE},
    'bubble_dew_method': IdealBubbleDew,
}


def build():
    """Build a closed vessel; the state is the enthalpy, the package gives the rest."""
    m = pyo.ConcreteModel()
    m.fs = FlowsheetBlock(dynamic=True, time_set=[0, HORIZON], time_units=units.s)
    m.fs.props = GenericParameterBlock(**PACKAGE)
    m.fs.vessel = m.fs.props.build_state_block(m.fs.time, defined_state=True)
    m.fs.enthalpy = pyo.Var(m.fs.time, initialize=0, units=HEAT)
    m.fs.heating = dae.DerivativeVar(m.fs.enthalpy, wrt=m.fs.time, units=HEAT / units.s)
    m.fs.enthalpy[0].fix(0)

    @m.fs.Constraint(m.fs.time)
    def heat_balance(fs, t):
        return fs.heating[t] == DUTY * HEAT / units.s

    @m.fs.Constraint(m.fs.time)
    def caloric(fs, t):
        return fs.enthalpy[t] == fs.vessel[t].enth_mol

    return m


def guess(t):
    """Rough guess of the temperature (K)."""
    boils, dry = EXACT
    T_D = dew_point()
    if t < boils:
        return T0 + (T_B - T0) * t / boils
    return (
        T_B + (T_D - T_B) * (t - boils) / (dry - boils)
        if t < dry
        else T_D + 0.1 * (t - dry)
    )


def initialise(m):
    """Run IDAES' own initialisation of the package at a guess of the temperature."""
    for t, state in m.fs.vessel.items():
        state.flow_mol.fix(1)
        state.pressure.fix(PRESSURE)
        for i, z in FEED.items():
            state.mole_frac_comp[i].fix(z)
        state.temperature.fix(guess(t))
    m.fs.vessel.initialize(solver='casadi_ipopt')
    for t, state in m.fs.vessel.items():
        state.temperature.unfix()
        if not m.fs.enthalpy[t].fixed:
            m.fs.enthalpy[t].set_value(pyo.value(state.enth_mol))
    m.fs.heating[:].set_value(DUTY)
    return m


def smooth(nfe=20, ncp=2):
    """Build IDAES' smooth model on equal elements; initialised, not solved."""
    m = build()
    pyo.TransformationFactory('dae.collocation').apply_to(
        m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp
    )
    return initialise(m)


def exact(m):
    """Make the phases exact and the elements movable."""
    temperatures = pyo.Reference(m.fs.vessel[:].temperature)
    pyo.TransformationFactory('fesd.smooth_to_complementarity').apply_to(m.fs)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m.fs, wrt=m.fs.time, continuous=[temperatures]
    )
    return m


def smaller(nfe=20, ncp=2):
    """Build the same equations with ``units.vle``, without bubble and dew point."""
    m = heated()
    for name in ('liquid', 'vapour', 'x', 'y'):
        m.del_component(name)
    m.phases = vle(
        m.t,
        components=m.i,
        fraction=m.v,
        composition=lambda m, t, i: FEED[i],
        ratio=m.K,
    )
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, wrt=m.t, nfe=nfe, ncp=ncp
    )
    return m


def solve(m):
    """Solve; returns the solver's results."""
    results = pyo.SolverFactory('mpec_hybrid').solve(m)
    pyo.assert_optimal_termination(results)
    return results


def switching_times(m):
    """Element boundaries (s) nearest to bubble and dew point.

    ``switches`` does not name nonsmooth terms.
    """
    table, ends = (
        pyomo_fesd.trajectory(m, m.fs.time)[TEMPERATURE],
        pyomo_fesd.element_lengths(m, m.fs.time)['end'],
    )
    inner = ends.iloc[:-1]
    at = np.interp(inner, table.index, table)
    return [inner.iloc[int(np.argmin(abs(at - T)))] for T in (T_B, dew_point())]


def largest_error(m):
    """Largest error (K) of the temperature."""
    table = pyomo_fesd.trajectory(m, m.fs.time)
    return max(
        abs(T - temperature(h))
        for T, h in zip(table[TEMPERATURE], table['fs.enthalpy'])
    )


def temperature(h):
    """Exact temperature (K) at the enthalpy h (J/mol)."""
    boils, dry = (DUTY * t for t in EXACT)
    if h <= boils:
        return T0 + h / CP_LIQUID
    vapour = LATENT + CP_LIQUID * (T_B - T0)
    if h >= dry:
        return T_B + (h - vapour) / CP_VAPOUR

    def surplus(T):
        """Rachford-Rice residual at the vapour fraction that satisfies the enthalpy."""
        liquid = CP_LIQUID * (T - T0)
        v = (h - liquid) / (vapour + CP_VAPOUR * (T - T_B) - liquid)
        ratios = {i: equilibrium_ratio(i, T) for i in FEED}
        return sum(
            z * (ratios[i] - 1) / (1 + v * (ratios[i] - 1)) for i, z in FEED.items()
        )

    return brentq(surplus, T_B, dew_point(), xtol=1e-12)


def draw(m, rounded):
    """Draw temperature, vapour fraction, and the error of the temperature."""
    figure = Figure(figsize=(7, 7), layout='constrained')
    level, fraction, error = axes = figure.subplots(3, 1, sharex=True)
    for model, label, style in ((m, 'exact', 'C0.-'), (rounded, 'SmoothVLE', 'C1.-')):
        table = pyomo_fesd.trajectory(model, model.fs.time)
        level.plot(table[TEMPERATURE], style, markersize=3, label=label)
        fraction.plot(table['fs.vessel.flow_mol_phase[Vap]'], style, markersize=3)
        distance = [
            abs(T - temperature(h))
            for T, h in zip(table[TEMPERATURE], table['fs.enthalpy'])
        ]
        error.semilogy(table.index, np.maximum(distance, 1e-13), style, markersize=3)
    level.set_ylabel('temperature (K)')
    level.legend()
    fraction.set_ylabel('vapour fraction')
    error.set_ylabel('error of the temperature (K)')
    error.set_xlabel('time (s)')
    for axis in axes:
        for time in EXACT:
            axis.axvline(time, color='grey', linestyle=':')
    figure.savefig(PICTURE, dpi=150)


def main():
    """Solve all three models, print the answers, draw."""
    rounded = smooth()
    m = exact(rounded.clone())
    solve(rounded)
    results = solve(m)
    print(f'mpec_hybrid: {results.solver.reason}.')
    for name, time, known in zip(('It boils', 'It is dry'), switching_times(m), EXACT):
        print(f'{name} from {time:.6f} s on, {time - known:+.1e} s off.')
    for name, model in (('exact package', m), ('SmoothVLE', rounded)):
        print(
            f'Largest error of the temperature, {name}: {largest_error(model):.1e} K.'
        )
    small = smaller()
    solve(small)
    for switch, known in zip(pyomo_fesd.switches(small), EXACT):
        print(
            f'units.vle: {switch.time:.6f} s ({switch.before} -> {switch.after}), '
            f'{switch.time - known:+.1e} s off.'
        )
    print(
        pd.DataFrame(
            {'package': pyomo_fesd.report(m), 'units.vle': pyomo_fesd.report(small)}
        )
        .head(4)
        .to_string()
    )
    draw(m, rounded)
    print(f'Temperature, vapour fraction and error over time: {PICTURE}')


if __name__ == '__main__':
    main()
