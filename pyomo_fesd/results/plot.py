"""Plots of trajectories with element boundaries and switches."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from pyomo.core import Block
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import FesdError, derivatives, find_continuous_set, is_generated
from pyomo_fesd.results.physical_time import element_lengths, elements
from pyomo_fesd.results.switches import switches
from pyomo_fesd.results.trajectory import columns_over_time, rows_over_time, trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot(
    model: Block, wrt: ContinuousSet | None = None, names: list[str] | None = None, units: dict[str, str] | None = None
) -> Figure:
    """Draw trajectories, one panel each, element boundaries as light lines and switches as dashed ones.

    Parameters
    ----------
    names : list of str, optional
        columns of ``trajectory``; a name of an indexed variable (``M``) selects all its columns (``M[1]``, ``M[2]``), the name of
        a Disjunction its multipliers.  Default: the differential states and all multipliers.
    units : dict, optional
        label of the vertical axis by name

    Returns
    -------
    matplotlib.figure.Figure
        a notebook shows it; it is not registered with pyplot: save it with ``savefig``

    Raises
    ------
    FesdError
        for a name that is not a column
    """
    wrt = find_continuous_set(model, wrt, 'plot')
    names, units = _checked_names(names), _checked_units(units)
    frame, columns = trajectory(model, wrt), list(columns_over_time(model, wrt))
    names = names or _states_and_multipliers(model, wrt, columns)
    groups = [(name, _named(columns, name)) for name in names]
    boundaries = element_lengths(model, wrt)['end']
    # matplotlib takes longer to import than a small model to solve
    from pyomo_fesd.results.notebook_figure import NotebookFigure

    figure = NotebookFigure(figsize=(7, 1 + 1.9 * len(groups)), layout='constrained')
    axes = np.atleast_1d(figure.subplots(len(groups), 1, sharex=True))
    for axis, (name, group) in zip(axes, groups):
        for column in group:
            _draw(axis, frame, column, model, wrt)
        axis.set_ylabel(units.get(name, name))
        if len(group) > 1:
            axis.legend(fontsize='small')
        for switch in switches(model, wrt):
            axis.axvline(switch.time, color='0.4', linestyle='--', linewidth=0.8)
        for boundary in boundaries:
            axis.axvline(boundary, color='0.9', linewidth=0.6, zorder=0)
        axis.margins(x=0.01)
    axes[-1].set_xlabel(wrt.local_name)
    return figure


def _checked_names(names):
    if isinstance(names, str):
        return [names]
    if names is not None and not (isinstance(names, Iterable) and all(isinstance(name, str) for name in names)):
        raise FesdError('plot', f"names={names!r} is not a list of names", "give columns of the trajectory, e.g. ['x', 'sgn']")
    return list(names or ())


def _checked_units(units):
    if units is not None and not isinstance(units, Mapping):
        raise FesdError('plot', f"units={units!r} is not a dictionary", "give a label for each name, e.g. {'x': 'x in m'}")
    return units or {}


def _states_and_multipliers(model, wrt, columns):
    """Names of the differential states, and of the Disjunctions that have multipliers."""
    states = dict.fromkeys(d.get_state_var().name for d in derivatives(model, wrt) if not is_generated(d))
    return [*states, *dict.fromkeys(c.name for c in columns if c.mode is not None)]


def _named(columns, name):
    """The columns of one title, of one indexed variable, or of one Disjunction."""
    found = [c for c in columns if name in (c.title, c.name) or c.name.startswith(f'{name}[')]
    if not found:
        raise FesdError(name, "plot: no trajectory of this name", f"one of: {', '.join(c.title for c in columns)}")
    return found


def _draw(axis, frame, column, model, wrt):
    """States as lines through all points; multipliers element by element, as they jump at boundaries."""
    if column.mode is None:
        axis.plot(frame.index, frame[column.title], '.-', markersize=3, linewidth=1.2, label=column.title)
        return
    color = axis._get_lines.get_next_color()
    row = {r.label: k for k, r in enumerate(rows_over_time(model, wrt)) if r.after is None}
    for k, element in enumerate(elements(wrt)):
        inside = [row[t] for t in element.own_labels]
        values = frame[column.title].iloc[[inside[0], *inside]]
        time = frame.index[[row[element.left], *inside]]
        axis.plot(time, values, '-', color=color, linewidth=1.2, label=column.mode if k == 0 else None)
