"""The time-optimal car with the gearbox that has hysteresis (examples/gearbox_car.py), on ten equal stages.

nosnoc states the hysteresis by time-freezing: an auxiliary state w is 0 in gear A and 1 in gear B, and while w changes, in two
auxiliary modes, the other states and the time t are constant.  Its control stages share the numerical time equally; a second
control s is the speed of time in each, so its stages may differ in length while ours are equal.  Its controls are replayed in the
physical time t.
"""

from functools import partial

import gearbox_car
import numpy as np
from benchmarks.ocp import automaton

STAGES, ELEMENTS, NCP = 10, 3, 2
REFERENCE = gearbox_car.T_BEST
S_MIN, S_START, S_MAX, HORIZON = 0.1, 2.0, 20.0, 5.0
U_RANGE, CONTROLS = (-gearbox_car.U_MAX, gearbox_car.U_MAX), 1


def build(stages=STAGES):
    """The model with the given number of equal control stages, as a user writes it."""
    return gearbox_car.build(gearbox_car.equal_stages(stages))


def discretise(m, elements=ELEMENTS):
    """Apply both transformations, with ``elements`` elements in each control stage."""
    return gearbox_car.transform(m, elements)


#: For the replay: the modes of the state (q, v) by gear.
GEARS = {
    'A': automaton.Mode(lambda x, u: (x[1], u[0]), ((lambda x, u: gearbox_car.UP - x[1], 'B'),)),
    'B': automaton.Mode(lambda x, u: (x[1], 3 * u[0]), ((lambda x, u: x[1] - gearbox_car.DOWN, 'A'),)),
}
replay_controls = partial(automaton.replay, GEARS, lambda x, u: 1.0, (0.0, 0.0), 'A')


def missed(x):
    """The larger one of the final distance to the goal, in m, and the final velocity, in m/s."""
    return float(np.abs(x - (gearbox_car.DISTANCE, 0)).max())


def with_nosnoc(stages=STAGES, elements=ELEMENTS, ncp=NCP, scheme='RADAU', u=None, **settings):
    """The same car in nosnoc, by time-freezing."""
    import casadi as ca
    import nosnoc
    from benchmarks.ocp import nosnoc_peer

    q, v, w, t = (ca.SX.sym(name) for name in 'qvwt')
    c, s = ca.SX.sym('u'), ca.SX.sym('s')
    psi = (v - gearbox_car.DOWN) / (gearbox_car.UP - gearbox_car.DOWN)
    # regions are those nearest to four points in the plane of psi and w
    nearest = [ca.sumsqr(ca.vertcat(psi, w) - np.array(z)) for z in ((0.25, -0.25), (0.25, 0.25), (0.75, 0.75), (0.75, 1.25))]
    gear_A, gear_B = ca.vertcat(v, c, 0, 1), ca.vertcat(v, 3 * c, 0, 1)
    down, up = (ca.vertcat(0, 0, sign * 2 * z**2 / (1 + z**2), 0) for sign, z in ((-1, psi - 1), (1, psi)))
    modes = s * ca.horzcat(2 * gear_A - down, down, up, 2 * gear_B - up)
    model = nosnoc.NosnocModel(
        x=ca.vertcat(q, v, w, t), F=[modes], g_Stewart=[ca.vertcat(*nearest)], x0=np.zeros(4), u=ca.vertcat(c, s), t_var=t
    )
    ocp = nosnoc.NosnocOcp(
        lbu=np.array([-gearbox_car.U_MAX, S_MIN]),
        ubu=np.array([gearbox_car.U_MAX, S_MAX]),
        u_guess=np.array([1.0, S_START]),
        lbx=np.array([-np.inf, 0, -1, 0]),
        ubx=np.array([np.inf, gearbox_car.V_MAX, 2, np.inf]),
        f_terminal=t,
        g_terminal=ca.vertcat(q - gearbox_car.DISTANCE, v),
    )
    given = None if u is None else np.column_stack([u, np.full(stages, S_START)])
    found = nosnoc_peer.solve(model, ocp, nosnoc_peer.options(HORIZON, stages, elements, ncp, scheme, **settings), given)
    ends = np.array(found['x'])[elements - 1 :: elements, 3]
    return found | {'u': found['u'][:, :1], 'lengths': np.diff(ends, prepend=0)}
