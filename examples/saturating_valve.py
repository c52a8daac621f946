"""
Level control with a saturating valve
=====================================

A PI controller with anti-windup holds the level of a tank with a valve that saturates
fully open and fully closed. It starts far above the set point: the valve is fully
open, then follows the controller, is fully closed for a while, and follows again.
``clip`` writes the saturation with two nonsmooth terms (theory, eq. 8), and element
boundaries find the three times. The reference integrates the same equations between
events with scipy. ::

    dL/dt = q - k v,   v = clip(w, 0, 1),   w = v0 + K (L - L_set) + I
    dI/dt = K (L - L_set)/T_i + (v - w)/T_t

w is the demand of the controller and v the opening of the valve.

**Why the answer is right.** scipy integrates the same equations between located events,
by another method. The three times agree to 5e-7 and the final level to 1e-8. The
opening of the valve is within its limits at every collocation point, as ``clip`` is
exact and not smoothed.
"""

import pyomo.dae as dae
import pyomo.environ as pyo
from scipy.integrate import solve_ivp

import pyomo_fesd

HORIZON = 6.0
LEVEL_0, LEVEL_SET = 3.0, 1.0
INFLOW, CAPACITY = 1.0, 2.0  # q and k
OPENING_0, GAIN, T_I, T_T = 0.5, 2.0, 0.3, 1.0


def build():
    """Build tank, controller and valve."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, HORIZON))
    m.level = pyo.Var(m.t, initialize=LEVEL_0)
    m.integral = pyo.Var(m.t, initialize=0)
    m.dlevel, m.dintegral = dae.DerivativeVar(m.level), dae.DerivativeVar(m.integral)
    m.level[0].fix(LEVEL_0)
    m.integral[0].fix(0)

    @m.Expression(m.t)
    def asked(m, t):
        return OPENING_0 + GAIN * (m.level[t] - LEVEL_SET) + m.integral[t]

    @m.Block(m.t)
    def valve(b, t):
        b.opening = pyo.Expression(expr=pyomo_fesd.clip(b, b.model().asked[t], 0, 1))

    @m.Constraint(m.t)
    def balance(m, t):
        return m.dlevel[t] == INFLOW - CAPACITY * m.valve[t].opening

    @m.Constraint(m.t)
    def controller(m, t):
        return (
            m.dintegral[t]
            == GAIN * (m.level[t] - LEVEL_SET) / T_I
            + (m.valve[t].opening - m.asked[t]) / T_T
        )

    return m


def solve(nfe=60, ncp=3):
    """Discretise and solve; returns the model and the solver's results."""
    m = build()
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, wrt=m.t, nfe=nfe, ncp=ncp
    )
    return m, pyo.SolverFactory('mpec_hybrid').solve(m)


def changes(m):
    """Times at which the valve reaches or leaves a limit, each with its new state."""
    table, start = pyomo_fesd.trajectory(m), pyomo_fesd.element_lengths(m)['start']
    found, before = [], None
    for element, opening in table.groupby('element')['valve.opening']:
        inner = opening.iloc[:-1]  # the last point may belong to the next piece
        now = (
            'open'
            if inner.min() > 1 - 1e-9
            else 'closed'
            if inner.max() < 1e-9
            else 'follows'
        )
        if before not in (None, now):
            found.append((start[element], now))
        before = now
    return found


def _asked(t, y):
    return OPENING_0 + GAIN * (y[0] - LEVEL_SET) + y[1]


def _rates(t, y, opening):
    v = opening(_asked(t, y))
    return INFLOW - CAPACITY * v, GAIN * (y[0] - LEVEL_SET) / T_I + (
        v - _asked(t, y)
    ) / T_T


#: State of the valve -> (opening, [(limit that is crossed, direction, next state)])
MODES = {
    'open': (lambda asked: 1.0, [(1, -1, 'follows')]),
    'closed': (lambda asked: 0.0, [(0, 1, 'follows')]),
    'follows': (lambda asked: asked, [(1, 1, 'open'), (0, -1, 'closed')]),
}


def _event(limit, direction):
    def crossing(t, y, opening):
        return _asked(t, y) - limit

    crossing.terminal, crossing.direction = True, direction
    return crossing


def reference():
    """Integrate with scipy; returns the changes of the valve and the end state."""
    found, t, y, mode = [], 0.0, (LEVEL_0, 0.0), 'open'
    while t < HORIZON:
        opening, exits = MODES[mode]
        events = [_event(limit, direction) for limit, direction, _ in exits]
        piece = solve_ivp(
            _rates,
            (t, HORIZON),
            y,
            'DOP853',
            events=events,
            args=(opening,),
            rtol=1e-13,
            atol=1e-13,
        )
        t, y = piece.t[-1], piece.y[:, -1]
        if piece.status == 1:
            mode = next(
                then for times, (_, _, then) in zip(piece.t_events, exits) if len(times)
            )
            found.append((t, mode))
    return found, y


def main():
    """Solve, print when the valve saturates and the errors, draw."""
    m, _ = solve()
    exact, end = reference()
    for (time, now), (exact_time, _) in zip(changes(m), exact):
        print(
            f"t = {time:.8f}: the valve {'is ' if now != 'follows' else ''}{now}, "
            f"{time - exact_time:+.1e} off the reference"
        )
    print(
        f"The level ends at {m.level[HORIZON].value:.8f}, "
        f"{m.level[HORIZON].value - end[0]:+.1e} off the reference."
    )
    pyomo_fesd.plot(m, m.t, ['level', 'asked', 'valve.opening']).savefig(
        'saturating_valve.png', dpi=150
    )
    print("Picture: saturating_valve.png")


if __name__ == '__main__':
    main()
