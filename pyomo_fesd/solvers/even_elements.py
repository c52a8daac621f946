"""The values of a point on elements that are shared evenly between its switches.

A homotopy that starts far from a solution may bring a switch in from an end of the horizon: the elements that it passes stay on its
other side, and what lies behind it is left with one long element.  Here every piece of a control stage, between two switches, gets
elements of equal length, so many that the longest one is shortest; between the boundaries the values are those of the collocation
polynomials.  The switches are element boundaries again, so the values name the branch of the new elements.

Takes: a model with moving grids, and a point of its compiled form.
Leaves: an array; the model as it was.
Does not apply: to grids without step equilibration, and to those with hysteresis or state jumps, which have variables at element
boundaries only; they keep their elements.
"""

from collections.abc import Callable, Iterator

import numpy as np
from pyomo.core import Block, Var, value
from pyomo.gdp import Disjunct

from pyomo_fesd.core import (
    MovingGrid,
    TimeIndex,
    derivatives,
    interpolation_weights,
    kept_values,
    moving_grids,
    numbers_of_elements,
)


def even_elements(model: Block, compiled) -> Callable | None:
    """Return a function that shares the elements of a point evenly; None where no grid of the model allows it.

    It takes an array in the units of ``compiled`` (MpccFunctions), and returns another one, or None where all elements are
    shared so already.
    """
    grids = [moving for moving in moving_grids(model).values() if _applies(moving)]
    return (lambda w: _shared(model, compiled, grids, w)) if grids else None


def _applies(moving):
    return moving.equilibration is not None and moving.hysteresis is None and moving.state_jumps is None


def _shared(model, compiled, grids, w):
    variables = list(model.component_data_objects(Var, descend_into=(Block, Disjunct)))
    with kept_values(variables):
        _set(zip(compiled.variables, compiled.values(w)))
        moved = [change for moving in grids for change in _Grid(moving, variables).changes()]
        _set(moved)
        return compiled.present_values() if moved else None


def _set(changes):
    for v, number in changes:
        if not v.fixed:
            v.set_value(float(number), skip_validation=True)


class _Grid:
    """A moving grid with the values that its variables have now."""

    def __init__(self, moving: MovingGrid, variables):
        self._moving, self._tau = moving, moving.grid.tau
        times = TimeIndex(moving.wrt)
        states = {times.split(v)[1] for d in derivatives(moving.block.model(), moving.wrt) for v in d.get_state_var().values()}
        self._families = [(name in states, by_label) for name, by_label in times.families(variables).items()]

    def changes(self) -> Iterator[tuple]:
        """Yield ``(VarData, number)`` of all control stages whose elements are not shared evenly."""
        for elements in self._moving.grid.stages.values():
            pieces = self._pieces(elements)
            lengths = [[value(self._moving.element_length(e)) for e in piece] for piece in pieces]
            numbers = numbers_of_elements([sum(h) for h in lengths], len(elements))
            if numbers != [len(piece) for piece in pieces]:
                waiting = iter(elements)
                for piece, h, number in zip(pieces, lengths, numbers):
                    yield from self._placed([next(waiting) for _ in range(number)], piece, np.cumsum([0.0, *h]))

    def _pieces(self, elements):
        """Runs of elements without a switch."""
        pieces = [[elements[0]]]
        for before, after in zip(elements, elements[1:]):
            if value(self._moving.eta[before.n]) < 0.5:
                pieces.append([])
            pieces[-1].append(after)
        return pieces

    def _placed(self, elements, piece, nodes):
        """Elements of equal length, in place of those of a piece with the boundaries ``nodes``."""
        h = nodes[-1] / len(elements)
        for k, element in enumerate(elements):
            yield self._moving.r[element.n], h / element.length
            places = (k + np.array([*self._tau, 1.0][: len(element.own_labels)])) * h
            for label, place in zip(element.own_labels, places):
                n = min(max(int(np.searchsorted(nodes, place)) - 1, 0), len(piece) - 1)
                yield from self._values(label, piece[n], (place - nodes[n]) / (nodes[n + 1] - nodes[n]))

    def _values(self, label, element, place):
        """Each variable at a label, with the value of its polynomial at the relative ``place`` of an element."""
        for is_state, by_label in self._families:
            labels = (element.left, *element.points) if is_state else element.points
            if label in by_label and all(t in by_label and by_label[t].value is not None for t in labels):
                nodes = [0.0, *self._tau] if is_state else self._tau
                weights = interpolation_weights(nodes, [place**k for k in range(len(nodes))])
                yield by_label[label], weights @ [by_label[t].value for t in labels]
