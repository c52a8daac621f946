"""Functions in pieces over time, wherever they stand in a model.

A function is replaced by an expression of the variables that its rule leaves (piecewise.py, multivariate.py, conditional.py):

* in a named Expression it is replaced in place: an Expression has no state of its own that could be switched off, and whoever
  uses it gets the new one.  ``PiecewiseLinearFunction`` wraps each of its values in one.  Objectives are changed in place, too,
  since results are reported under their name;
* a Constraint in which it stands directly is deactivated, and its image stands in a block beside it, under the same name and
  index.  So does the equation of a ``Piecewise``.

Takes: active Constraints, Objectives, Complementarities and ``Piecewise`` of some blocks, those inside disjuncts too.
Leaves: what the rules leave; images; the functions and the ``Piecewise`` are deactivated.
Does not apply: where neither the component nor the arguments are over time.
"""

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.common.numeric_types import native_types
from pyomo.contrib.piecewise import PiecewiseLinearExpression, PiecewiseLinearFunction
from pyomo.core import Block, Constraint, Objective
from pyomo.core.expr import Expr_ifExpression, identify_variables
from pyomo.core.expr.visitor import ExpressionReplacementVisitor
from pyomo.dae import Integral
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.dcs import conditional, multivariate, piecewise
from pyomo_fesd.dcs.home import Home
from pyomo_fesd.dcs.surfaces import Surfaces
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import DISCRETISATION, derivatives, discretised


def _call(node, args, place):
    """The value of a PiecewiseLinearFunction, which is switched off as Pyomo's own transformations do it."""
    place.switch_off(node.pw_linear_function)
    return (piecewise if len(args) == 1 else multivariate).call(node, args, place)


#: node of an expression -> rule(node, args, place) that gives the expression in its place
RULES = {PiecewiseLinearExpression: _call, Expr_ifExpression: conditional.call}
PLACES = (Block, Disjunct)
IMAGES = marks.GENERATED + 'images'
#: Beginning of the names of the blocks of contrib.piecewise's transformations.
WRITTEN_BY_PYOMO = '_pyomo_contrib_pw_linear'


class _Maps(AutoSlots.Mixin):
    """Private data of a block of images: where each came from."""

    __slots__ = ('sources', 'images')

    def __init__(self):
        self.sources = ComponentMap()
        self.images = ComponentMap()


Block.register_private_data_initializer(_Maps, scope='pyomo_fesd.dcs.pieces')


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
        self.home = Home(instance, 'surfaces', times, undo)
        self.meshes = Home(instance, 'meshes', times, undo)
        self.surfaces = Surfaces(self.home)
        self.times, self.undo = times, undo
        self.rates = ComponentSet(derivatives(instance.model(), times.wrt))
        self.states = ComponentSet(d.get_state_var() for d in self.rates)
        self.cache = {}

    def replace_all(self, blocks):
        """Replace everything below ``blocks``."""
        for block in blocks:
            _refuse_written_by_pyomo(block, self.times)
            for source in list(_piecewise(block)):
                if self.times.time(source) is not None:
                    self._write_image(source, piecewise.relation(source, Place(self, source, self.times.time(source))))
            for source in list(_sources(block)):
                if _contains(source, self.times.wrt):
                    WRITERS[source.ctype](self, source)
            for function in block.component_data_objects(PiecewiseLinearFunction, active=True, descend_into=PLACES):
                if any(self._time(call) is not None for call in function._expressions.values()):
                    self.switch_off(function)
        self.surfaces.warn_explicit_time()

    def replaced(self, expression, owner):
        """``expression`` with expressions in the place of its functions; named Expressions in it are changed."""
        return _Rewriter(self, owner).walk_expression(expression)

    def time(self, owner, node):
        """The time of ``owner``, or the last one that occurs in a node of it: an Integral is not over time itself."""
        time = self.times.time(owner)
        return self._time(node) if time is None else time

    def _time(self, expression):
        labels = (self.times.time(v) for v in identify_variables(expression, include_fixed=True))
        return max((t for t in labels if t is not None), default=None)

    def write_constraint(self, source):
        """Replace in a Constraint."""
        expression = self.replaced(source.expr, source)
        if expression is not source.expr:
            self._write_image(source, expression)

    def write_objective(self, source):
        """Replace in an Objective."""
        self.set(source, self.replaced(source.expr, source))

    def write_complementarity(self, source):
        """Replace in the named Expressions of a Complementarity; its own arguments cannot be changed."""
        if any(self.replaced(side, source) is not side for side in source._args):
            raise FesdError(source, "a side of it contains an Expr_if", "give the Expr_if an Expression over time of its own")

    def set(self, source, expression):
        """Give an Objective or a named Expression another expression."""
        if expression is not source.expr:
            self.undo.callback(source.set_value, source.expr)
            source.set_value(expression)

    def switch_off(self, component):
        """Deactivate a component."""
        if component.active:
            self.undo.callback(component.activate)
            component.deactivate()

    def _write_image(self, source, expression):
        """The image of a Constraint or a Piecewise; there already where pyomo.dae has built the Piecewise anew."""
        parent, component, index = source.parent_block(), source.parent_component(), source.index()
        block = self.home.part(parent, IMAGES, Block)
        sets = (component.index_set(),) if component.is_indexed() else ()
        images = self.home.part(block, component.local_name, lambda: Constraint(*sets))
        if index not in images:
            self.undo.callback(images._data.pop, index, None)
            images.add(index, expression)
        maps = block.private_data('pyomo_fesd.dcs.pieces')
        maps.sources[images[index]] = source
        maps.images[source] = images[index]
        self.switch_off(source)


#: type of a component -> how it is written
WRITERS = {
    Constraint: Pieces.write_constraint,
    Objective: Pieces.write_objective,
    Complementarity: Pieces.write_complementarity,
}


def image(source):
    """The generated Constraint in the place of a Constraint or Piecewise; None if there is none."""
    block = source.parent_block().component(IMAGES)
    return None if block is None else block.private_data('pyomo_fesd.dcs.pieces').images.get(source)


def source(image):
    """The Constraint or Piecewise that an image stands for; None for other components."""
    return image.parent_block().private_data('pyomo_fesd.dcs.pieces').sources.get(image)


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
    waiting = list(source._args) if source.ctype is Complementarity else [source.expr]
    while waiting:
        node = waiting.pop()
        if node.__class__ in RULES:
            return True
        if node.__class__ not in native_types and node.is_expression_type() and not _waits(node, wrt):
            waiting.extend(node.args)
    return False


def _waits(node, wrt):
    """Whether a node is an Integral that pyomo.dae will build anew when it discretises."""
    return node.is_named_expression_type() and isinstance(node.parent_component(), Integral) and not discretised(wrt)


class Place:
    """One time of one component, as the rules see it.

    Attributes
    ----------
    owner : component that is named in messages
    time : time label
    meshes : Home
    """

    def __init__(self, pieces, owner, time):
        self._pieces, self.owner, self.time = pieces, owner, time
        self.meshes, self.switch_off = pieces.meshes, pieces.switch_off

    def positive_part(self, q, level):
        """max(0, q - level)."""
        return self._pieces.surfaces.positive_part(self.time, q, level)

    def indicator(self, q, level, sign=1):
        """1 where sign (q - level) > 0, else 0.

        Raises
        ------
        FesdError
            where q cannot decide: it contains a jump, a derivative, or what the owner itself defines
        """
        for v in identify_variables(q, include_fixed=True):
            if marks.is_generated(v) and v.parent_component().local_name == 'alpha':
                raise FesdError(
                    self.owner,
                    f"its condition on '{q}' contains a function that jumps",
                    "join conditions on what does not jump by land, lor and lnot",
                )
            if v.parent_component() in self._pieces.rates:
                raise FesdError(
                    self.owner,
                    f"its condition on '{q}' contains the derivative '{v.name}'",
                    "let states decide; a rate that decides makes the pieces depend on themselves",
                )
            if v.parent_component() not in self._pieces.states and _stands_alone(v, self.owner):
                raise FesdError(
                    self.owner,
                    f"its condition on '{q}' contains '{v.name}', which it defines itself",
                    "let states decide, or variables that do not jump at the switch",
                )
        return self._pieces.surfaces.indicator(self.time, q, level, sign)

    def keep_inside(self, q, lower, upper):
        """Impose lower <= q <= upper."""
        self._pieces.surfaces.keep_inside(self.time, q, lower, upper)

    def multiple(self, expression, q, level):
        """f where ``expression`` is f (q - level), None elsewhere."""
        return self._pieces.surfaces.multiple(expression, q, level)

    def cached(self, make, key, *others):
        """``make(key, *others)``, once for each key."""
        if key not in self._pieces.cache:
            self._pieces.cache[key] = make(key, *others)
        return self._pieces.cache[key]


def _stands_alone(v, owner):
    """Whether a variable is a side of an equation."""
    return owner.ctype is Constraint and owner.equality and any(side is v for side in owner.expr.args)


class _Rewriter(ExpressionReplacementVisitor):
    """From the leaves to the root, so that functions of functions are replaced from the inside."""

    def __init__(self, pieces, owner):
        super().__init__()
        self._pieces, self._owner = pieces, owner

    def beforeChild(self, node, child, position):
        if child.__class__ not in native_types and child.is_expression_type() and _waits(child, self._pieces.times.wrt):
            return False, child
        return super().beforeChild(node, child, position)

    def exitNode(self, node, data):
        changed, args, _ = data
        if node.__class__ in RULES:
            time = self._pieces.time(self._owner, node)
            return node if time is None else RULES[node.__class__](node, args, Place(self._pieces, self._owner, time))
        if node.is_named_expression_type():
            self._pieces.set(node, args[0])
            return node
        return super().exitNode(node, data)
