"""Taking back a discretisation that failed: the model as it was before the call.

Each function ``_remember_...`` notes one thing about the model and returns the function that brings it back.
"""

from contextlib import ExitStack, contextmanager

from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Constraint, Expression, Param, Suffix, Var
from pyomo.dae import DerivativeVar, Integral
from pyomo.gdp import Disjunct

from pyomo_fesd import marks
from pyomo_fesd.records import records
from pyomo_fesd.timeindex import DISCRETISATION

PLACES = (Block, Disjunct)


@contextmanager
def restored_on_error(block, wrt):
    """Take back points, indices, components, types, marks and records added to the model if an error comes out of the body.

    That may be any error: the body calls the rules of the user's model, and Ctrl-C is one too.
    """
    model = block.model()
    with ExitStack() as undo:
        # what is remembered last is brought back first
        undo.callback(_remember_types(model))
        undo.callback(_remember_points(wrt))
        undo.callback(_remember_records(model))
        undo.callback(_remember_active(model))
        undo.callback(_remember_indices(model))
        undo.callback(_remember_values(model))
        undo.callback(_remember_components(model))
        undo.callback(_remember_suffixes(model))
        undo.callback(_remember_weights(model))
        undo.callback(_remember_discretisation(model))
        yield
        undo.pop_all()


def _remember_suffixes(model):
    keys = ComponentMap((s, list(s)) for s in model.component_objects(Suffix, descend_into=PLACES))

    def restore():
        for suffix, known in keys.items():
            keep = ComponentMap((key, None) for key in known)
            for key in [key for key in suffix if key not in keep]:
                del suffix[key]

    return restore


def _remember_values(model):
    variables = [(v, v.value, v.stale, v.fixed) for v in model.component_data_objects(Var, descend_into=PLACES)]
    params = (p for p in model.component_objects(Param, descend_into=PLACES) if p.mutable)
    params = [(p, p._value) for family in params for p in family._data.values()]

    def restore():
        for v, value, stale, fixed in variables:
            if v.value != value or v.fixed != fixed:
                v.set_value(value, skip_validation=True)
                v.stale, v.fixed = stale, fixed
        for p, value in params:
            p._value = value

    return restore


def _remember_weights(model):
    """Modes with memory: the weights of an element get one variable, whose value is remembered with all others."""
    weights = [(w, w.expr) for w, _ in marks.marked(model, marks.MEMORY)]

    def restore():
        for weight, expr in weights:
            weight.set_value(expr)

    return restore


def _remember_discretisation(model):
    """Equations of a grid that was there before get lengths and values after jumps."""
    constraints = model.component_objects(Constraint, descend_into=Block)
    equations = [(e, e.expr) for c in constraints if c.local_name.endswith(DISCRETISATION) for e in c.values()]

    def restore():
        for equation, expr in equations:
            equation.set_value(expr)

    return restore


def _remember_components(model):
    names = ComponentMap((b, set(b.component_map())) for b in model.block_data_objects(descend_into=PLACES))

    def restore():
        for b, known in names.items():
            for name in set(b.component_map()) - known:
                b.del_component(name)

    return restore


def _remember_indices(model):
    indices = ComponentMap((c, set(c._data)) for c in model.component_objects(descend_into=PLACES) if c.is_indexed())

    def restore():
        for component, known in indices.items():
            for index in set(component._data) - known:
                del component._data[index]
            component.__dict__.pop('_dae_missing_idx', None)

    return restore


def _remember_active(model):
    active = [(c, c.active) for c in model.component_data_objects(descend_into=PLACES) if hasattr(c, 'deactivate')]

    def restore():
        for component, was in active:
            component._active = was

    return restore


def _remember_records(model):
    record = records(model)
    repeats, grids = list(record.repeats), ComponentMap(record.grids.items())

    def restore():
        record.repeats, record.grids = repeats, grids

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


def _remember_types(model):
    """DerivativeVars and Integrals become Vars and Expressions; Integrals are built again over the points that are left."""
    derivatives = [(d, d.get_derivative_expression()) for d in model.component_objects(DerivativeVar, descend_into=PLACES)]
    integrals = list(model.component_objects(Integral, descend_into=PLACES))

    def restore():
        for derivative, expression in derivatives:
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
