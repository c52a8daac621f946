"""Taking back a discretisation that failed: the model as it was before the call."""

from contextlib import contextmanager

from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Expression, Suffix
from pyomo.dae import DerivativeVar, Integral
from pyomo.gdp import Disjunct

from pyomo_fesd.records import records

PLACES = (Block, Disjunct)


@contextmanager
def restored_on_error(block, wrt):
    """Take back points, indices, components, types, marks and records added to the model if an error comes out of the body."""
    block, record = block.model(), records(block)
    repeats, grids = list(record.repeats), ComponentMap(record.grids.items())
    points, boundaries, info = list(wrt), list(wrt._fe), dict(wrt._discretization_info)
    names = ComponentMap((b, set(b.component_map())) for b in block.block_data_objects(descend_into=PLACES))
    indices = ComponentMap((c, set(c._data)) for c in block.component_objects(descend_into=PLACES) if c.is_indexed())
    marks = ComponentMap((s, list(s)) for s in block.component_objects(Suffix, descend_into=PLACES))
    active = [(c, c.active) for c in block.component_data_objects(descend_into=PLACES) if hasattr(c, 'deactivate')]
    derivatives = [(d, d.get_derivative_expression()) for d in block.component_objects(DerivativeVar, descend_into=PLACES)]
    integrals = list(block.component_objects(Integral, descend_into=PLACES))
    try:
        yield
    except BaseException:  # Ctrl-C too
        for suffix, known in marks.items():
            _keep_keys(suffix, known)
        for b, known in names.items():
            for name in set(b.component_map()) - known:
                b.del_component(name)
        for component, known in indices.items():
            for index in set(component._data) - known:
                del component._data[index]
            component.__dict__.pop('_dae_missing_idx', None)
        for component, was in active:
            component._active = was
        record.repeats, record.grids = repeats, grids
        _restore_points(wrt, points, boundaries, info)
        _restore_types(block, derivatives, integrals)
        raise


def _keep_keys(suffix, known):
    keep = ComponentMap((key, None) for key in known)
    for key in [key for key in suffix if key not in keep]:
        del suffix[key]


def _restore_points(wrt, points, boundaries, info):
    for point in set(wrt) - set(points):
        wrt.remove(point)
    wrt._fe = boundaries
    wrt.set_changed(False)
    wrt._discretization_info.clear()
    wrt._discretization_info.update(info)


def _restore_types(block, derivatives, integrals):
    """DerivativeVars and Integrals have become Vars and Expressions; Integrals are built again over the points that are left."""
    for derivative, expression in derivatives:
        derivative.set_derivative_expression(expression)
        if derivative.ctype is not DerivativeVar:
            derivative.parent_block().reclassify_component_type(derivative, DerivativeVar)
    for integral in integrals:
        if integral.ctype is Expression:
            integral.parent_block().reclassify_component_type(integral, Integral)
            integral.clear()
            integral._constructed = False
            integral.construct()
    for b in block.block_data_objects(descend_into=Block):
        b.__dict__.pop('_pyomo_dae_reclassified_derivativevars', None)
