"""A model with Disjunctions and without time as an MPCC, by vanishing pairs.

For a Disjunction with disjuncts i, each constraint g <= 0 of a disjunct gets a slack s that vanishes where the disjunct is chosen:

    sum_i nu_i = 1,    nu_i >= 0,    g_i(x) <= s_i,    0 <= nu_i  perp  s_i >= 0

Equations get two slacks.  Disjuncts in a disjunct share its nu.  Where indicators occur elsewhere (logic, an objective), and for
other binary variables, 0 <= nu perp 1 - nu >= 0.
"""

import pyomo.environ as pyo
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import ComplementarityList, complements


def as_mpcc(model):
    """Return a clone of ``model`` in which every Disjunction is a set of pairs."""
    m = model.clone()
    disjuncts = list(m.component_data_objects(Disjunct, active=True, descend_into=(pyo.Block, Disjunct)))
    pyo.TransformationFactory('core.logical_to_linear').apply_to(m, targets=[m, *disjuncts])
    b = m.vanishing = pyo.Block()
    b.slacks, b.rows, b.sums = pyo.VarList(domain=pyo.NonNegativeReals, initialize=0), pyo.ConstraintList(), pyo.ConstraintList()
    b.pairs = ComplementarityList()
    for disjunction in list(m.component_data_objects(Disjunction, active=True, descend_into=pyo.Block)):
        _write(b, disjunction, 1)
    _relax(m, b)
    return m


def _write(b, disjunction, whole):
    """The pairs of a Disjunction whose indicators sum to ``whole``: 1, or the indicator of the disjunct around it."""
    disjuncts = [d for d in disjunction.disjuncts if d.active]
    chosen = sum(d.binary_indicator_var for d in disjuncts)
    b.sums.add(chosen == whole if disjunction.xor else chosen >= whole)
    disjunction.deactivate()
    for d in disjuncts:
        nu = d.binary_indicator_var
        nu.domain = pyo.Reals
        nu.setlb(0)
        nu.setub(1)
        nu.set_value(1 / len(disjuncts), skip_validation=True)
        for c in list(d.component_data_objects(pyo.Constraint, active=True, descend_into=pyo.Block)):
            _soften(b, c, nu)
        for nested in list(d.component_data_objects(Disjunction, active=True, descend_into=pyo.Block)):
            _write(b, nested, nu)
        d._deactivate_without_fixing_indicator()


def _soften(b, c, nu):
    """The constraint with slacks that vanish where ``nu`` is positive; they start at its violation."""
    now = pyo.value(c.body, exception=False) or 0.0
    if c.equality:
        above, below = _slack(b, nu, now - pyo.value(c.upper)), _slack(b, nu, pyo.value(c.lower) - now)
        b.rows.add(c.body - c.upper == above - below)
        return
    if c.has_ub():
        b.rows.add(c.body - c.upper <= _slack(b, nu, now - pyo.value(c.upper)))
    if c.has_lb():
        b.rows.add(c.lower - c.body <= _slack(b, nu, pyo.value(c.lower) - now))


def _slack(b, nu, violation):
    s = b.slacks.add()
    s.set_value(max(0.0, violation))
    b.pairs.add(complements(nu >= 0, s >= 0))
    return s


def _relax(m, b):
    """Pairs that make binary variables 0 or 1, of those that are still counted somewhere."""
    sums = {id(row) for row in b.sums.values()}
    rows = [c for c in m.component_data_objects(pyo.Constraint, active=True, descend_into=pyo.Block) if id(c) not in sums]
    expressions = [c.body for c in rows] + [o.expr for o in m.component_data_objects(pyo.Objective, active=True)]
    seen = {id(v): v for e in expressions for v in identify_variables(e, include_fixed=False)}
    indicators = {id(v) for row in b.sums.values() for v in identify_variables(row.body)}
    for v in seen.values():
        if v.is_binary() or id(v) in indicators:
            if v.is_binary():
                v.domain = pyo.Reals
                v.setlb(0)
                v.setub(1)
                v.set_value(0.5, skip_validation=True)
            b.pairs.add(complements(v >= 0, 1 - v >= 0))
