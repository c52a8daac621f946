"""An MPCC compiled once: Pyomo's NL writer -> casadi -> SX functions with exact sparse derivatives.

The NL file holds the model's own rows, then one row for every side of a pair that is not a plain variable, one for every
decision and one for every penalty term.  Relaxations, branches and the LPEC are all formed from the same SX graph, so neither
eps nor a branch needs a rebuild.
"""

import os
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass

import casadi as ca
import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, ConstraintList, Objective, Suffix, VarList, maximize, value
from pyomo.core.expr import Expr_ifExpression, ExternalFunctionExpression, UnaryFunctionExpression
from pyomo.repn.plugins.nl_writer import NLWriter
from scipy import sparse

from pyomo_fesd.errors import FesdError
from pyomo_fesd.mpcc.problem import Condition
from pyomo_fesd.timeindex import refuse_foreign

#: Nodes that casadi's NL reader cannot evaluate.
UNSUPPORTED_NODES = (ExternalFunctionExpression, Expr_ifExpression)
UNSUPPORTED_FUNCTIONS = ('asinh', 'acosh', 'atanh')


@dataclass(frozen=True)
class Evaluation:
    """Values at one point w (numpy vectors; see ``Compiled``)."""

    f: float
    g: np.ndarray
    G: np.ndarray
    H: np.ndarray
    eta: np.ndarray


class Compiled:
    """The MPCC as numbers and functions.

    Attributes
    ----------
    variables : list of VarData, length n
    constraints : list of ConstraintData, length m (rows of g)
    conditions : list of Condition, length q
    decisions : list of Decision
    x : SX (n);  f, penalty : SX scalars;  g : SX (m);  G, H : SX (q);  eta, equal : SX (one each decision)
    side_of : int array (2q), equal numbers for equal sides among G (first q) and H
    lbx, ubx : arrays (n), the variables' bounds with the signs that plain-variable sides imply
    lbg, ubg : arrays (m)
    artificial : bool array (n), variables whose bounds belong to the method
    guide_ubx : array (n), upper bounds in the homotopy: those of such variables are tighter there
    x0 : array (n), the model's values projected to the bounds
    missing : int, number of variables without a value
    sign : +1.0, or -1.0 for a model that maximises (f is always minimised)
    has_objective : bool
    """

    def evaluate(self, w):
        """f, g, G, H and eta at ``w``."""
        f, g, G, H, eta = (np.asarray(v, dtype=float).ravel() for v in self._values(w))
        return Evaluation(float(f[0]), g, G, H, eta)

    def gradients(self, w):
        """Gradient of f (array) and Jacobians of g, G, H and the decisions' equations (scipy csr) at ``w``."""
        grad, *jacobians = self._gradients(w)
        return np.asarray(grad, dtype=float).ravel(), *(_csr(J) for J in jacobians)

    def violations(self, w, at=None):
        """How much each row (m) and each bound (n) is violated at ``w``."""
        at = at or self.evaluate(w)
        rows = np.maximum(np.maximum(self.lbg - at.g, at.g - self.ubg), 0.0)
        return rows, np.maximum(np.maximum(self.lbx - w, w - self.ubx), 0.0)


def _csr(J):
    """casadi DM to scipy csr."""
    colptr, row = np.array(J.sparsity().colind()), np.array(J.sparsity().row())
    data = np.array(J.nonzeros(), dtype=float)
    return sparse.csc_matrix((data, row, colptr), shape=J.shape).tocsr()


def compile_problem(problem, timer, folder=None):
    """Compile ``problem``.

    Parameters
    ----------
    problem : Mpcc
    timer : HierarchicalTimer
    folder : path, optional
        where the NL file is to be written and kept; default: a temporary one

    Raises
    ------
    FesdError
        naming the component with a function that cannot be evaluated, before anything is solved
    """
    with _sides(problem) as (scratch, rows, conditions):
        timer.start('write')
        with tempfile.TemporaryDirectory() as temporary:
            path = os.path.join(folder or temporary, 'model.nl')
            with open(path, 'w', newline='') as stream:
                info = _write(problem.model, stream)
            timer.stop('write')
            refuse_foreign(info.variables, problem.model.model(), problem.model)
            timer.start('import')
            nl = _import(problem.model, path)
        compiled = _assemble(problem, conditions, rows, info, nl)
        timer.stop('import')
    return compiled


@contextmanager
def _sides(problem):
    """A scratch block with a row for every expression that the MPCC needs; the pairs sleep while it exists."""
    model, scratch = problem.model, Block()
    model.add_component(unique_component_name(model, '_pyomo_fesd_scratch'), scratch)
    asleep = _sleep(problem.sources)
    suffixes = [s for s in model.component_objects(Suffix, active=True, descend_into=Block) if s.export_enabled()]
    for suffix in suffixes:
        suffix.deactivate()
    try:
        scratch.row = ConstraintList()
        scratch.part = VarList()
        if problem.objective is None:
            scratch.objective = Objective(expr=0)
        conditions = problem.conditions + [c for source, m in problem.mixed for c in _split(scratch, source, m)]
        known = {}
        rows = {
            'G': [_shared_row(scratch, c.G, known) for c in conditions],
            'H': [_shared_row(scratch, c.H, known) for c in conditions],
            'eta': [_row(scratch, d.eta) for d in problem.decisions],
            'equal': [_row(scratch, d.constraint.body - d.constraint.upper) for d in problem.decisions],
            'penalty': [_row(scratch, weight * term.expr) for term, weight in problem.penalties],
        }
        yield scratch, rows, conditions
    finally:
        model.del_component(scratch)
        for suffix in suffixes:
            suffix.activate()
        _wake(asleep)


def _sleep(sources):
    """Deactivate the components of all ``sources``, which the NL writer refuses; returns what ``_wake`` needs."""
    components = ComponentMap()
    for source in sources:
        components.setdefault(source.parent_component(), []).append(source)
    for component in components:
        component.deactivate()
    return components


def _wake(components):
    for component, datas in components.items():
        component._active = True
        for data in datas:
            data.activate()


def _split(scratch, source, m):
    """l <= B <= u perp F as B - l perp F+ and u - B perp F- with F = F+ - F-."""
    plus, minus = scratch.part.add(), scratch.part.add()
    for part, now in ((plus, max(value(m.F, exception=False) or 0, 0)), (minus, max(-(value(m.F, exception=False) or 0), 0))):
        part.setlb(0)
        part.value = now
    scratch.row.add(m.F == plus - minus)
    return [Condition(source, m.body - m.lower, plus), Condition(source, m.upper - m.body, minus)]


def _shared_row(scratch, expr, known):
    """As ``_row``, one for a side that stands in several pairs: its branch equation must not appear twice."""
    if id(expr) not in known:
        known[id(expr)] = _row(scratch, expr)
    return known[id(expr)]


def _row(scratch, expr):
    """What stands for ``expr`` in the NL file: a number, a variable, or a row."""
    if not hasattr(expr, 'is_fixed') or expr.is_fixed():
        return value(expr)
    if expr.is_variable_type():
        return expr
    return scratch.row.add(expr >= 0)


def _number(k, r, place, column):
    """Equal for equal sides: the row, the variable counted behind all rows, or for the k-th side, a constant, -1 - k."""
    if _is_row(r):
        return place[r]
    return len(place) + column[r] if r in column else -1 - k


def _is_row(r):
    return hasattr(r, 'body')


def _write(model, stream):
    return NLWriter().write(model, stream, linear_presolve=False, scale_model=False, symbolic_solver_labels=False)


def _import(model, path):
    builder = ca.NlpBuilder()
    try:
        builder.import_nl(path)
    except RuntimeError as error:
        raise _unsupported(model, error) from None
    return builder


def _unsupported(model, error):
    """Name the component whose expression casadi could not read."""
    for component in model.component_data_objects(descend_into=Block, active=True):
        expr = getattr(component, 'expr', None)
        if expr is None or not hasattr(expr, 'is_expression_type'):
            continue
        for node in _nodes(expr):
            if isinstance(node, UNSUPPORTED_NODES) or (
                isinstance(node, UnaryFunctionExpression) and node.getname() in UNSUPPORTED_FUNCTIONS
            ):
                return FesdError(
                    component,
                    f"the function '{node.getname()}' cannot be evaluated here",
                    "write it with exp, log, sqrt or a complementarity (for if-then-else: a Disjunction)",
                )
    return FesdError(model, f"casadi cannot read the model: {str(error).splitlines()[-1]}", "report this model")


def _nodes(expr):
    stack = [expr]
    while stack:
        node = stack.pop()
        if hasattr(node, 'is_expression_type') and node.is_expression_type():
            yield node
            stack.extend(node.args)


def _assemble(problem, conditions, rows, info, nl):
    """Split the NL's rows into the model's own and those that we asked for, as functions of SX variables."""
    x = ca.SX.sym('w', len(info.variables))
    f, g = ca.Function('nl', [ca.vertcat(*nl.x)], [nl.f, ca.vertcat(*nl.g)]).expand()(x)
    column = ComponentMap((v, j) for j, v in enumerate(info.variables))
    place = ComponentMap((c, i) for i, c in enumerate(info.constraints))
    lower, upper = np.array(nl.g_lb, dtype=float), np.array(nl.g_ub, dtype=float)

    taken = {place[r] for group in rows.values() for r in group if _is_row(r)}
    own = [i for i in range(len(info.constraints)) if i not in taken]

    def sx(r):
        if _is_row(r):
            # constants of a linear row stand in its bound
            return g[place[r]] - lower[place[r]]
        return x[column[r]] if r in column else ca.SX(value(r))

    c = Compiled()
    c.variables, c.constraints = info.variables, [info.constraints[i] for i in own]
    c.conditions, c.decisions = conditions, problem.decisions
    c.x, c.f = x, f
    c.g = g[own] if own else ca.SX(0, 1)
    c.lbg, c.ubg = lower[own], upper[own]
    for name in ('G', 'H', 'eta', 'equal'):
        setattr(c, name, ca.vertcat(*map(sx, rows[name])) if rows[name] else ca.SX(0, 1))
    sides = rows['G'] + rows['H']
    c.side_of = np.array([_number(k, r, place, column) for k, r in enumerate(sides)], dtype=int)
    c.penalty = sum(map(sx, rows['penalty']), ca.SX(0))
    c.lbx, c.ubx = np.array(nl.x_lb, dtype=float), np.array(nl.x_ub, dtype=float)
    for r in rows['G'] + rows['H']:
        if not _is_row(r) and r in column:
            c.lbx[column[r]] = max(c.lbx[column[r]], 0.0)
    guide = np.array([problem.artificial.get(v.parent_component(), np.inf) for v in info.variables], dtype=float)
    c.artificial, c.guide_ubx = np.isfinite(guide), np.minimum(c.ubx, guide)
    c.has_objective = problem.objective is not None
    c.sign = -1.0 if c.has_objective and problem.objective.sense == maximize else 1.0
    start = np.array([np.nan if v.value is None else v.value for v in info.variables], dtype=float)
    c.missing = int(np.count_nonzero(~np.isfinite(start)))
    c.x0 = np.clip(np.where(np.isfinite(start), start, 0.0), c.lbx, c.ubx)
    c._values = ca.Function('values', [x], [f, c.g, c.G, c.H, c.eta])
    c._gradients = ca.Function(
        'gradients', [x], [ca.gradient(f, x), *(ca.jacobian(e, x) for e in (c.g, c.G, c.H, c.equal))]
    )
    return c
