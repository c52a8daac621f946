"""Find piecewise functions over time anywhere in a model, and replace them.

A function is replaced by the expression that its rule returns (``univariate.py``, ``multivariate.py``, ``expr_if.py``):

* in a named Expression it is replaced in place: an Expression cannot be deactivated, and all its users get the new one.
  ``PiecewiseLinearFunction`` wraps each of its values in one.  Objectives are changed in place too, since results are reported
  under their name;
* a Constraint that contains it directly is deactivated and replaced by a generated one beside it (``replaced_constraints.py``).  So
  is the equation of a ``Piecewise``.

Takes: active Constraints, Objectives, Complementarities and ``Piecewise`` of some blocks, also inside disjuncts.
Leaves: the components of the rules and the generated constraints; the functions and the ``Piecewise`` are deactivated.
Does not apply: where neither the component nor the arguments are over time.
"""

from itertools import chain

from pyomo.common.numeric_types import native_types
from pyomo.contrib.piecewise import PiecewiseLinearExpression, PiecewiseLinearFunction
from pyomo.core import Block, Constraint, Objective
from pyomo.core.expr import Expr_ifExpression, identify_variables
from pyomo.core.expr.visitor import ExpressionReplacementVisitor
from pyomo.dae import Integral
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity
from pyomo.mpec.complementarity import ComplementarityData

from pyomo_fesd.core import (
    GENERATED,
    FesdError,
    contains_node,
    data_of,
    declared,
    discretised,
    is_discretisation_equation,
    is_generated,
    own_components,
)
from pyomo_fesd.dcs.piecewise import expr_if, multivariate, univariate
from pyomo_fesd.dcs.piecewise.replaced_constraints import deactivate, replace_constraint
from pyomo_fesd.dcs.piecewise.rewrite_context import RewriteContext, SharedContext


def _call(node, args, context):
    """The value of a PiecewiseLinearFunction, which is deactivated as by Pyomo's own transformations."""
    context.deactivate(node.pw_linear_function)
    return (univariate if len(args) == 1 else multivariate).call(node, args, context)


#: node of an expression -> rule(node, args, context) that returns the expression to replace it
RULES = {PiecewiseLinearExpression: _call, Expr_ifExpression: expr_if.call}
NODES = frozenset(RULES)
EVERYWHERE = (Block, Disjunct)
#: Beginning of the names of the blocks of contrib.piecewise's transformations.
WRITTEN_BY_PYOMO = '_pyomo_contrib_pw_linear'


class PiecewiseRewriter:
    """Replaces all piecewise functions below some blocks; the parameters are those of ``SharedContext``."""

    def __init__(self, instance, times, undo):
        self._shared = SharedContext(instance, times, undo)
        self._times, self._undo = times, undo

    def _contains(self, source):
        """Whether a component contains a piecewise function."""
        if not isinstance(source, ComplementarityData):
            return contains_node(source.expr, NODES, self._enters)
        return any(contains_node(side, NODES, self._enters) for side in _complementarity_sides(source))

    def _enters(self, named):
        return not self.waits(named)

    def replace_all(self, blocks, without=()) -> None:
        """Replace everything below ``blocks``, except in those whose ids are in ``without``."""
        for block in blocks:
            _refuse_written_by_pyomo(block, self._times)
            found = _Survey(block, self._times, without)
            for source in found.piecewise:
                relation = univariate.relation(source, RewriteContext(self._shared, source, self._times.time(source)))
                replace_constraint(source, relation, self._undo)
            for source in filter(self._contains, found.sources):
                WRITERS[source.ctype](self, source)
            self._deactivate_functions(found.functions)
        self._shared.breakpoints.warn_explicit_time()

    def _deactivate_functions(self, functions):
        for function in functions:
            if any(self._time(call) is not None for call in function._expressions.values()):
                deactivate(function, self._undo)

    def replaced(self, expression, owner):
        """Return ``expression`` with its functions replaced; named Expressions in it are changed."""
        return _Visitor(self, owner).walk_expression(expression)

    def context(self, owner, node) -> RewriteContext | None:
        """Return the context of a node of ``owner``: at its last time, or else the owner's; None without time."""
        time = self._time(node)
        time = self._times.time(owner) if time is None else time
        return None if time is None else RewriteContext(self._shared, owner, time)

    def waits(self, node) -> bool:
        """Whether a node is an Integral that pyomo.dae will build anew when it discretises."""
        return _waits(node, self._times.wrt)

    def _time(self, expression):
        labels = (self._times.time(v) for v in identify_variables(expression, include_fixed=True))
        return max((t for t in labels if t is not None), default=None)

    def write_constraint(self, source) -> None:
        """Replace in a Constraint."""
        expression = self.replaced(source.expr, source)
        if expression is not source.expr:
            replace_constraint(source, expression, self._undo)

    def write_objective(self, source) -> None:
        """Replace in an Objective."""
        self.set(source, self.replaced(source.expr, source))

    def write_complementarity(self, source) -> None:
        """Replace in the named Expressions of a Complementarity; its own arguments cannot be changed."""
        if any(self.replaced(side, source) is not side for side in _complementarity_sides(source)):
            raise FesdError(source, "a side of it contains an Expr_if", "give the Expr_if an Expression over time of its own")

    def set(self, source, expression) -> None:
        """Give an Objective or a named Expression another expression."""
        if expression is not source.expr:
            self._undo.callback(source.set_value, source.expr)
            source.set_value(expression)


#: type of a component -> how its functions are replaced
WRITERS = {
    Constraint: PiecewiseRewriter.write_constraint,
    Objective: PiecewiseRewriter.write_objective,
    Complementarity: PiecewiseRewriter.write_complementarity,
}
SOUGHT = frozenset(WRITERS) | {PiecewiseLinearFunction}
#: Those that a place can hold beside Constraints; a Block may be a Piecewise.
SOUGHT_BESIDE = SOUGHT - {Constraint} | set(EVERYWHERE)


def may_contain_functions(disjunct) -> bool:
    """Return whether something else than the Constraints of a disjunct may contain a piecewise function."""
    return not SOUGHT_BESIDE.isdisjoint(disjunct._ctypes)


def _refuse_written_by_pyomo(block, times):
    """Refuse Pyomo's own Disjunctions of a piecewise function: their regions do not cover points outside its domain."""
    written = (c for c in own_components(block, Disjunction, Block, active=True) if _is_written_by_pyomo(c))
    for disjunction in chain.from_iterable(map(_active, written)):
        if any(times.time(v) is not None for v in _disjunction_variables(disjunction)):
            raise FesdError(
                disjunction,
                "a transformation of contrib.piecewise has written a PiecewiseLinearFunction over time as this Disjunction, whose "
                "regions do not fill the state space",
                "leave that transformation out: fesd.dcs takes the PiecewiseLinearFunction itself",
            )


def _is_written_by_pyomo(component):
    above = component.parent_block()
    while above is not None and not above.local_name.startswith(WRITTEN_BY_PYOMO):
        above = above.parent_block()
    return above is not None


def _disjunction_variables(disjunction):
    for disjunct in disjunction.disjuncts:
        for constraint in disjunct.component_data_objects(Constraint, descend_into=Block):
            yield from identify_variables(constraint.body)


class _Survey:
    """What may contain piecewise functions in a block, and in the blocks and disjuncts below it; one walk finds everything.

    Attributes
    ----------
    piecewise : list of Piecewise over time
    sources : list of active Constraints, Objectives and Complementarities of the user, also in other blocks, by References
    functions : list of active PiecewiseLinearFunctions
    """

    def __init__(self, block, times, without):
        self.piecewise, self.functions, sources = [], [], {}
        for place in _active_places(block, without):
            if univariate.is_piecewise(place) and times.time(place) is not None:
                self.piecewise.append(place)
                continue
            generated = is_generated(place)
            for component in declared(place, SOUGHT):
                if not component.active:
                    continue
                if component.ctype is PiecewiseLinearFunction:
                    self.functions += _active(component)
                elif not generated and not _is_ours(component):
                    for data in _active(component):
                        sources[id(data)] = data
        self.sources = list(sources.values())


def _active_places(block, without):
    """Yield ``block`` and the active blocks and disjuncts below it, each once, also those that a Reference names."""
    met, waiting = set(without), [block] if block.active else []
    while waiting:
        place = waiting.pop()
        if id(place) not in met:
            met.add(id(place))
            yield place
            found = [b for c in declared(place, EVERYWHERE) if c.active for b in data_of(c) if b.active and id(b) not in met]
            waiting += reversed(found)


def _active(component):
    """The active data of an active component."""
    return [data for data in data_of(component) if data.active]


def _is_ours(component):
    """Whether pyomo.dae or this package has written a component beside those of the user."""
    return component.local_name.startswith(GENERATED) or is_discretisation_equation(component)


def _complementarity_sides(condition):
    """The two arguments of a Complementarity; none where it is empty."""
    return list(getattr(condition, '_args', None) or ())


def _waits(node, wrt):
    return node.is_named_expression_type() and isinstance(node.parent_component(), Integral) and not discretised(wrt)


class _Visitor(ExpressionReplacementVisitor):
    """Replaces from the leaves to the root, so that the arguments of a function are replaced before it."""

    def __init__(self, rewriter, owner):
        super().__init__()
        self._rewriter, self._owner = rewriter, owner

    def beforeChild(self, node, child, position):
        if child.__class__ not in native_types and child.is_expression_type() and self._rewriter.waits(child):
            return False, child
        return super().beforeChild(node, child, position)

    def exitNode(self, node, data):
        _, args, _ = data
        if node.__class__ in RULES:
            context = self._rewriter.context(self._owner, node)
            return node if context is None else RULES[node.__class__](node, args, context)
        if node.is_named_expression_type():
            self._rewriter.set(node, args[0])
            return node
        return super().exitNode(node, data)
