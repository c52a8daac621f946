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
from pyomo.common.errors import InfeasibleConstraintException
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, ConstraintList, Objective, Suffix, VarList, maximize, quicksum, value
from pyomo.core.expr import Expr_ifExpression, ExternalFunctionExpression, UnaryFunctionExpression
from pyomo.repn import generate_standard_repn
from pyomo.repn.plugins.nl_writer import NLWriter

from pyomo_fesd.errors import FesdError
from pyomo_fesd.mpcc.compiled import Compiled, Numbers, csr
from pyomo_fesd.mpcc.parameters import parameter_values, symbols
from pyomo_fesd.mpcc.phase import phase
from pyomo_fesd.mpcc.problem import Condition
from pyomo_fesd.mpcc.scaling import Scale, UserFactors, side_factors
from pyomo_fesd.mpcc.source import Contradiction, Source, set_parts, start_values
from pyomo_fesd.timeindex import refuse_foreign

#: Nodes that casadi's NL reader cannot evaluate.
UNSUPPORTED_NODES = (ExternalFunctionExpression, Expr_ifExpression)
#: A bound that no sum reaches.
ALWAYS = 1e300
UNSUPPORTED_FUNCTIONS = ('asinh', 'acosh', 'atanh')


def compile_problem(problem, timer, folder=None, parameters=(), user_scaling=True):
    """Compile ``problem``.

    Parameters
    ----------
    problem : Mpcc
    timer : HierarchicalTimer
    folder : path, optional
        where the NL file is to be written and kept; default: a temporary one
    parameters : list of VarData and ParamData
        fixed variables and mutable Params whose values may change in later solves
    user_scaling : bool
        whether ``scaling_factor`` suffixes are honoured

    Raises
    ------
    FesdError
        naming the component with a function that cannot be evaluated, before anything is solved
    Contradiction
        where fixed values alone violate a constraint
    """
    factors = UserFactors(problem.model, user_scaling)
    with symbols(problem.model, parameters) as handles, _sides(problem, handles) as scratch:
        with tempfile.TemporaryDirectory() as temporary:
            path = os.path.join(folder or temporary, 'model.nl')
            with phase(timer, 'write'):
                info = _write(problem.model, path)
            refuse_foreign(info.variables, problem.model.model(), problem.model)
            with phase(timer, 'import'):
                nl = _import(problem.model, path, handles)
                return _assemble(problem, scratch, info, nl, parameters, handles, factors)


@dataclass(frozen=True)
class _Scratch:
    """Rows of the scratch block by group, the conditions in their order, and auxiliary variables as in ``Source``."""

    rows: dict
    conditions: list
    splits: list


@contextmanager
def _sides(problem, handles):
    """What a scratch block holds for every expression that the MPCC needs; the pairs sleep while it exists."""
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
        splits = []
        conditions = problem.conditions + [c for source, m in problem.mixed for c in _split(scratch, source, m, handles, splits)]
        known = {}
        rows = {
            'G': [_shared_row(scratch, c.G, handles, known) for c in conditions],
            'H': [_shared_row(scratch, c.H, handles, known) for c in conditions],
            'eta': [_row(scratch, handles.in_terms(d.eta)) for d in problem.decisions],
            'equal': [_row(scratch, handles.in_terms(d.constraint.body - d.constraint.upper)) for d in problem.decisions],
            'penalty': [_row(scratch, handles.in_terms(weight * term.expr)) for term, weight in problem.penalties],
            # parameters that stand nowhere must be in the NL file all the same
            'present': [_keep(scratch, handles.variables)],
        }
        rows['present'] += [_keep(scratch, rows['G'] + rows['H'])]
        yield _Scratch(rows, conditions, splits)
    finally:
        model.del_component(scratch)
        for suffix in suffixes:
            suffix.activate()
        _wake(asleep)


def _keep(scratch, components):
    """A row that keeps variables in the NL file which stand in no other: the writer drops those."""
    variables = [c for c in components if hasattr(c, 'is_variable_type') and c.is_variable_type()]
    return scratch.row.add(quicksum(variables) <= ALWAYS) if variables else 0.0


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


def _split(scratch, source, m, handles, splits):
    """l <= B <= u perp F as B - l perp F+ and u - B perp F- with F = F+ - F-."""
    plus, minus = scratch.part.add(), scratch.part.add()
    plus.setlb(0)
    minus.setlb(0)
    set_parts(plus, minus, m.F)
    splits.append((plus, minus, m.F))
    scratch.row.add(handles.in_terms(m.F) == plus - minus)
    return [Condition(source, m.body - m.lower, plus), Condition(source, m.upper - m.body, minus)]


def _shared_row(scratch, expr, handles, known):
    """As ``_row``, one for a side that stands in several pairs: its branch equation must not appear twice."""
    if id(expr) not in known:
        known[id(expr)] = _row(scratch, handles.in_terms(expr))
    return known[id(expr)]


def _row(scratch, expr):
    """What stands for ``expr`` in the NL file: a number, a variable, or a row."""
    if not hasattr(expr, 'is_fixed'):
        return value(expr)
    if expr.is_fixed():
        # 0 * x is fixed although x may have no value
        return generate_standard_repn(expr, compute_values=True).constant
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


def _write(model, path):
    """Write the NL file; what stands in it, in its order."""
    try:
        with open(path, 'w', newline='') as stream:
            return NLWriter().write(model, stream, linear_presolve=False, scale_model=False, symbolic_solver_labels=False)
    except InfeasibleConstraintException as error:
        raise Contradiction(str(error)) from None


def _import(model, path, handles):
    builder = ca.NlpBuilder()
    try:
        builder.import_nl(path)
    except RuntimeError as error:
        raise _unsupported(model, error, handles) from None
    return builder


def _unsupported(model, error, handles):
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
                    handles.source(component),
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


def _assemble(problem, scratch, info, nl, parameters, handles, factors):
    """Split the NL's rows into the model's own and those that we asked for, as one scaled function."""
    rows, conditions = scratch.rows, scratch.conditions
    columns = ComponentMap((v, j) for j, v in enumerate(info.variables))
    place = ComponentMap((c, i) for i, c in enumerate(info.constraints))
    lower, upper = np.array(nl.g_lb, dtype=float), np.array(nl.g_ub, dtype=float)
    settable = [columns[v] for v in handles.variables]
    free = np.setdiff1d(np.arange(len(info.variables)), settable)
    variables = [info.variables[j] for j in free]

    taken = {place[r] for group in rows.values() for r in group if _is_row(r)}
    own = [i for i in range(len(info.constraints)) if i not in taken]
    constraints = [handles.source(info.constraints[i]) for i in own]
    sources = [c.source for c in conditions]

    # the solver's variables, and the model's in terms of them
    s_x, s_g = factors.of(variables), factors.of(constraints)
    s_f = float(factors.of([problem.objective])[0])
    w, p = ca.SX.sym('w', len(variables)), ca.SX.sym('p', len(settable))
    x = ca.SX(len(info.variables), 1)
    x[free.tolist()], x[settable] = w / s_x, p
    f, g = ca.Function('nl', [ca.vertcat(*nl.x)], [nl.f, ca.vertcat(*nl.g)]).expand()(x)

    def sx(r):
        if _is_row(r):
            # constants of a linear row stand in its bound
            return g[place[r]] - lower[place[r]]
        return x[columns[r]] if r in columns else ca.SX(value(r))

    def group(name):
        return ca.vertcat(*map(sx, rows[name])) if rows[name] else ca.SX(0, 1)

    names = rows['G'] + rows['H']
    start, _ = start_values(variables)
    sides = ca.vertcat(group('G'), group('H'))
    point = start * s_x, parameter_values(parameters)
    s_sides = _scale_sides(sides, w, p, names, point, dict(zip(free, s_x)), columns, factors.of(sources * 2))
    q = len(conditions)
    sides = sides * s_sides
    penalty = sum(map(sx, rows['penalty']), ca.SX(0))
    own_rows = g[own] * s_g if own else ca.SX(0, 1)
    parts = [f * s_f, penalty * s_f, own_rows, sides[:q], sides[q:], group('eta'), group('equal')]

    side_of = np.array([_number(k, r, place, columns) for k, r in enumerate(names)], dtype=int)
    kept = _distinct(side_of, q)
    both = np.concatenate([kept, kept + q])
    parts[3], parts[4] = parts[3][kept.tolist()], parts[4][kept.tolist()]
    plain = {id(r) for r in names if not _is_row(r)}
    guide = np.array([problem.artificial.get(v.parent_component(), np.inf) for v in variables], dtype=float)
    sides_too = np.array([id(v) in plain for v in variables], dtype=bool)
    source = Source(variables, list(parameters), sides_too, guide, s_x, scratch.splits)
    numbers = Numbers(
        lbg=lower[own] * s_g,
        ubg=upper[own] * s_g,
        side_of=side_of[both],
        sign=-1.0 if problem.objective is not None and problem.objective.sense == maximize else 1.0,
        has_objective=problem.objective is not None,
        scale=Scale(s_x, s_g, s_f, s_sides[both]),
        **source.read(),
    )
    graph = ca.Function('mpcc', [w, p], parts)
    return Compiled(graph, numbers, variables, constraints, [conditions[k] for k in kept], problem.decisions, source)


def _scale_sides(sides, w, p, names, point, s_x, columns, given):
    """Factors of the sides: the variable's own for a plain variable, the user's or a mild gradient for an expression."""
    if not sides.numel():
        return np.ones(0)
    J = csr(ca.Function('sides', [w, p], [ca.jacobian(sides, w)])(*point))
    largest = np.abs(J).max(axis=1).toarray().ravel() if J.shape[1] else np.zeros(J.shape[0])
    factors = side_factors(np.where(np.isfinite(largest), largest, 0.0), given)
    for k, r in enumerate(names):
        if not _is_row(r) and r in columns:
            factors[k] = s_x.get(columns[r], 1.0)
    return factors


def _distinct(side_of, q):
    """Positions of the pairs that are not there already, in whichever order of their sides."""
    seen, kept = set(), []
    for k in range(q):
        pair = frozenset((side_of[k], side_of[k + q]))
        if pair not in seen:
            kept.append(k)
        seen.add(pair)
    return np.array(kept, dtype=int)
