"""Pictures of trajectories with the elements and the switches marked."""

import numpy as np
from matplotlib.figure import Figure

from pyomo_fesd.elements.grid import read_grid
from pyomo_fesd.errors import FesdError
from pyomo_fesd.marks import is_generated
from pyomo_fesd.timeindex import derivatives, find_continuous_set
from pyomo_fesd.trajectory import element_lengths, rows_over_time, switches, trajectory


def plot(model, wrt=None, names=None, units=None):
    """Draw trajectories, one panel each, element boundaries as light lines and switches as dashed ones.

    Parameters
    ----------
    names : list of str, optional
        columns of ``trajectory``; a name of an indexed variable (``M``) takes all its columns (``M[1]``, ``M[2]``), the name of
        a Disjunction its multipliers.  Default: the differential states and all multipliers.
    units : dict, optional
        label of the vertical axis by name

    Returns
    -------
    matplotlib.figure.Figure
        not shown and not registered with pyplot: save it with ``savefig``

    Raises
    ------
    FesdError
        for a name that is no column
    """
    wrt = find_continuous_set(model, wrt, 'plot')
    frame = trajectory(model, wrt)
    names = names or _states_and_multipliers(model, wrt, frame)
    groups = [(name, _columns(frame, name)) for name in names]
    boundaries = element_lengths(model, wrt)['end']
    figure = Figure(figsize=(7, 1 + 1.9 * len(groups)), layout='constrained')
    axes = np.atleast_1d(figure.subplots(len(groups), 1, sharex=True))
    for axis, (name, columns) in zip(axes, groups):
        for column in columns:
            _draw(axis, frame, column, model, wrt)
        axis.set_ylabel((units or {}).get(name, name))
        if len(columns) > 1:
            axis.legend(fontsize='small')
        for switch in switches(model, wrt):
            axis.axvline(switch.time, color='0.4', linestyle='--', linewidth=0.8)
        for boundary in boundaries:
            axis.axvline(boundary, color='0.9', linewidth=0.6, zorder=0)
        axis.margins(x=0.01)
    axes[-1].set_xlabel(wrt.local_name)
    return figure


def _states_and_multipliers(model, wrt, frame):
    """Names of the differential states, and of the Disjunctions that have multipliers."""
    states = dict.fromkeys(d.get_state_var().name for d in derivatives(model, wrt) if not is_generated(d))
    disjunctions = dict.fromkeys(c.split(': ')[0] for c in frame.columns if ': ' in c)
    return [*states, *disjunctions]


def _columns(frame, name):
    found = [c for c in frame.columns if c == name or c.startswith((f'{name}[', f'{name}: '))]
    if not found:
        raise FesdError(name, "plot: no trajectory of this name", f"one of: {', '.join(map(str, frame.columns[2:]))}")
    return found


def _draw(axis, frame, column, model, wrt):
    """States as lines through all points; multipliers element by element, as they jump at boundaries."""
    label = column.split(': ')[-1]
    if ': ' not in column:
        axis.plot(frame.index, frame[column], '.-', markersize=3, linewidth=1.2, label=label)
        return
    color = axis._get_lines.get_next_color()
    row = {r.label: k for k, r in enumerate(rows_over_time(model, wrt)) if r.after is None}
    for k, element in enumerate(read_grid(wrt, [wrt.first(), wrt.last()]).elements):
        inside = [row[t] for t in dict.fromkeys((*element.points, element.right))]
        values = frame[column].iloc[[inside[0], *inside]]
        time = frame.index[[row[element.left], *inside]]
        axis.plot(time, values, '-', color=color, linewidth=1.2, label=label if k == 0 else None)
