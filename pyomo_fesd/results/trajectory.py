"""Trajectories on physical time, as columns and rows of a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.common.dependencies import pandas as pd
from pyomo.core import Block, Expression, Var, value
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import (
    TimeIndex,
    derivatives,
    find_continuous_set,
    is_generated,
    moving_grids,
    own_components,
    strip_time,
    value_or_nan,
)
from pyomo_fesd.results.complementarity_modes import complementarity_positions
from pyomo_fesd.results.disjunction_modes import disjunction_modes
from pyomo_fesd.results.physical_time import elements_if_any, physical_time


@dataclass(frozen=True)
class Column:
    """One column of a trajectory.

    Attributes
    ----------
    name : str
        of a variable, an expression, a Disjunction, or a condition with two bounds on one side
    mode : str or None
        the mode whose multiplier it is; None for variables and expressions
    values : dict label -> expression
    """

    name: str
    mode: str | None
    values: dict

    @property
    def title(self) -> str:
        """The title in the DataFrame."""
        return self.name if self.mode is None else f'{self.name}: {self.mode}'


@dataclass(frozen=True)
class Row:
    """One row of a trajectory.

    Attributes
    ----------
    label : float
    element : int
    after : ComponentMap or None
        in a second row the states after the jump
    """

    label: float
    element: int
    after: ComponentMap | None = None

    def number(self, expr) -> float:
        """Return the value of an expression; nan where it has none, and for all but states after a jump."""
        return value_or_nan(expr) if self.after is None else self.after.get(expr, np.nan)


def trajectory(model: Block, wrt: ContinuousSet | None = None) -> pd.DataFrame:
    """Return every variable and named expression over time on physical time.

    They are named without their time index (``x``, ``unit.F[a]``); each Disjunction adds the multipliers of its modes
    (``sgn: below``), 1 where the mode is active, 0 where it is not, between in a sliding mode; each condition with two bounds on
    one side adds its position (``valve: at lower bound``, ``valve: between``, ``valve: at upper bound``) in the same way.  The
    columns ``element`` and ``label`` give the origin of a row.  Where a state jumps there is a second row, with the states after
    the jump only.

    Returns
    -------
    pandas.DataFrame, index ``time``
    """
    wrt = find_continuous_set(model, wrt, 'trajectory')
    times, rows = physical_time(model, wrt), rows_over_time(model, wrt)
    table = {'label': [r.label for r in rows], 'element': [r.element for r in rows]}
    for column in columns_over_time(model, wrt):
        table[column.title] = [r.number(column.values.get(r.label)) for r in rows]
    return pd.DataFrame(table, index=pd.Index([times[r.label] for r in rows], name='time'))


def columns_over_time(model: Block, wrt: ContinuousSet) -> Iterator[Column]:
    """Yield the columns of a trajectory: variables and expressions, then the multipliers of modes."""
    times = TimeIndex(wrt)
    own = (c for c in own_components(model, (Var, Expression), Block) if not is_generated(c))
    for name, by_time in times.families_in(own).items():
        yield Column(strip_time(name), None, by_time)
    systems = disjunction_modes(model, times) | complementarity_positions(model, wrt, times, elements_if_any(wrt))
    for name, modes in systems.items():
        for mode, weights in modes.items():
            yield Column(name, mode, weights)


def rows_over_time(model: Block, wrt: ContinuousSet) -> list[Row]:
    """Return the rows of a trajectory: one for each label, two where a state jumps."""
    jumps = {label: (before.n + 1, values) for before, label, _, values in jumps_that_happen(model, wrt)}
    states, rows = [v for d in derivatives(model, wrt) for v in d.get_state_var().values()] if jumps else [], []
    times, found = TimeIndex(wrt), elements_if_any(wrt)
    number = {t: e.n for e in found for t in e.own_labels}
    for label in wrt:
        rows.append(Row(label, number.get(label, 1) if found else 0))
        if label in jumps:
            n, values = jumps[label]
            # states that do not jump keep their values
            known = [(v, v.value) for v in states if times.time(v) == label]
            rows.append(Row(label, n, ComponentMap([*known, *values])))
    return rows


def jumps_that_happen(model: Block, wrt: ContinuousSet) -> Iterator[tuple]:
    """Yield ``(element before, its right label, name, [(VarData, value after)])`` of every state jump, in order of time."""
    moving = moving_grids(model).get(wrt)
    if moving is None or moving.state_jumps is None:
        return
    for element in moving.grid.elements[:-1]:
        names = moving.state_jumps.active(element.n)
        if names:
            after = [(x, value(expr)) for x, expr in moving.state_jumps.values_after(element).items()]
            yield element, element.right, ', '.join(names), after
