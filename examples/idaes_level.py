"""
IDAES level control with a saturating valve
===========================================

An IDAES reactor whose level is held by a ``PIDController`` with a saturating valve.
IDAES bounds the output with ``smooth_bound``, which is off by up to eps/2 at a limit,
with a default eps = 1e-4 in the unit of the output: a fortieth of the capacity of
this valve. ``fesd.smooth_to_complementarity`` replaces it by two complementarity
pairs, without a parameter. From far above the set point the valve is open, follows
the controller, is closed for a while, and follows again; element boundaries find the
three times. The density is constant, so the level does not depend on the reaction,
and scipy integrates it separately between located events as a reference. ::

    mv = mid(0, mv_ref + K e + I, mv_ub),     e = setpoint - volume
    dI/dt = K_i e + K_b (mv - (mv_ref + K e + I))

**Why the answer is right.** scipy integrates the level between located events; times
and final volume are printed beside it. The flow is within its limits exactly. IDAES'
own smoothed flowsheet tends to this answer as its eps falls: the printed differences
shrink with it.
"""

from collections import namedtuple

import pyomo.environ as pyo
from idaes.models.control.controller import (
    ControllerAntiwindupType,
    ControllerMVBoundType,
    ControllerType,
    PIDController,
)
from idaes_overflow import INFLOW, initialise, plant, settle_reactor
from matplotlib.figure import Figure
from pyomo.dae.flatten import flatten_dae_components
from scipy.integrate import solve_ivp

import pyomo_fesd
from pyomo_fesd.units import saturation, scale_by_values

END = 600.0  # s
START, SETPOINT = 1.2, 0.8  # m3
CONTENTS = {
    'NaOH': 1.0,
    'EthylAcetate': 1.0,
    'SodiumAcetate': 49.0,
    'Ethanol': 49.0,
}  # mol/m3, of a reactor in operation
OPEN = 4e-3  # m3/s, through the valve when it is fully open
GAIN, INTEGRAL, BACK = -0.02, -1e-3, 0.01  # 1/s, 1/s2, 1/s
VOLUME = 'fs.cstr.control_volume.volume'
FLOW = 'fs.cstr.control_volume.properties_out.flow_vol'
ASKED = 'fs.pid.mv_unbounded'
PICTURE = 'idaes_level.png'
Change = namedtuple('Change', 'time now')


def build(bounds=ControllerMVBoundType.SMOOTH_BOUND, times=(0, END)):
    """Build mixer, reactor and controller; ``times`` may hold element boundaries."""
    m = plant(times)
    m.fs.pid = PIDController(
        process_var=m.fs.cstr.volume,
        manipulated_var=m.fs.cstr.outlet.flow_vol,
        controller_type=ControllerType.PI,
        mv_bound_type=bounds,
        antiwindup_type=ControllerAntiwindupType.BACK_CALCULATION,
        calculate_initial_integral=False,
    )
    m.fs.pid.mv_lb.set_value(0)
    m.fs.pid.mv_ub.set_value(OPEN)
    return m


def exact(m):
    """Replace the smooth bound by two complementarity pairs."""
    pyo.TransformationFactory('fesd.smooth_to_complementarity').apply_to(m.fs)
    return m


def exact_by_hand(m):
    """Replace the bound by hand: one variable and no equation."""
    pid = m.fs.pid
    # deleted, since pyomo.dae activates a deactivated Constraint at new times
    pid.del_component(pid.mv_eqn)
    m.fs.valve = saturation(
        m.fs.time,
        command=pid.mv_unbounded,
        output=m.fs.cstr.outlet.flow_vol,
        low=0,
        high=OPEN,
    )
    return m


def move(m, nfe, ncp):
    """Make the elements movable; name the inputs that are known to be constant."""
    pid = m.fs.pid
    inputs = [pid.setpoint, pid.gain_p, pid.gain_i, pid.gain_b, pid.mv_ref]
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m.fs, wrt=m.fs.time, nfe=nfe, ncp=ncp, continuous=inputs
    )
    return m


def specify(m):
    """Fix inputs and initial values of the discretised model and initialise it."""
    pid, start = m.fs.pid, m.fs.time.first()
    for parameter, number in (
        (pid.setpoint, SETPOINT),
        (pid.gain_p, GAIN),
        (pid.gain_i, INTEGRAL),
        (pid.gain_b, BACK),
        (pid.mv_ref, INFLOW),
    ):
        parameter.fix(number)
    initialise(m)
    for t in m.fs.time:
        m.fs.cstr.volume[t].set_value(START + (SETPOINT - START) * min(1.0, t / 250))
    m.fs.cstr.volume[start].fix(START)
    for solute, concentration in CONTENTS.items():
        m.fs.cstr.outlet.conc_mol_comp[start, solute].fix(concentration)
    settle_reactor(m.fs.cstr)
    pid.mv_integral_component[start].fix(0)
    scale_by_values(m)
    return m


def solve(m, **options):
    """Simulate, then solve all elements at once; returns the solver's results."""
    pyomo_fesd.simulate(m.fs)
    results = pyo.SolverFactory('mpec_hybrid').solve(m, warm_start=True, **options)
    pyo.assert_optimal_termination(results)
    return results


def moving_grid(nfe=20, ncp=3, how=exact):
    """Solve the exact controller; returns the model and the solver's results."""
    m = specify(move(how(build()), nfe, ncp))
    return m, solve(m)


def smooth(eps, known, ncp=3):
    """Solve IDAES' smooth controller on the elements of a solved model."""
    grid = boundaries(known)
    m = build(times=grid)
    m.fs.pid.smooth_eps.set_value(eps)
    pyo.TransformationFactory('dae.collocation').apply_to(
        m.fs, wrt=m.fs.time, nfe=len(grid) - 1, ncp=ncp
    )
    specify(m)
    values = {name: [data.value for data in v.values()] for name, v in over_time(known)}
    for name, v in over_time(m):
        for data, value in zip(v.values(), values[name]):
            if not data.fixed:
                data.set_value(value)
    pyo.assert_optimal_termination(pyo.SolverFactory('mpec_hybrid').solve(m))
    return m


def over_time(m):
    """Pairs (name, variable over time) of all variables of the flowsheet."""
    _, variables = flatten_dae_components(m.fs, m.fs.time, pyo.Var)
    return [(str(pyo.ComponentUID(v.referent)), v) for v in variables]


def boundaries(m):
    """Element boundaries (s), rounded to the resolution 1e-6 s of the labels."""
    return [*pyomo_fesd.element_lengths(m, m.fs.time)['start'].round(6), END]


def changes(m):
    """Times at which the valve reaches or leaves a limit."""
    return changes_in(pyomo_fesd.trajectory(m, m.fs.time))


def changes_in(table):
    """The same in a trajectory."""
    found, before, start = [], None, table.index[0]
    for _, flow in table.groupby('element')[FLOW]:
        inner = flow.iloc[:-1]  # the last point may belong to the next piece
        now = (
            'open'
            if inner.min() > OPEN * (1 - 1e-6)
            else 'closed'
            if inner.max() < OPEN * 1e-6
            else 'follows'
        )
        if before not in (None, now):
            found.append(Change(start, now))
        before, start = now, flow.index[-1]
    return found


def _asked(y):
    return INFLOW + GAIN * (SETPOINT - y[0]) + y[1]


def _rates(t, y, valve):
    flow = valve(_asked(y))
    return INFLOW - flow, INTEGRAL * (SETPOINT - y[0]) + BACK * (flow - _asked(y))


#: State of the valve -> (flow, [(limit that is crossed, direction, next state)])
MODES = {
    'open': (lambda asked: OPEN, [(OPEN, -1, 'follows')]),
    'closed': (lambda asked: 0.0, [(0.0, 1, 'follows')]),
    'follows': (lambda asked: asked, [(OPEN, 1, 'open'), (0.0, -1, 'closed')]),
}


def _event(limit, direction):
    def crossing(t, y, valve):
        return (_asked(y) - limit) / OPEN

    crossing.terminal, crossing.direction = True, direction
    return crossing


def reference():
    """Integrate the level with scipy; returns the changes and the final volume (m3)."""
    found, t, y, now = [], 0.0, (START, 0.0), 'open'
    while t < END:
        valve, exits = MODES[now]
        events = [_event(limit, direction) for limit, direction, _ in exits]
        piece = solve_ivp(
            _rates,
            (t, END),
            y,
            'DOP853',
            events=events,
            args=(valve,),
            rtol=1e-13,
            atol=1e-15,
        )
        t, y = piece.t[-1], piece.y[:, -1]
        if piece.status == 1:
            now = next(
                then for times, (_, _, then) in zip(piece.t_events, exits) if len(times)
            )
            found.append(Change(t, now))
    return found, y[0]


def largest_difference(m, rounded):
    """Largest difference of the volumes (m3) of two models on the same elements."""
    values = zip(m.fs.cstr.volume.values(), rounded.fs.cstr.volume.values())
    return max(abs(a.value - b.value) for a, b in values)


def draw(m, rounded):
    """Draw volume, flow and demand; the smooth controller is dashed."""
    table, other = (
        pyomo_fesd.trajectory(model, model.fs.time) for model in (m, rounded)
    )
    figure = Figure(figsize=(7, 6), layout='constrained')
    level, flow = axes = figure.subplots(2, 1, sharex=True)
    level.plot(table[VOLUME], label='exact')
    level.plot(other[VOLUME], 'k--', linewidth=0.8, label='smooth, eps = 1e-3')
    level.axhline(SETPOINT, color='0.6', linewidth=0.6)
    level.set_ylabel('volume (m³)')
    level.legend()
    flow.plot(1e3 * table[FLOW], label='valve')
    flow.plot(1e3 * table[ASKED], ':', label='asked')
    flow.plot(1e3 * other[FLOW], 'k--', linewidth=0.8)
    flow.set_ylim(-2, 7)
    flow.set_ylabel('flow (L/s)')
    flow.set_xlabel('time (s)')
    flow.legend()
    for axis in axes:
        for change in changes(m):
            axis.axvline(change.time, color='grey', linestyle=':')
    figure.savefig(PICTURE, dpi=150)


def main():
    """Solve, compare with scipy and with decreasing smoothing, draw."""
    m, results = moving_grid()
    known, end = reference()
    print(f'mpec_hybrid: {results.solver.reason}.')
    for change, exact_change in zip(changes(m), known):
        now = change.now if change.now == 'follows' else f'is {change.now}'
        print(
            f'From {change.time:.6f} s on the valve {now}, '
            f'{change.time - exact_change.time:+.1e} s off the reference.'
        )
    table = pyomo_fesd.trajectory(m, m.fs.time)
    print(
        f'The flow stays within [{table[FLOW].min():.1e}, {table[FLOW].max():.9f}] '
        'm3/s.'
    )
    print(
        f'The volume ends at {table[VOLUME].iloc[-1]:.9f} m3, '
        f'{table[VOLUME].iloc[-1] - end:+.1e} off.'
    )
    rounded = {eps: smooth(eps, m) for eps in (1e-3, 1e-4, 1e-5)}
    for eps, model in rounded.items():
        print(
            f'With smooth_eps = {eps:.0e} m3/s the volume differs by up to '
            f'{largest_difference(m, model):.1e} m3.'
        )
    draw(m, rounded[1e-3])
    print(f'Volume and flow over time: {PICTURE}')


if __name__ == '__main__':
    main()
