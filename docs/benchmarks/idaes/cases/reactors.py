"""Stirred reactors and kinetics."""

from benchmarks.idaes.cases.case import Case, flowsheet_time
from pyomo.gdp import Disjunction

# Chemical Akzo Nobel problem, of IDAES' tests of PETSc: the feed is shut where y1 has fallen to 0.3


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


# Isothermal CSTR: the feed is diluted once the product has formed


def simple_cstr(nfe):
    from idaes.apps.caprese.tests.test_simple_model import make_model

    return make_model(nfe=nfe)


def dilute(m):
    m.conc_in[:, 'A'].unfix()
    m.dilution = Disjunction(
        m.time,
        rule=lambda m, t: [
            [m.conc[t, 'B'] <= 1.5, m.conc_in[t, 'A'] == 5],
            [m.conc[t, 'B'] >= 1.5, m.conc_in[t, 'A'] == 4],
        ],
    )


# CSTR of the NMPC example: the substrate is shut where its product has risen


def nmpc_cstr(nfe):
    from idaes.apps.caprese.examples.cstr_model import make_model

    return make_model(horizon=6, ntfe=nfe, ntcp=2)


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


CASES = {
    'chemakzo': Case('core/solvers/features.py: dae', chemakzo, shut_the_feed, lambda m: m.t, (20, 40, 80)),
    'simple CSTR': Case('apps/caprese/tests/test_simple_model.py: make_model', simple_cstr, dilute, lambda m: m.time, (10, 20)),
    'NMPC CSTR': Case('apps/caprese/examples/cstr_model.py: make_model', nmpc_cstr, shut_the_substrate, flowsheet_time, (10, 20)),
}
