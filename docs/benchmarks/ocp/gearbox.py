"""The time-optimal car with the gearbox that has hysteresis (examples/gearbox_car.py), on ten equal stages.

nosnoc states the hysteresis by time-freezing: an auxiliary state w is 0 in gear A and 1 in gear B, and while w changes, in two
auxiliary modes, the other states and the time t are constant.  Its control stages share the numerical time equally; a second
control s is the speed of time in each, so its stages may differ in length while ours are equal.
"""

import gearbox_car
import numpy as np

STAGES, ELEMENTS, NCP = 10, 3, 2
REFERENCE = gearbox_car.T_BEST
S_MIN, S_MAX, HORIZON = 0.1, 20.0, 5.0


def build(stages=STAGES):
    """The model with the given number of equal control stages, as a user writes it."""
    return gearbox_car.build(gearbox_car.equal_stages(stages))


def discretise(m, elements=ELEMENTS):
    """Apply both transformations, with ``elements`` elements in each control stage."""
    return gearbox_car.transform(m, elements)


def with_nosnoc(stages=STAGES, elements=ELEMENTS, ncp=NCP, scheme='RADAU', u=None, **settings):
    """The same car in nosnoc, by time-freezing."""
    import casadi as ca
    import nosnoc
    from benchmarks.ocp import nosnoc_peer

    q, v, w, t = (ca.SX.sym(name) for name in 'qvwt')
    u, s = ca.SX.sym('u'), ca.SX.sym('s')
    psi = (v - gearbox_car.DOWN) / (gearbox_car.UP - gearbox_car.DOWN)
    # regions are those nearest to four points in the plane of psi and w
    nearest = [ca.sumsqr(ca.vertcat(psi, w) - np.array(z)) for z in ((0.25, -0.25), (0.25, 0.25), (0.75, 0.75), (0.75, 1.25))]
    gear_A, gear_B = ca.vertcat(v, u, 0, 1), ca.vertcat(v, 3 * u, 0, 1)
    down, up = (ca.vertcat(0, 0, sign * 2 * z**2 / (1 + z**2), 0) for sign, z in ((-1, psi - 1), (1, psi)))
    modes = s * ca.horzcat(2 * gear_A - down, down, up, 2 * gear_B - up)
    model = nosnoc.NosnocModel(
        x=ca.vertcat(q, v, w, t), F=[modes], g_Stewart=[ca.vertcat(*nearest)], x0=np.zeros(4), u=ca.vertcat(u, s), t_var=t
    )
    ocp = nosnoc.NosnocOcp(
        lbu=np.array([-gearbox_car.U_MAX, S_MIN]),
        ubu=np.array([gearbox_car.U_MAX, S_MAX]),
        u_guess=np.array([1.0, 2.0]),
        lbx=np.array([-np.inf, 0, -1, 0]),
        ubx=np.array([np.inf, gearbox_car.V_MAX, 2, np.inf]),
        f_terminal=t,
        g_terminal=ca.vertcat(q - gearbox_car.DISTANCE, v),
    )
    return nosnoc_peer.solve(model, ocp, nosnoc_peer.options(HORIZON, stages, elements, ncp, scheme, **settings), None)
