"""Functions in pieces over time, wherever they stand in a model.

A function is replaced by an expression of the variables that its rule leaves (piecewise.py, multivariate.py, conditional.py):

* in a named Expression it is replaced in place: an Expression has no state of its own that could be switched off, and whoever
  uses it gets the new one.  ``PiecewiseLinearFunction`` wraps each of its values in one.  Objectives are changed in place, too,
  since results are reported under their name;
* a Constraint in which it stands directly is deactivated, and its image stands beside it (images.py).  So does the equation of a
  ``Piecewise``.

Takes: active Constraints, Objectives, Complementarities and ``Piecewise`` of some blocks, those inside disjuncts too.
Leaves: what the rules leave; images; the functions and the ``Piecewise`` are deactivated.
Does not apply: where neither the component nor the arguments are over time.
"""

from pyomo.common.numeric_types import native_types
from pyomo.contrib.piecewise import PiecewiseLinearExpression, PiecewiseLinearFunction
from pyomo.core import Block, Constraint, Objective
from pyomo.core.expr import Expr_ifExpression, identify_variables
from pyomo.core.expr.visitor import ExpressionReplacementVisitor
from pyomo.dae import Integral
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.dcs import conditional, images, multivariate, piecewise
from pyomo_fesd.dcs.place import Place, Shared
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import DISCRETISATION, discretised


def _call(node, args, place):
    """The value of a PiecewiseLinearFunction, which is switched off as Pyomo's own transformations do it."""
    place.switch_off(node.pw_linear_function)
    return (piecewise if len(args) == 1 else multivariate).call(node, args, place)


#: node of an expression -> rule(node, args, place) that gives the expression in its place
RULES = {PiecewiseLinearExpression: _call, Expr_ifExpression: conditional.call}
PLACES = (Block, Disjunct)
#: Beginning of the names of the blocks of contrib.piecewise's transformations.
WRITTEN_BY_PYOMO = '_pyomo_contrib_pw_linear'


class Pieces:
    """Replaces all functions in pieces below some blocks.

    Parameters
    ----------
    instance : BlockData
        holds the new variables
    times : TimeIndex
    undo : ExitStack
        is told how to take back what is written
    """

    def __init__(self, instance, times, undo):
        self._shared = Shared(instance, times, undo)
        self._times, self._undo = times, undo

    def replace_all(self, blocks):
        """Replace everything below ``blocks``."""
        for block in blocks:
            _refuse_written_by_pyomo(block, self._times)
            for source in list(_piecewise(block)):
                time = self._times.time(source)
                if time is not None:
                    images.write(source, piecewise.relation(source, Place(self._shared, source, time)), self._undo)
            for source in list(_sources(block)):
                if _contains(source, self._times.wrt):
                    WRITERS[source.ctype](self, source)
            for function in block.component_data_objects(PiecewiseLinearFunction, active=True, descend_into=PLACES):
                if any(self._time(call) is not None for call in function._expressions.values()):
                    images.switch_off(function, self._undo)
        self._shared.surfaces.warn_explicit_time()

    def replaced(self, expression, owner):
        """``expression`` with expressions in the place of its functions; named Expressions in it are changed."""
        return _Rewriter(self, owner).walk_expression(expression)

    def place(self, owner, node):
        """Where a node of ``owner`` stands: the last time that occurs in it, or else the owner's; None without time."""
        time = self._time(node)
        time = self._times.time(owner) if time is None else time
        return None if time is None else Place(self._shared, owner, time)

    def waits(self, node):
        """Whether a node is an Integral that pyomo.dae will build anew when it discretises."""
        return _waits(node, self._times.wrt)

    def _time(self, expression):
        labels = (self._times.time(v) for v in identify_variables(expression, include_fixed=True))
        return max((t for t in labels if t is not None), default=None)

    def write_constraint(self, source):
        """Replace in a Constraint."""
        expression = self.replaced(source.expr, source)
        if expression is not source.expr:
            images.write(source, expression, self._undo)

    def write_objective(self, source):
        """Replace in an Objective."""
        self.set(source, self.replaced(source.expr, source))

    def write_complementarity(self, source):
        """Replace in the named Expressions of a Complementarity; its own arguments cannot be changed."""
        if any(self.replaced(side, source) is not side for side in _sides(source)):
            raise FesdError(source, "a side of it contains an Expr_if", "give the Expr_if an Expression over time of its own")

    def set(self, source, expression):
        """Give an Objective or a named Expression another expression."""
        if expression is not source.expr:
            self._undo.callback(source.set_value, source.expr)
            source.set_value(expression)


#: type of a component -> how it is written
WRITERS = {
    Constraint: Pieces.write_constraint,
    Objective: Pieces.write_objective,
    Complementarity: Pieces.write_complementarity,
}


def _refuse_written_by_pyomo(block, times):
    """Pyomo's own Disjunctions of a function in pieces say nothing of points outside its domain: no partition."""
    for disjunction in block.component_data_objects(Disjunction, active=True, descend_into=Block):
        above = disjunction.parent_block()
        while above is not None and not above.local_name.startswith(WRITTEN_BY_PYOMO):
            above = above.parent_block()
        if above is not None and any(times.time(v) is not None for v in _variables(disjunction)):
            raise FesdError(
                disjunction,
                "a transformation of contrib.piecewise has written a PiecewiseLinearFunction over time as this Disjunction, whose "
                "regions do not fill the state space",
                "leave that out: fesd.dcs takes the PiecewiseLinearFunction itself",
            )


def _variables(disjunction):
    for disjunct in disjunction.disjuncts:
        for constraint in disjunct.component_data_objects(Constraint, descend_into=Block):
            yield from identify_variables(constraint.body)


def _piecewise(block):
    found = block.block_data_objects(active=True, descend_into=PLACES)
    return (b for b in found if piecewise.has_pieces(b))


def _sources(block):
    found = block.component_data_objects(tuple(WRITERS), active=True, descend_into=PLACES)
    return (c for c in found if not c.parent_component().local_name.endswith(DISCRETISATION) and not marks.is_generated(c))


def _contains(source, wrt):
    """Whether a function in pieces stands somewhere in a component."""
    waiting = _sides(source) if source.ctype is Complementarity else [source.expr]
    while waiting:
        node = waiting.pop()
        if node.__class__ in RULES:
            return True
        if node.__class__ not in native_types and node.is_expression_type() and not _waits(node, wrt):
            waiting.extend(node.args)
    return False


def _sides(condition):
    """The two arguments of a Complementarity; none where it is empty."""
    return list(getattr(condition, '_args', None) or ())


def _waits(node, wrt):
    """Whether a node is an Integral that pyomo.dae will build anew when it discretises."""
    return node.is_named_expression_type() and isinstance(node.parent_component(), Integral) and not discretised(wrt)


class _Rewriter(ExpressionReplacementVisitor):
    """From the leaves to the root, so that functions of functions are replaced from the inside."""

    def __init__(self, pieces, owner):
        super().__init__()
        self._pieces, self._owner = pieces, owner

    def beforeChild(self, node, child, position):
        if child.__class__ not in native_types and child.is_expression_type() and self._pieces.waits(child):
            return False, child
        return super().beforeChild(node, child, position)

    def exitNode(self, node, data):
        _, args, _ = data
        if node.__class__ in RULES:
            place = self._pieces.place(self._owner, node)
            return node if place is None else RULES[node.__class__](node, args, place)
        if node.is_named_expression_type():
            self._pieces.set(node, args[0])
            return node
        return super().exitNode(node, data)
