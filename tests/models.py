"""Small models with known dynamics, shared by the tests, and a few ways to look at a model.

Rules ask their component for the model (``d.model()``), so that clones can be discretised too.
"""

import itertools
import random
import re

import pyomo.environ as pyo
from pyomo import dae
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

import pyomo_fesd  # noqa: F401  registers the transformations
from pyomo_fesd.core.complementarity import read_complementarity

EVERYWHERE = (pyo.Block, Disjunct)


# Models


def scalar_ode(x0=-2.0, end=2.0, discretised=False):
    """x over time, its derivative dx, and a second state y with dy; no dynamics yet."""
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, end))
    m.x = pyo.Var(m.t, initialize=x0)
    m.y = pyo.Var(m.t, initialize=1.0)
    m.dx = dae.DerivativeVar(m.x)
    m.dy = dae.DerivativeVar(m.y)
    m.x[0].fix(x0)
    if discretised:
        collocate(m)
    return m


def add_modes(m, *modes, name='sgn'):
    """Declare a Disjunction over time whose modes are lists of expressions, ``mode(m, t) -> [...]``."""
    m.add_component(name, Disjunction(m.t, rule=lambda m, t: [list(mode(m, t)) for mode in modes]))
    return m


def below(m, t):
    """x <= 0, dx = 3."""
    return [m.x[t] <= 0, m.dx[t] == 3]


def above(m, t):
    """x >= 0, dx = 1."""
    return [m.x[t] >= 0, m.dx[t] == 1]


def signum(x0=-2.0, discretised=False):
    """dx = 2 - sgn(x), with named Disjuncts over time."""
    m = scalar_ode(x0, discretised=discretised)

    @m.Disjunct(m.t)
    def below(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.x[t] <= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == 3)

    @m.Disjunct(m.t)
    def above(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.x[t] >= 0)
        d.ode = pyo.Constraint(expr=m.dx[t] == 1)

    @m.Disjunction(m.t)
    def sgn(m, t):
        return [m.below[t], m.above[t]]

    return m


def signum_of_lists(x0=-2.0, discretised=False):
    """The same, the modes as lists of expressions."""
    return add_modes(scalar_ode(x0, discretised=discretised), below, above)


def signum_of_scalars(x0=-2.0, discretised=False):
    """The same, with scalar Disjuncts inside a Block over time."""
    m = scalar_ode(x0, discretised=discretised)

    @m.Block(m.t)
    def hyb(b, t):
        m = b.model()
        b.below, b.above = Disjunct(), Disjunct()
        b.below.region = pyo.Constraint(expr=m.x[t] <= 0)
        b.below.ode = pyo.Constraint(expr=m.dx[t] == 3)
        b.above.region = pyo.Constraint(expr=m.x[t] >= 0)
        b.above.ode = pyo.Constraint(expr=m.dx[t] == 1)
        b.sgn = Disjunction(expr=[b.below, b.above])

    return m


def units(discretised=False, where='block'):
    """Two units 'a' and 'b', dx = 3 or 1 below and above level 0 or 1.

    The modes stand in ``m.unit[i].hyb[t].dj`` ('block'), or in Disjuncts over ``(m.t, m.i)`` and a Disjunction over
    ``(m.i, m.t)`` ('index').
    """
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 2))
    m.i = pyo.Set(initialize=['a', 'b'])
    m.x = pyo.Var(m.i, m.t, initialize=-2.0)
    m.dx = dae.DerivativeVar(m.x, wrt=m.t)
    level = {'a': 0.0, 'b': 1.0}
    if discretised:
        collocate(m)
    if where == 'index':

        @m.Disjunct(m.t, m.i)
        def below(d, t, i):
            m = d.model()
            d.region = pyo.Constraint(expr=m.x[i, t] <= level[i])
            d.ode = pyo.Constraint(expr=m.dx[i, t] == 3)

        @m.Disjunct(m.t, m.i)
        def above(d, t, i):
            m = d.model()
            d.region = pyo.Constraint(expr=m.x[i, t] >= level[i])
            d.ode = pyo.Constraint(expr=m.dx[i, t] == 1)

        @m.Disjunction(m.i, m.t)
        def sgn(m, i, t):
            return [m.below[t, i], m.above[t, i]]

        return m

    @m.Block(m.i)
    def unit(b, i):
        @b.Block(m.t)
        def hyb(b, t):
            m = b.model()
            b.dj = Disjunction(
                expr=[
                    [m.x[i, t] <= level[i], m.dx[i, t] == 3],
                    [m.x[i, t] >= level[i], m.dx[i, t] == 1],
                ]
            )

    return m


def units_by_index(discretised=False):
    """``units`` with the unit as a further index of Disjuncts and Disjunction."""
    return units(discretised, where='index')


def tank(discretised=False):
    """A liquid holdup M fed by 2; the outlet flows L and G are algebraic, only one of them at a time.

    full (M >= 5): L = M/10, G = 0;   empty (M <= 5): L = 0, G = M/5.
    """
    m = pyo.ConcreteModel()
    m.t = dae.ContinuousSet(bounds=(0, 4))
    m.M = pyo.Var(m.t, initialize=8.0)
    m.L, m.G = pyo.Var(m.t, initialize=1.0), pyo.Var(m.t, initialize=1.0)
    m.dM = dae.DerivativeVar(m.M)
    m.M[0].fix(8.0)
    if discretised:
        collocate(m)

    @m.Constraint(m.t)
    def balance(m, t):
        return m.dM[t] == 2 - m.L[t] - m.G[t]

    @m.Disjunct(m.t)
    def full(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.M[t] >= 5)
        d.first = pyo.Constraint(expr=m.L[t] == 0.1 * m.M[t])
        d.second = pyo.Constraint(expr=m.G[t] == 0)

    @m.Disjunct(m.t)
    def empty(d, t):
        m = d.model()
        d.region = pyo.Constraint(expr=m.M[t] <= 5)
        d.first = pyo.Constraint(expr=m.G[t] == 0.2 * m.M[t])
        d.second = pyo.Constraint(expr=m.L[t] == 0)

    @m.Disjunction(m.t)
    def outlet(m, t):
        return [m.full[t], m.empty[t]]

    return m


def thresholds(discretised=False, low=0.0, high=1.0):
    """Three ordered modes: dx = 3 for x <= low, 2 between (a ranged inequality), 1 for x >= high."""
    m = scalar_ode(discretised=discretised)
    return add_modes(
        m,
        lambda m, t: [m.x[t] <= low, m.dx[t] == 3],
        lambda m, t: [pyo.inequality(low, m.x[t], high), m.dx[t] == 2],
        lambda m, t: [m.x[t] >= high, m.dx[t] == 1],
        name='level',
    )


def quadrants(discretised=False):
    """Three modes in the plane: 'left' does not say which sign y has; dx = 0 there, dx = 1 and 2 on the right."""
    m = scalar_ode(discretised=discretised)
    return add_modes(
        m,
        lambda m, t: [m.x[t] <= 0, m.dx[t] == 0],
        lambda m, t: [m.x[t] >= 0, m.y[t] >= 0, m.dx[t] == 1],
        lambda m, t: [m.x[t] >= 0, m.y[t] <= 0, m.dx[t] == 2],
        name='corner',
    )


# Transformations


def collocate(m, nfe=2, ncp=2):
    """pyomo.dae's own Radau collocation."""
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.t, nfe=nfe, ncp=ncp, scheme='LAGRANGE-RADAU')
    return m


def dcs(m, **keywords):
    """Apply fesd.dcs in place."""
    pyo.TransformationFactory('fesd.dcs').apply_to(m, **keywords)
    return m


def finite_elements(m, nfe=2, ncp=2, **keywords):
    """Apply fesd.finite_elements in place."""
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, wrt=m.t, nfe=nfe, ncp=ncp, **keywords)
    return m


# Looking at a model


#: A decimal number in the text of an expression.
NUMBER = re.compile(r'\d+\.\d+(e[-+]?\d+)?')


def _text(expr):
    # the coefficients of pyomo.dae and of fesd.finite_elements differ in their last digits
    rounded = NUMBER.sub(lambda number: f'{float(number[0]):.10g}', str(expr))
    return re.sub(r'(?<![\d.])1\*', '', rounded)


def snapshot(m):
    """Everything that a user can see of a model: names, active flags, values, what is fixed, expressions."""
    seen = {'points': list(m.t) if m.component('t') is not None else None}
    for block in m.block_data_objects(descend_into=EVERYWHERE):
        seen[block.name, 'components'] = {(c.name, c.ctype, c.active) for c in block.component_objects(descend_into=False)}
    for data in m.component_data_objects(descend_into=EVERYWHERE):
        seen[data.name] = getattr(data, 'active', None)
        if data.ctype in (pyo.Var, pyo.BooleanVar, dae.DerivativeVar):
            seen[data.name] = (data.value, data.fixed, data.stale)
        elif data.ctype is pyo.Constraint:
            seen[data.name] = (data.active, _text(data.expr))
    return seen


def disjunctions(m):
    """All DisjunctionData of a model, active or not."""
    return list(m.component_data_objects(Disjunction, descend_into=pyo.Block))


def generated(m, ctype):
    """The components of one type that fesd.dcs has generated, by name."""
    return {c.name: c for c in m.component_data_objects(ctype, descend_into=pyo.Block) if '_pyomo_fesd_dcs.' in c.name}


def residual(constraint):
    """body - upper of an equation at the present values."""
    return pyo.value(constraint.body) - pyo.value(constraint.upper)


def values_of_generated(m):
    """Residuals and complementarity arguments that fesd.dcs generated, at variable values that depend on their names only."""
    for v in m.component_data_objects(pyo.Var, descend_into=EVERYWHERE):
        v.set_value(random.Random(v.name).uniform(0.5, 1.5), skip_validation=True)
    values = {name: residual(c) for name, c in generated(m, pyo.Constraint).items()}
    for name, condition in generated(m, Complementarity).items():
        values[name, 'G'], values[name, 'H'] = (pyo.value(side) for side in read_complementarity(condition))
    return values


def solution(constraint, v):
    """The value of ``v`` that satisfies an equation linear in it, the other variables at their present values."""
    kept = v.value
    v.set_value(0.0, skip_validation=True)
    at_0 = residual(constraint)
    v.set_value(1.0, skip_validation=True)
    factor = residual(constraint) - at_0
    v.set_value(-at_0 / factor, skip_validation=True)
    # once more from there: the factor is inexact where the equation has large terms
    answer = v.value - residual(constraint) / factor
    v.set_value(kept, skip_validation=True)
    return answer


# The conditions of a transformed Disjunction, solved for its multipliers


def form_of(disjunction):
    """The block that holds the form of a transformed DisjunctionData, and the index in it as a tuple."""
    index = disjunction.index()
    block = next(d.transformation_block for d in disjunction.disjuncts if d.transformation_block is not None)
    return block, () if index is None else index if isinstance(index, tuple) else (index,)


def step_keys(block, index):
    """The index of each step variable of the Heaviside form at one time; a single one has no number."""
    return [(*index, k) for k in block.functions] if len(block.functions) > 1 else [index or None]


def corners(disjunction):
    """The corners of the set that the jumping multipliers range over: a list of {variable: value}."""
    block, index = form_of(disjunction)
    if block.component('alpha') is not None:
        alpha = [block.alpha[key] for key in step_keys(block, index)]
        return [ComponentMap(zip(alpha, bits)) for bits in itertools.product((1.0, 0.0), repeat=len(alpha))]
    return [ComponentMap((block.nu[(*index, k)], float(k == on)) for k in block.regions) for on in block.regions]


def put_on(disjunction, number):
    """Set the multipliers as eq. (3), (5) or (6) ask at the present states, the jumping ones at corner ``number`` (from 1)."""
    for v, value in corners(disjunction)[number - 1].items():
        v.value = value
    block, index = form_of(disjunction)
    now = index or None
    if block.component('mu') is None:
        for key in step_keys(block, index):
            block.n[key].value = 0
            c = solution(block.switching[key], block.p[key])
            block.p[key].value, block.n[key].value = max(c, 0), max(-c, 0)
        return
    block.mu[now].value = 0
    g = {k: solution(block.stationarity[(*index, k)], block.lam[(*index, k)]) for k in block.regions}
    block.mu[now].value = min(g.values())
    for k in block.regions:
        block.lam[(*index, k)].value = g[k] - min(g.values())


def turn_on(disjunction, disjunct):
    """Put the multipliers at a corner at which ``disjunct`` alone is on; some corners of eq. (6) belong to no state."""
    for number in range(1, 1 + len(corners(disjunction))):
        put_on(disjunction, number)
        on = [d for d, weight in weights(disjunction).items() if pyo.value(weight) == 1]
        if len(on) == 1 and on[0] is disjunct:
            return
    raise AssertionError(f'{disjunct.name} is never on alone')


def weights(disjunction):
    """The multiplier of each disjunct."""
    return pyo.TransformationFactory('fesd.dcs').get_multipliers(disjunction)


def violation(disjunction):
    """Largest violation of a form's equations (without the mode equations) and pairs at the present values."""
    block, index = form_of(disjunction)
    found = []
    for name in ('switching', 'stationarity', 'simplex'):
        for key, con in (block.component(name) or {}).items():
            if _starts(key, index):
                found.append(abs(residual(con)))
    for key, condition in block.complementarity.items():
        if _starts(key, index):
            G, H = map(pyo.value, read_complementarity(condition))
            found.append(max(-G, -H, min(G, H)))
    return max(found)


def _starts(key, index):
    key = key if isinstance(key, tuple) else (key,)
    return not index or key[: len(index)] == index


def modes_on(disjunction, tolerance=1e-7):
    """The disjuncts whose multiplier may be 1 at the present states; the multipliers are left at the last of them."""
    allowed, on = None, ComponentSet()
    for number in range(1, 1 + len(corners(disjunction))):
        put_on(disjunction, number)
        if violation(disjunction) <= tolerance:
            allowed = number
            on.update(d for d, weight in weights(disjunction).items() if pyo.value(weight) == 1)
    if allowed:
        put_on(disjunction, allowed)
    return [d for d in disjunction.disjuncts if d in on]


def rate(disjunction, v):
    """The value that the mode equations of a transformed DisjunctionData give ``v`` at the present values."""
    block, index = form_of(disjunction)
    (con,) = [
        con
        for key, con in block.mode.items()
        if _starts(key, index) and any(w is v for w in identify_variables(con.body, include_fixed=True))
    ]
    return solution(con, v)


# Random systems in the plane


def planar(functions, modes, x0=1.0, y0=1.0):
    """A switching system in the (x, y) plane with affine switching functions.

    Parameters
    ----------
    functions : list of (a, b, c)
        switching functions a*x + b*y + c
    modes : list of dict
        ``signs`` (one of +1, -1, 0 for each function; 0 leaves it open), ``rates`` ((r, s): dx = r + s*y, dy = s - r*x),
        ``factors`` (one positive number for each inequality), ``writing`` (number of a writing of inequality and equation)
    """
    m = scalar_ode(x0)
    m.x[0].unfix()
    m.y[...].set_value(y0)

    def inequality(c, sign, factor, writing, t):
        linear, constant = sign * factor * (c[0] * m.x[t] + c[1] * m.y[t]), sign * factor * c[2]
        return (linear >= -constant, linear + constant >= 0, -constant - linear <= 0, 2 * linear >= linear - constant)[writing]

    def equations(rates, writing, t):
        r, s = rates
        dx, dy, f, g = m.dx[t], m.dy[t], r + s * m.y[t], s - r * m.x[t]
        return (
            [dx == f, dy == g],
            [2 * g == 2 * dy, f - dx == 0],
            [dx + dy == f + g, dx - dy == f - g],
            [-3 * dy == -3 * g, dx == f],
        )[writing]

    def mode(signs, rates, factors, writing):
        def write(m, t):
            stated = [inequality(c, sign, factor, writing, t) for c, sign, factor in zip(functions, signs, factors) if sign]
            return stated + equations(rates, writing, t)

        return write

    return add_modes(m, *(mode(**k) for k in modes))


def rates_of(mode, x, y):
    """dx and dy of one mode of ``planar``."""
    r, s = mode['rates']
    return [r + s * y, s - r * x]


def owner(functions, modes, x, y):
    """Number of the mode of ``planar`` whose region holds the point."""
    c = [a * x + b * y + const for a, b, const in functions]
    (number,) = [i for i, mode in enumerate(modes) if all(sign * c_k >= 0 for sign, c_k in zip(mode['signs'], c))]
    return number
