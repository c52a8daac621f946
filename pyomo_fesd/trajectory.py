"""Results on physical time: where the labels lie, what the trajectories are, when the modes switch."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Expression, Var, value
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd import marks
from pyomo_fesd.conditions import conditions, positions, positive
from pyomo_fesd.elements.grid import ONE_ELEMENT_SCHEMES, read_grid
from pyomo_fesd.elements.jumps import jumping_states, read_jumps
from pyomo_fesd.elements.lengths import duration
from pyomo_fesd.errors import FesdError
from pyomo_fesd.records import records
from pyomo_fesd.timeindex import TimeIndex, derivatives, discretised, find_continuous_set, strip_time
from pyomo_fesd.values import number


class Switch(NamedTuple):
    """One change of mode at physical ``time`` (units of the ContinuousSet); a sliding mode reads ``sliding a | b``."""

    time: float
    disjunction: str
    before: str
    after: str

    def __str__(self):
        return f"time {self.time:.10g}: {self.disjunction}  {self.before} -> {self.after}"


class Switches(list):
    """The switches in order of time; prints one a line, and ``pandas.DataFrame(switches)`` has the fields as columns."""

    def __repr__(self):
        return '\n'.join(map(str, self)) or 'no switch'

    __str__ = __repr__


def physical_time(model, wrt=None):
    """Physical time of every label of ``wrt``.

    With element lengths h_n a label of element n stands for t_{n,0} + c_r h_n, t_{n,0} the sum of the lengths before
    (theory, eq. 9 and 10), in the time of the plant if the final time or the lengths of the stages are free; on an ordinary
    grid labels are physical time.

    Returns
    -------
    dict label -> float, in order of time
    """
    wrt = find_continuous_set(model, wrt, 'physical_time')
    block = records(model).grids.get(wrt)
    if block is None:
        return {t: float(t) for t in wrt}
    grid = _grid(wrt)
    time = {wrt.first(): float(wrt.first())}
    for element in grid.elements:
        left, h = time[element.left], value(duration(block, element))
        time.update((label, left + c * h) for label, c in zip(element.points, grid.tau))
        time[element.right] = left + h
    return {t: time[t] for t in wrt}


def _grid(wrt):
    if not discretised(wrt):
        raise FesdError(wrt, "it is not discretised yet, so there are no elements", "apply fesd.finite_elements first")
    return read_grid(wrt, [wrt.first(), wrt.last()])


def element_lengths(model, wrt=None):
    """Where each finite element begins and ends on physical time.

    Returns
    -------
    pandas.DataFrame, index ``element`` (1..N), columns ``start``, ``end``, ``length`` (h_n of theory, eq. 10)
    """
    wrt = find_continuous_set(model, wrt, 'element_lengths')
    times, elements = physical_time(model, wrt), _grid(wrt).elements
    start, end = ([times[label] for label in labels] for labels in ((e.left for e in elements), (e.right for e in elements)))
    index = pd.Index([e.n for e in elements], name='element')
    return pd.DataFrame({'start': start, 'end': end, 'length': np.subtract(end, start)}, index=index)


def trajectory(model, wrt=None):
    """Every variable and named expression over time on physical time.

    They are named without their time index (``x``, ``unit.F[a]``); each Disjunction adds the multipliers of its modes
    (``sgn: below``), 1 where the mode is active, 0 where it is not, between in a sliding mode; each condition with two bounds on
    one side adds where it stands (``valve: at lower bound``, ``valve: between``, ``valve: at upper bound``) in the same way.  The
    columns ``element`` and ``label`` tell where a row comes from.

    Returns
    -------
    pandas.DataFrame, index ``time``
    """
    wrt = find_continuous_set(model, wrt, 'trajectory')
    times = physical_time(model, wrt)
    index = TimeIndex(wrt)
    found = model.component_objects((Var, Expression), descend_into=Block)
    owned = (v for v in found if not v.is_reference() and not marks.is_generated(v))
    families = index.families(data for v in owned for data in v.values())
    elements = _elements(wrt, times)
    columns = {'label': list(times), 'element': elements}
    for name, values in families.items():
        columns[strip_time(name)] = [number(values.get(t)) for t in times]
    inside = _grid(wrt).elements if _has_elements(wrt) else ()
    for name, modes in (_multipliers(model, index) | positions(model, wrt, index, inside)).items():
        for mode, weights in modes.items():
            columns[f'{name}: {mode}'] = [number(weights.get(t)) for t in times]
    frame = pd.DataFrame(columns, index=pd.Index(times.values(), name='time'))
    return _with_values_after(frame, model, wrt)


def _with_values_after(frame, model, wrt):
    """A second row, for the states only, where a state jumps: the values after it."""
    states = {strip_time(TimeIndex(wrt).split(x)[1]) for d in derivatives(model, wrt) for x in d.get_state_var().values()}
    rows, place_of = [], {t: k for k, t in enumerate(wrt)}
    for element, label, _, values in jumps_that_happen(model, wrt):
        place = place_of[label]
        row = frame.iloc[[place]].copy()
        row.loc[:, [c for c in frame.columns if c not in states | {'label', 'element'}]] = np.nan
        row['element'] = element.n + 1
        for x, after in values:
            row[strip_time(TimeIndex(wrt).split(x)[1])] = after
        rows.append((place, row))
    for place, row in reversed(rows):
        frame = pd.concat([frame.iloc[: place + 1], row, frame.iloc[place + 1 :]])
    return frame


def row_of_label(model, wrt):
    """Where the row of each label stands in ``trajectory``; a jump has a second row after its own."""
    second, row, rows = {label for _, label, _, _ in jumps_that_happen(model, wrt)}, 0, {}
    for label in wrt:
        rows[label] = row
        row += 2 if label in second else 1
    return rows


def jumps_that_happen(model, wrt):
    """``(element before, its right label, name, [(VarData, value after)])`` of every state jump, in order of time."""
    block = records(model).grids.get(wrt)
    home = None if block is None else block.component('jumps')
    jumps = [] if home is None else read_jumps(model, wrt)
    for element in _grid(wrt).elements[:-1] if jumps else ():
        names = [j.name for j in jumps if (home.e[j.name, element.n].value or 0.0) > 0.5]
        if names:
            states = jumping_states(jumps, element.right)
            after = [(x, home.after[element.n, j].value) for j, x in enumerate(states, start=1)]
            yield element, element.right, ', '.join(names), after


def _has_elements(wrt):
    return discretised(wrt) and wrt.get_discretization_info()['scheme'] in ONE_ELEMENT_SCHEMES


def _elements(wrt, times):
    if not _has_elements(wrt):
        return [0] * len(times)
    owner = _grid(wrt).element_of()
    return [owner[t].n if t in owner else 1 for t in times]


def _multipliers(model, index):
    """``{disjunction: {mode: {label: expression}}}`` of every Disjunction over time that ``fesd.dcs`` transformed."""
    weights = ComponentMap(marks.marked(model, marks.INDICATOR))
    found = {}
    for name, family in index.families(model.component_data_objects(Disjunction, descend_into=(Block, Disjunct))).items():
        modes = {}
        for t, disjunction in family.items():
            for i, disjunct in enumerate(disjunction.disjuncts, start=1):
                if disjunct in weights:
                    modes.setdefault(_mode_name(disjunction, disjunct, i, index), {})[t] = weights[disjunct]
        if modes:
            found[strip_time(name)] = modes
    return found


def _mode_name(disjunction, disjunct, number, index):
    """The Disjunct's own name without time; a mode written as a list of expressions is called by its number."""
    component = disjunct.parent_component()
    if component is disjunction.parent_component()._autodisjuncts:
        return f'mode {number}'
    return strip_time(index.split(disjunct)[1].split('.')[-1])


def switches(model, wrt=None):
    """When which Disjunction, surface of a function in pieces, or hand-written Complementarity over time changes its active set.

    An element of a moving grid has one active set (eq. 11), so switches lie on element boundaries.

    Returns
    -------
    Switches
        list of ``Switch(time, disjunction, before, after)``
    """
    wrt = find_continuous_set(model, wrt, 'switches')
    grid, index, found = _grid(wrt), TimeIndex(wrt), Switches()
    times = physical_time(model, wrt)
    systems = _multipliers(model, index) | conditions(model, wrt, index) | _surfaces(model, index)
    for name, modes in systems.items():
        before = None
        for element in grid.elements:
            active = _active(modes, element)
            if active is None:
                continue
            if before is not None and active != before:
                found.append(Switch(times[element.left], name, before, active))
            before = active
    for _, label, name, values in jumps_that_happen(model, wrt):
        sides = [', '.join(f'{strip_time(index.split(x)[1])} = {v:.6g}' for x, v in both) for both in _both_sides(values)]
        found.append(Switch(times[label], name, *sides))
    return Switches(sorted(found, key=lambda s: s.time))


def _both_sides(values):
    return [(x, value(x)) for x, _ in values], values


def _active(modes, element):
    """The mode with a positive multiplier inside an element; several slide; None where nothing tells."""
    on = positive(modes, element.points) or positive(modes, (element.left,))
    if not on:
        return None
    return on[0] if len(on) == 1 else 'sliding ' + ' | '.join(on)


def _surfaces(model, index):
    """Surfaces of functions in pieces as systems of two modes, the sides."""
    found = {}
    for v, (name, sides) in marks.marked(model, marks.SIDES):
        for side, weight in sides.items():
            found.setdefault(name, {}).setdefault(side, {})[index.time(v)] = weight
    return found
