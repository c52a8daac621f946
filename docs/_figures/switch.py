"""Draw ``docs/_static/switch.svg``: one switch, solved in three ways. Run it from any folder: ``python docs/_figures/switch.py``.

A tank fills at rate 1 and overflows when the volume reaches 0.7, so the outflow F jumps from 0 to 1 at exactly t = 0.7:

    dV/dt = 1 - F,   V(0) = 0,   0 <= F  perp  0.7 - V >= 0.
"""

from pathlib import Path

import pyomo.dae as dae
import pyomo.environ as pyo
from matplotlib.figure import Figure
from pyomo.mpec import Complementarity, complements

import pyomo_fesd

CREST, END, ELEMENTS, POINTS = 0.7, 2.0, 5, 2
SMOOTHING = 0.1
PICTURE = Path(__file__).parents[1] / '_static' / 'switch.svg'


def tank():
    """Volume V and outflow F of the tank, without the overflow condition."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, END))
    m.V = pyo.Var(m.t, initialize=0)
    m.F = pyo.Var(m.t, initialize=0, bounds=(0, None))
    m.dV = dae.DerivativeVar(m.V)
    m.V[0].fix(0)
    m.balance = pyo.Constraint(m.t, rule=lambda m, t: m.dV[t] == 1 - m.F[t])
    return m


def overflow(m, t):
    """The exact condition: outflow only at the crest."""
    return complements(m.F[t] >= 0, m.V[t] <= CREST)


def smoothed():
    """A smooth approximation of the condition (Fischer-Burmeister) on a fixed grid."""
    m = tank()
    m.overflow = pyo.Constraint(
        m.t,
        rule=lambda m, t: m.F[t] + CREST - m.V[t] == (m.F[t] ** 2 + (CREST - m.V[t]) ** 2 + 2 * SMOOTHING**2) ** 0.5,
    )
    pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=ELEMENTS, ncp=POINTS)
    pyo.SolverFactory('casadi_ipopt').solve(m)
    return m


def fixed():
    """The exact condition at every point of a fixed grid."""
    m = tank()
    pyo.TransformationFactory('dae.collocation').apply_to(m, nfe=ELEMENTS, ncp=POINTS)
    m.overflow = Complementarity(m.t, rule=overflow)
    pyo.SolverFactory('mpec_hybrid').solve(m)
    return m


def moving():
    """The exact condition on elements whose boundaries find the switch."""
    m = tank()
    m.overflow = Complementarity(m.t, rule=overflow)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=ELEMENTS, ncp=POINTS)
    pyo.SolverFactory('mpec_hybrid').solve(m)
    return m


def draw(cases):
    """One column a case: volume above outflow; element boundaries grey, exact solution dashed."""
    figure = Figure(figsize=(10, 4.6), layout='constrained')
    axes = figure.subplots(2, len(cases), sharex=True, sharey='row')
    for (title, m), (volume, outflow) in zip(cases.items(), axes.T):
        times = pyomo_fesd.physical_time(m)
        at = [times[t] for t in m.t]
        for axis in (volume, outflow):
            for t in m.t.get_finite_elements():
                axis.axvline(times[t], color='0.85', linewidth=1, zorder=0)
        volume.set_title(title, fontsize=11)
        volume.plot([0, CREST, END], [0, CREST, CREST], '--', color='0.4', linewidth=1)
        volume.plot(at, [m.V[t].value for t in m.t], 'o-', color='C0', markersize=4)
        outflow.plot([0, CREST, CREST, END], [0, 0, 1, 1], '--', color='0.4', linewidth=1)
        outflow.plot(at, [m.F[t].value for t in m.t], 'o-', color='C1', markersize=4, drawstyle='steps-pre')
        outflow.set_xlabel('time')
    axes[0, 0].set_ylabel('volume V')
    axes[1, 0].set_ylabel('outflow F')
    figure.savefig(PICTURE, metadata={'Date': None})


if __name__ == '__main__':
    draw(
        {
            'smooth approximation, fixed elements': smoothed(),
            'exact condition, fixed elements': fixed(),
            'exact condition, moving elements': moving(),
        }
    )
