"""A neutral description of a switching system, from which the models of all methods are built.

    dx/dt = f(x, u) + sum_k sum_i nu_ki F_ki(x, u)

Each part k has switching functions c(x) and modes, sign patterns of c with a rate F.  ``f`` in the signatures is the module with
the functions ``sin``, ``exp``, ...: ``pyomo.environ`` or ``casadi``.  Time is a state where a system depends on it.
"""

from dataclasses import dataclass, field

import pyomo.dae as dae
import pyomo.environ as pyo
from pyomo.gdp import Disjunction

import pyomo_fesd  # noqa: F401, registers the transformations


@dataclass(frozen=True)
class Part:
    """Switching functions and modes.

    Attributes
    ----------
    c : function (x, f) -> list
    modes : list of (signs, rates)
        a sign pattern of c with entries 1 and -1, and a function (x, u, f) -> list with one rate for each state
    """

    c: object
    modes: list


@dataclass(frozen=True)
class System:
    """A switching system, its data and its known answer.

    Attributes
    ----------
    x0 : tuple
        states at time 0
    end : float
    parts : list of Part
    answer : tuple
        states at ``end``, None for those that are not compared
    scale : tuple or None
        divisors of the errors of the states; None: the larger of 1 and the answer
    smooth : function (x, u, f) -> list, or None
        the common part of all modes
    stages : list
        inner boundaries of control stages
    u : tuple (least, most, guess) or None
        a control, constant on each stage
    final : function (x, f) -> expression
        the objective, of the states at the end; an integral is a state
    target : function (x, f) -> list of expressions that are 0 at the end
    free : tuple (least, most) or None
        bounds of the first state at time 0, if it is free; x0 is its initial value
    value : float or None
        value of the objective
    guess : tuple or None
        initial values of the states at all times; None: x0
    """

    x0: tuple
    end: float
    parts: list
    answer: tuple = ()
    scale: tuple = None
    smooth: object = None
    stages: list = field(default_factory=list)
    u: tuple = None
    final: object = None
    target: object = None
    free: tuple = None
    value: float = None
    guess: tuple = None


def one(c, positive, negative, **keywords):
    """Parts of a system with one switching function and a mode on each side of it."""
    return [Part(lambda x, f: [c(x, f)], [((1,), positive), ((-1,), negative)], **keywords)]


def model(system, discretise=None):
    """The Pyomo model, with a Disjunction over time for each part.

    ``discretise`` puts the model on a fixed grid before the Disjunctions are added, because pyomo.dae cannot discretise them.
    """
    m = _states(system)
    if discretise:
        discretise(m)
    for k, part in enumerate(system.parts):
        m.add_component(f'part{k}', Disjunction(m.t, rule=lambda m, t, k=k, part=part: list(_modes(m, t, k, part, system))))
    return m


def smoothed(system, width):
    """The Pyomo model with (1 + tanh(c/width))/2 for the step of each switching function; ``width`` relative to c at time 0."""
    m = _states(system)
    starts = [max(1e-12, *(abs(float(c)) for c in part.c(system.x0, pyo))) for part in system.parts]
    starts = [w if w > 1e-6 or _start_is_small(system) else 1.0 for w in starts]

    def rate(m, t, i, k):
        part, x, u = system.parts[k], _x(m, t), _u(m, t)
        steps = [(1 + pyo.tanh(c / (width * starts[k]))) / 2 for c in part.c(x, pyo)]
        total = 0
        for signs, rates in part.modes:
            weight = 1
            for sign, step in zip(signs, steps):
                weight = weight * (step if sign > 0 else 1 - step)
            total = total + weight * rates(x, u, pyo)[i]
        return total

    if len(system.parts) == 1:
        m.ode = pyo.Constraint(m.t, m.i, rule=lambda m, t, i: m.dx[t, i] == _shared(m, t, i, system) + rate(m, t, i, 0))
    else:
        m.ode = pyo.Constraint(m.t, m.k, m.i, rule=lambda m, t, k, i: m.v[t, k, i] == rate(m, t, i, k))
    return m


def _start_is_small(system):
    return max(map(abs, system.x0)) < 1e-6


def _states(system):
    """States, controls and objective, without the modes."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(initialize=[0, *system.stages, system.end])
    m.i = pyo.RangeSet(0, len(system.x0) - 1)
    begin = system.guess or system.x0
    m.x = pyo.Var(m.t, m.i, initialize=lambda m, t, i: begin[i])
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    for i in m.i:
        m.x[0, i].fix(system.x0[i])
    if system.free:
        m.x[0, 0].unfix()
        m.x[0, 0].setlb(system.free[0])
        m.x[0, 0].setub(system.free[1])
    if system.u:
        m.u = pyo.Var(m.t, bounds=system.u[:2], initialize=system.u[2])
    if len(system.parts) > 1:
        m.k = pyo.RangeSet(0, len(system.parts) - 1)
        m.v = pyo.Var(m.t, m.k, m.i, initialize=0)
        m.sum = pyo.Constraint(
            m.t, m.i, rule=lambda m, t, i: m.dx[t, i] == _shared(m, t, i, system) + sum(m.v[t, k, i] for k in m.k)
        )
    _add_objective(m, system)
    return m


def _add_objective(m, system):
    last = m.t.last()
    if system.target:
        targets = system.target(_x(m, last), pyo)
        m.target = pyo.Constraint(range(len(targets)), rule=lambda m, i: targets[i] == 0)
    if system.final:
        m.objective = pyo.Objective(expr=system.final(_x(m, last), pyo))


def _modes(m, t, k, part, system):
    """Yield the disjuncts of one part: region and rates."""
    x, u = _x(m, t), _u(m, t)
    functions = part.c(x, pyo)
    for signs, rates in part.modes:
        region = [c >= 0 if sign > 0 else c <= 0 for c, sign in zip(functions, signs)]
        found = rates(x, u, pyo)
        if len(system.parts) == 1:
            yield region + [m.dx[t, i] == _shared(m, t, i, system) + found[i] for i in m.i]
        else:
            yield region + [m.v[t, k, i] == found[i] for i in m.i]


def _shared(m, t, i, system):
    return system.smooth(_x(m, t), _u(m, t), pyo)[i] if system.smooth else 0


def _x(m, t):
    return [m.x[t, i] for i in m.i]


def _u(m, t):
    return m.u[t] if m.component('u') is not None else 0.0


def moving_grid(m, system, nfe, ncp, scheme):
    """Apply ``fesd.dcs`` and ``fesd.finite_elements``."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m)
    controls = [m.u] if system.u else []
    pyo.TransformationFactory('fesd.finite_elements').apply_to(
        m, wrt=m.t, nfe=nfe, ncp=ncp, scheme=scheme, piecewise_constant=controls
    )


def fixed_grid(system, nfe, ncp):
    """A function that puts a model without modes on the grid of pyomo.dae."""

    def discretise(m):
        pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=nfe, ncp=ncp, scheme='LAGRANGE-RADAU')
        if system.u:
            # one value on each control stage, as on the moving grid, instead of one on each element
            stages = [0, *system.stages, system.end]
            m.held = pyo.Constraint(m.t, rule=lambda m, t: _held(m, t, stages))

    return discretise


def _held(m, t, stages):
    end = next(b for b in stages[1:] if t <= b + 1e-9)
    own = min(m.t, key=lambda s: abs(s - end))
    return pyo.Constraint.Skip if own == t else m.u[t] == m.u[own]


def end_state(m):
    """Values of the states at the last time."""
    return [m.x[m.t.last(), i].value for i in m.i]
