"""Results on physical time: where the labels lie, what the trajectories are, when the modes switch."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Expression, Var, value
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd import marks
from pyomo_fesd.conditions import conditions, positions, positive
from pyomo_fesd.elements.grid import ONE_ELEMENT_SCHEMES, read_grid
from pyomo_fesd.elements.jumps import read_jumps, values_after
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
    columns ``element`` and ``label`` tell where a row comes from.  Where a state jumps there is a second row, with the states
    after the jump only.

    Returns
    -------
    pandas.DataFrame, index ``time``
    """
    wrt = find_continuous_set(model, wrt, 'trajectory')
    times, rows = physical_time(model, wrt), rows_over_time(model, wrt)
    index = TimeIndex(wrt)
    found = model.component_objects((Var, Expression), descend_into=Block)
    owned = (v for v in found if not v.is_reference() and not marks.is_generated(v))
    families = index.families(data for v in owned for data in v.values())
    inside = _grid(wrt).elements if _has_elements(wrt) else ()
    columns = {'label': [r.label for r in rows], 'element': [r.element for r in rows]}
    for name, values in families.items():
        columns[strip_time(name)] = [r.number(values.get(r.label)) for r in rows]
    for name, modes in (_multipliers(model, index) | positions(model, wrt, index, inside)).items():
        for mode, weights in modes.items():
            columns[f'{name}: {mode}'] = [r.number(weights.get(r.label)) for r in rows]
    return pd.DataFrame(columns, index=pd.Index([times[r.label] for r in rows], name='time'))


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
    after: object = None

    def number(self, expr):
        """Value of an expression; nan where it has none, and for all but states after a jump."""
        return number(expr) if self.after is None else self.after.get(expr, np.nan)


def rows_over_time(model, wrt):
    """The rows of a trajectory: one for each label, two where a state jumps."""
    after = {label: (before.n + 1, values) for before, label, _, values in jumps_that_happen(model, wrt)}
    states, rows = [d.get_state_var() for d in derivatives(model, wrt)] if after else [], []
    times = TimeIndex(wrt)
    for label, element in zip(wrt, _elements(wrt, wrt)):
        rows.append(Row(label, element))
        if label in after:
            n, values = after[label]
            # what does not jump goes on
            known = ComponentMap((v, v.value) for x in states for v in x.values() if times.time(v) == label)
            known.update(values)
            rows.append(Row(label, n, known))
    return rows


def jumps_that_happen(model, wrt):
    """``(element before, its right label, name, [(VarData, value after)])`` of every state jump, in order of time."""
    block = records(model).grids.get(wrt)
    home = None if block is None else block.component('jumps')
    jumps = [] if home is None else read_jumps(model, wrt)
    for element in _grid(wrt).elements[:-1] if jumps else ():
        names = [j.name for j in jumps if (home.e[j.name, element.n].value or 0.0) > 0.5]
        if names:
            after = [(x, value(expr)) for x, expr in values_after(home, jumps, element).items()]
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
