"""Dynamic models from idaes-pse's own tests and examples, each with one switch added.

``build(nfe)`` runs the script as published; ``switch(m)`` holds the lines that are added.  The reference is the published
model, on a fixed fine grid, up to the first zero of ``guard(m, t)``.
"""

from collections.abc import Callable
from dataclasses import dataclass

import pyomo.environ as pyo
from pyomo.gdp import Disjunction


@dataclass(frozen=True)
class Case:
    """One model.

    Attributes
    ----------
    script : str, where it was published
    build : callable (number of elements) -> model
    switch : callable, the lines that are added
    guard : callable (model, t) -> expression, zero at the switch, of states
    wrt : callable model -> ContinuousSet
    grids : tuple of int, numbers of elements; the first as published, or the coarsest that IDAES' own tests use
    fine : int, elements of the reference
    """

    script: str
    build: Callable
    switch: Callable
    guard: Callable
    wrt: Callable
    grids: tuple
    fine: int


# Chemical Akzo Nobel problem, of IDAES' own tests of PETSc: the feed is shut where y1 has fallen to 0.3


def chemakzo(nfe):
    from idaes.core.solvers.features import dae

    return dae(nfe=nfe)[0]


def shut_the_feed(m):
    m.del_component(m.eq_Fin)
    m.feed = Disjunction(
        m.t,
        rule=lambda m, t: [
            [m.y[t, 1] >= 0.3, m.Fin[t] == m.klA * (m.pCO2 / m.H - m.y[t, 2])],
            [m.y[t, 1] <= 0.3, m.Fin[t] == 0.2 * m.klA * (m.pCO2 / m.H - m.y[t, 2])],
        ],
    )


# CSTR of the NMPC example: the substrate is shut where its contents have risen


def nmpc_cstr(nfe):
    from idaes.apps.caprese.examples.cstr_model import make_model

    m = make_model(horizon=6, ntfe=nfe, ntcp=2)
    return m


def shut_the_substrate(m):
    fs, holdup = m.fs, m.fs.cstr.control_volume.material_holdup
    fs.mixer.S_inlet.flow_vol.unfix()
    fs.dosing = Disjunction(
        fs.time,
        rule=lambda b, t: [
            [holdup[t, 'aq', 'P'] <= 0.4, fs.mixer.S_inlet.flow_vol[t] == 2.1],
            [holdup[t, 'aq', 'P'] >= 0.4, fs.mixer.S_inlet.flow_vol[t] == 1.0],
        ],
    )


# Thermogravimetric analyser: methane is shut off where half of the oxygen is used


def tga(nfe):
    from idaes.models_extra.gas_solid_contactors.flowsheets import dyn_TGA_example

    return dyn_TGA_example.main(pyo.ConcreteModel())


def leaner_gas(m):
    fs, bed = m.fs, m.fs.TGA
    half = 0.5 * pyo.value(bed.solids_material_holdup[0, 'Fe2O3'])
    for t in fs.time:
        bed.gas[t].mole_frac_comp['CH4'].unfix()
    fs.lean = Disjunction(
        fs.time,
        rule=lambda b, t: [
            [bed.solids_material_holdup[t, 'Fe2O3'] >= half, bed.gas[t].mole_frac_comp['CH4'] == 0.1],
            [bed.solids_material_holdup[t, 'Fe2O3'] <= half, bed.gas[t].mole_frac_comp['CH4'] == 0.05],
        ],
    )


CASES = {
    'chemakzo': Case(
        'idaes/core/solvers/features.py: dae',
        chemakzo,
        shut_the_feed,
        lambda m, t: m.y[t, 1] - 0.3,
        lambda m: m.t,
        grids=(20, 40, 80),
        fine=320,
    ),
    'NMPC CSTR': Case(
        'idaes/apps/caprese/examples/cstr_model.py: make_model',
        nmpc_cstr,
        shut_the_substrate,
        lambda m, t: m.fs.cstr.control_volume.material_holdup[t, 'aq', 'P'] - 0.4,
        lambda m: m.fs.time,
        grids=(10, 20),
        fine=60,
    ),
    'TGA': Case(
        'idaes/models_extra/gas_solid_contactors/flowsheets/dyn_TGA_example.py: main',
        tga,
        leaner_gas,
        lambda m, t: m.fs.TGA.solids_material_holdup[t, 'Fe2O3'] - 0.5 * m.fs.TGA.solids_material_holdup[0, 'Fe2O3'],
        lambda m: m.fs.time,
        grids=(100,),
        fine=100,
    ),
}
