"""Restore the model as it was before a step that failed, or that needs other points for a while only.

Each function ``_remember_...`` records one aspect of the model and returns the function that restores it.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import chain

from pyomo.core import Block, BooleanVar, Constraint, Expression, Objective, Param, Set, Var
from pyomo.core.base.component import ActiveComponent
from pyomo.core.base.indexed_component import ActiveIndexedComponent
from pyomo.core.base.set import FiniteSetData
from pyomo.dae import ContinuousSet, DerivativeVar, Integral
from pyomo.gdp import Disjunct
from pyomo.mpec import Complementarity

from pyomo_fesd.core.generated import is_generated
from pyomo_fesd.core.interruption import DeferredInterrupt
from pyomo_fesd.core.own_data import data_of, is_reference, own_blocks
from pyomo_fesd.core.private_data import remember_records

PLACES = (Block, Disjunct)
#: Types of variables; the binaries of indicators come last, as they set the Booleans.
VARIABLES = (BooleanVar, DerivativeVar, Var)
#: Attributes that hold what a component states, by its type.
STATEMENTS = {Constraint: 'expr', Objective: 'expr', Expression: 'expr', Complementarity: '_args'}
#: Ids of the models that are restored after the present step in any case.
_RESTORED = set()


@contextmanager
def restored_on_error(block: Block, wrt: ContinuousSet | None = None) -> Iterator[None]:
    """Remove points, indices, components, types and records that the body added to the model, if it raises.

    Values, what is fixed, what is active and what components state are as before, too.  The error may be any: the body calls the
    rules of the user's model, and Ctrl-C is one too.  It waits while the model is restored.  Within ``restored`` that does it.

    Parameters
    ----------
    wrt : ContinuousSet, optional
        to which the body may add points
    """
    if id(block.model()) in _RESTORED:
        yield
        return
    with DeferredInterrupt() as interrupt, _remembered(block.model(), wrt) as undo:
        with interrupt.raising():
            yield
        undo.pop_all()


@contextmanager
def restored(block: Block, wrt: ContinuousSet | None = None) -> Iterator[None]:
    """Restore the model after the body, whether it raises or not; see ``restored_on_error``.

    The body may add points to ``wrt`` only, and catches no error of a step that restores the model itself: such a step leaves that
    to this context, which has remembered the model already.
    """
    with DeferredInterrupt() as interrupt, _remembered(block.model(), wrt) as undo:
        _RESTORED.add(id(block.model()))
        undo.callback(_RESTORED.discard, id(block.model()))
        with interrupt.raising():
            yield


def _remembered(model, wrt):
    """The functions that restore the model, called on exit."""
    undo, blocks = ExitStack(), list(own_blocks(model, PLACES))
    components = _by_type(blocks)
    # in reverse order of the restoration
    undo.callback(_remember_types(model, components))
    if wrt is not None:
        undo.callback(_remember_points(wrt))
    undo.callback(remember_records(model))
    undo.callback(_remember_active(components))
    undo.callback(_remember_indices(components))
    undo.callback(_remember_values(components))
    undo.callback(_remember_components(blocks))
    undo.callback(_remember_statements(components))
    return undo


def _by_type(blocks):
    """The components of the ``blocks`` by their type."""
    found = defaultdict(list)
    for block in blocks:
        # Pyomo's map takes longer to make than its own list to read, where a component that was deleted leaves None
        for component, _ in block._decl_order:
            if component is not None:
                found[component.ctype].append(component)
    return found


def _data(components, ctype):
    """The data of the components of a type; a Reference only names data of others."""
    return (data for c in components[ctype] if not is_reference(c) for data in data_of(c))


def _remember_values(components) -> Callable[[], None]:
    variables = [(v, v.value, v.stale, v.fixed) for ctype in VARIABLES for v in _data(components, ctype)]
    params = (p for p in components[Param] if p.mutable)
    params = [(data, data._value) for p in params for data in p._data.values()]

    def restore():
        for v, value, _, fixed in variables:
            if v.value != value:
                v.set_value(value, skip_validation=True)
            v.fixed = fixed
        for v, _, stale, _ in variables:
            v.stale = stale
        for data, value in params:
            data._value = value

    return restore


def _remember_statements(components):
    """What Constraints, Objectives, named Expressions and Complementarities state."""
    found = ((data, attribute) for ctype, attribute in STATEMENTS.items() for data in _data(components, ctype))
    stated = [(data, getattr(data, attribute, None)) for data, attribute in found]

    def restore():
        for data, content in stated:
            if getattr(data, STATEMENTS[data.ctype], None) is not content:
                data.set_value(content)

    return restore


def _remember_components(blocks):
    names = [(b, set(b._decl)) for b in blocks]

    def restore():
        for b, known in names:
            for name in set(b.component_map()) - known:
                b.del_component(name)

    return restore


def _remember_indices(components):
    """Indices of components, and members of generated Sets; a Reference follows the components that it refers to."""
    indexed = (c for c in chain.from_iterable(components.values()) if c.is_indexed() and not c.is_reference())
    indices = [(c, set(c._data)) for c in indexed]
    sets = (s for s in components[Set] if is_generated(s) and isinstance(s, FiniteSetData))
    members = [(s, set(s)) for s in sets]

    def restore():
        for component, known in indices:
            for index in set(component._data) - known:
                del component._data[index]
            component.__dict__.pop('_dae_missing_idx', None)
        for s, known in members:
            for member in set(s) - known:
                s.remove(member)

    return restore


def _remember_active(components):
    whole = [c for c in chain.from_iterable(components.values()) if isinstance(c, ActiveComponent)]
    data = (d for c in whole if isinstance(c, ActiveIndexedComponent) for d in data_of(c))
    active = [(c, c.active) for c in chain(whole, data)]
    transformed = [(d, d._transformation_block) for d in _data(components, Disjunct)]

    def restore():
        for component, was in active:
            component._active = was
        for disjunct, block in transformed:
            disjunct._transformation_block = block

    return restore


def _remember_points(wrt):
    points, boundaries, info = list(wrt), list(wrt._fe), dict(wrt._discretization_info)

    def restore():
        for point in set(wrt) - set(points):
            wrt.remove(point)
        wrt._fe = boundaries
        wrt.set_changed(False)
        wrt._discretization_info.clear()
        wrt._discretization_info.update(info)

    return restore


def _remember_types(model, components):
    """DerivativeVars and Integrals, which become Vars and Expressions; Integrals are built again over the remaining points."""
    # Pyomo's getter would make an expression of the original, which a clone of the model then keeps
    derivatives = [(d, d.__dict__.get('_expr')) for d in components[DerivativeVar]]
    integrals = list(components[Integral])

    def restore():
        for derivative, expression in derivatives:
            derivative.__dict__.pop('_expr', None)
            if expression is not None:
                derivative.set_derivative_expression(expression)
            _reclassify(derivative, DerivativeVar)
        for integral in integrals:
            if integral.ctype is Expression:
                _reclassify(integral, Integral)
                integral.clear()
                integral._constructed = False
                integral.construct()
        for b in model.block_data_objects(descend_into=Block):
            b.__dict__.pop('_pyomo_dae_reclassified_derivativevars', None)

    return restore


def _reclassify(component, ctype):
    if component.ctype is not ctype:
        component.parent_block().reclassify_component_type(component, ctype)
