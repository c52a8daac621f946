"""A model's NL file, for users who want to keep one.

Takes: an ``Mpcc``.
Leaves: a file with its objective, its rows, and one row for each side of a pair that is not a variable.
"""

import tempfile
from contextlib import contextmanager
from math import isfinite

from pyomo.common.collections import ComponentMap
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, ConstraintList, Objective, Suffix, Var
from pyomo.core.expr.numvalue import is_potentially_variable
from pyomo.repn.plugins.nl_writer import NLWriter

from pyomo_fesd.core import DeferredInterrupt, FesdError
from pyomo_fesd.mpcc.compile.model_values import start_value
from pyomo_fesd.mpcc.compile.row_reader import readable


def write(problem, folder) -> None:
    """Write a file of a new name in ``folder``; other processes and threads may write to the same folder.

    Raises
    ------
    FesdError
        where no file can be written, and for expressions of fixed values that have none
    Contradiction
        where fixed values alone violate a constraint
    """
    try:
        # never an existing file, nor what a link points to
        descriptor, _ = tempfile.mkstemp('.nl', 'model_', folder)
    except OSError as error:
        raise FesdError(f"working_dir='{folder}'", f"the NL file cannot be written: {error}", "give a folder to write to") from None
    model = problem.model
    with (
        DeferredInterrupt() as interrupt,
        open(descriptor, 'w', newline='') as stream,
        _sides_as_rows(problem),
        _without_exported_suffixes(model),
        _plain_values(model),
        interrupt.raising(),
        readable(model),
    ):
        NLWriter().write(model, stream, linear_presolve=False, scale_model=False, symbolic_solver_labels=False)


@contextmanager
def _sides_as_rows(problem):
    """Rows for the sides, on a temporary block, in place of the complementarities, which the NL writer refuses."""
    model, block = problem.model, Block()
    model.add_component(unique_component_name(model, '_pyomo_fesd_sides'), block)
    block.row = ConstraintList()
    deactivated = _deactivate(problem.sources)
    try:
        if problem.objective is None:
            block.objective = Objective(expr=0)
        for side in (side for c in problem.conditions for side in (c.G, c.H)):
            if is_potentially_variable(side) and side.is_expression_type():
                block.row.add(side >= 0)
        yield
    finally:
        model.del_component(block)
        _activate(deactivated)


def _deactivate(datas):
    """Deactivate the components of all ``datas``; returns the datas by component."""
    components = ComponentMap()
    for data in datas:
        components.setdefault(data.parent_component(), []).append(data)
    for component in components:
        component.deactivate()
    return components


def _activate(components):
    for component, datas in components.items():
        component._active = True
        for data in datas:
            data.activate()


@contextmanager
def _plain_values(model):
    """Start values that are arrays of one number become floats, and those that are no number None, while the file is written."""
    before = [
        (v, v.value)
        for v in model.component_data_objects(Var, descend_into=Block)
        if v.value is not None and not v.fixed and not (v.value.__class__ is float and isfinite(v.value))
    ]
    for v, now in before:
        v.set_value(start_value(now), skip_validation=True)
    try:
        yield
    finally:
        for v, now in before:
            v.set_value(now, skip_validation=True)


@contextmanager
def _without_exported_suffixes(model):
    """Deactivate the suffixes that the NL writer would export."""
    suffixes = [s for s in model.component_objects(Suffix, active=True, descend_into=Block) if s.export_enabled()]
    for suffix in suffixes:
        suffix.deactivate()
    try:
        yield
    finally:
        for suffix in suffixes:
            suffix.activate()
