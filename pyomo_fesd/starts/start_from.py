"""``start_from``: start values from a trajectory on physical time.

Takes: a model after ``fesd.finite_elements``; a table as ``trajectory`` returns it, with some of its columns, or another model.
Leaves: values of all variables over time, and of the element lengths.
Does not apply: to states and inputs without a column, which keep their values.
"""

from __future__ import annotations

from collections.abc import Iterator

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.common.dependencies import pandas as pd
from pyomo.common.gc_manager import PauseGC
from pyomo.core import Block, Var
from pyomo.dae import ContinuousSet
from pyomo.gdp import Disjunct

from pyomo_fesd.core import (
    FesdError,
    TimeIndex,
    derivatives,
    find_continuous_set,
    interruptible,
    is_generated,
    moving_grids,
    refuse_no_model,
)
from pyomo_fesd.results import columns_over_time, trajectory
from pyomo_fesd.simulation import evaluate_scalars, timeless_equations
from pyomo_fesd.starts.boundary_values import set_hysteresis, set_jumps
from pyomo_fesd.starts.consistent_values import make_consistent
from pyomo_fesd.starts.element_placement import check_horizon, free_durations, place_elements, set_within_bounds
from pyomo_fesd.starts.held_controls import held_intervals
from pyomo_fesd.starts.impulses import set_impulses, set_parts
from pyomo_fesd.starts.time_table import ELEMENT, LABEL, TimeTable


@interruptible
def start_from(model: Block, source: pd.DataFrame | Block, wrt: ContinuousSet | None = None) -> None:
    """Give a model start values from a trajectory, or from the values of another model.

    Parameters
    ----------
    model : Block
        after ``fesd.finite_elements``
    source : pandas.DataFrame or Block
        a table with physical time as its index and columns named as by ``trajectory``; some of them are enough.  Two rows of the
        same time are the values left and right of a jump.  Or another model with the same names, on any grid: its ``trajectory``,
        its variables without time, and only what both models have.
    wrt : ContinuousSet, optional

    Notes
    -----
    Fixed variables keep their values, and so do states and inputs without a column; values outside of bounds are set to the bound.

    * Elements end where the table jumps, and, if it has the column ``element`` of a ``trajectory``, where its elements end, as long
      as each control stage has enough of them; otherwise the lengths stay as they are.  A free final time is that of the table.
    * Columns are interpolated linearly; before its first and after its last row a column is constant.
    * Multipliers of modes are those of the next row.  A control that is held gets the mean over its control stage of what the
      rows give, each of them since the row before.
    * What follows from these values is computed: derivatives, other algebraic variables, the parts and multipliers of switching
      functions, variables of element boundaries, and integrals.  Impulses of a ``contact`` keep their values: ``simulate`` finds
      them.

    Raises
    ------
    FesdError
        for a name that the model does not have, missing values, and times that are not in order or outside of the horizon; the
        model is then unchanged
    """
    refuse_no_model(model, 'start_from')
    wrt = find_continuous_set(model, wrt, 'start_from')
    if wrt not in moving_grids(model):
        raise FesdError(wrt, "start_from: its elements are not movable", "apply fesd.finite_elements first")
    columns = {c.title: c for c in columns_over_time(model, wrt)}
    is_model = hasattr(source, 'component_objects')
    table = TimeTable(_table_of(source, model, wrt, columns) if is_model else source, columns)
    constants = list(_constants(model, source, TimeIndex(wrt))) if is_model else []
    moving = moving_grids(model)[wrt]
    durations = free_durations(moving, table)
    if not durations:
        check_horizon(moving, table)
    with PauseGC():
        for v, number in (*durations.items(), *constants):
            set_within_bounds(v, number)
        place_elements(moving, table)
        _set_values(model, moving, table, columns)
        times = TimeIndex(wrt)
        evaluate_scalars(model, times, timeless_equations(model, times))


def _table_of(source, model, wrt, columns):
    """The trajectory of another model over the ContinuousSet of the same name, with the columns that both have."""
    refuse_no_model(source, 'start_from')
    other = source.find_component(wrt.getname(fully_qualified=True, relative_to=model))
    if getattr(other, 'ctype', None) is not ContinuousSet:
        raise FesdError(source, f"start_from: it has no ContinuousSet '{wrt.name}'", "give a model with the same names")
    frame = trajectory(source, other)
    common = [title for title in frame.columns if title in columns]
    if not common:
        raise FesdError(source, "start_from: it has no variable over time that the model has", "give a model with the same names")
    return frame[[LABEL, ELEMENT, *common]]


def _constants(model, source, times) -> Iterator[tuple]:
    """``(VarData, value)`` of the user's variables without time."""
    for v in model.component_data_objects(Var, descend_into=Block):
        if not v.fixed and times.time(v) is None and not is_generated(v):
            other = source.find_component(v.getname(fully_qualified=True, relative_to=model))
            if other is not None and getattr(other, 'ctype', None) is Var and not other.is_indexed():
                yield v, other.value


def _set_values(model, moving, table, columns):
    """Set what the table gives, then what follows from it."""
    times, physical = TimeIndex(moving.wrt), moving.physical_time()
    given = _given(table, columns)
    held = _set_held(moving, times, given)
    for v, series in given.items():
        if not v.fixed and v not in held:
            set_within_bounds(v, series.at(physical[times.time(v)]))
    set_jumps(moving, times, table)
    set_impulses(moving, times, table)
    states = (v for d in derivatives(model, moving.wrt) for v in d.get_state_var().values())
    known = ComponentSet([*states, *held, *given])
    variables = model.component_data_objects(Var, descend_into=(Block, Disjunct))
    unknown = ComponentSet(v for v in variables if not v.fixed and v not in known and times.time(v) is not None)
    if moving.state_jumps is not None:
        unknown.update(moving.state_jumps.copy.values())
    make_consistent(moving, list(_weights(table, columns, physical)), unknown)
    set_hysteresis(moving)
    set_parts(moving, times)


def _columns_of_variables(columns):
    """``(title, {label: VarData})`` of the columns of variables."""
    for title, column in columns.items():
        if column.mode is None:
            by_label = {t: v for t, v in column.values.items() if v.is_variable_type()}
            if by_label:
                yield title, by_label


def _given(table, columns):
    """Var -> the column that gives its value."""
    found = ComponentMap()
    for title, by_label in _columns_of_variables(columns):
        series = table.series(title)
        if series is not None:
            found.update((v, series) for v in by_label.values())
    return found


def _set_held(moving, times, given):
    """Set the controls that are held on each control stage; returns all of them."""
    held = ComponentSet()
    for controls, begin, end in held_intervals(moving, times):
        held.update(controls)
        for v in controls:
            if v in given and not v.fixed:
                set_within_bounds(v, given[v].mean(begin, end))
    return held


def _weights(table, columns, physical):
    """``(expression, number)`` of the multipliers of modes that the table gives."""
    for title, column in columns.items():
        series = table.series(title)
        if column.mode is not None and series is not None:
            for label, weight in column.values.items():
                if hasattr(weight, 'is_expression_type'):
                    yield weight, series.held(physical[label])
