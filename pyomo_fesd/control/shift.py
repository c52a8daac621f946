"""Where each value of a plan comes from when the horizon moves on by some control stages.

With M elements in these stages of the duration dt, element n gets the values of element n + M: states and multipliers at each of
its points, its length, and the law at its boundaries,

    v_n(c_k) := v_{n+M}(c_k),    r_n := r_{n+M},    n = 1..N-M.

Elements may have moved: a control stage keeps its physical time, so element n + M lies as long after the new first time as its
values will lie in element n.  The stages at the end have no source.  Their values are those at the end of the horizon, in elements
of equal length and without jumps: the last mode and the last controls go on.

Takes: a moving grid whose elements after dt are those before it, moved by dt.
Leaves: pairs of variables, target and source; a source may also be a number.
Does not apply: with a free final time, or where the stages differ.
"""

from collections.abc import Iterator

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Var
from pyomo.gdp import Disjunct

from pyomo_fesd.core import FesdError, MovingGrid, TimeIndex, derivatives, index_tuple

#: Labels that differ by less than this part of dt are equal.
SAME = 1e-5


class Shift:
    """The move of all values by the time ``dt``.

    Parameters
    ----------
    moving : MovingGrid
    dt : float
        a number of control stages

    Raises
    ------
    FesdError
        for another time, a free final time, and control stages that differ
    """

    def __init__(self, moving: MovingGrid, dt: float):
        self._moving, self._times = moving, TimeIndex(moving.wrt)
        self._elements = moving.grid.elements
        self._by = _elements_within(moving, dt)
        self._labels = self._source_labels()
        pairs = [*self._of_labels(), *self._of_elements()]
        self._targets, self._sources = [v for v, _ in pairs], [source for _, source in pairs]

    def apply(self) -> None:
        """Give every variable the value of its source."""
        numbers = [source.value if hasattr(source, 'value') else source for source in self._sources]
        for v, number in zip(self._targets, numbers):
            v.set_value(number, skip_validation=True)
        for instant in self._moving.instants.values():
            instant.place()

    def _source_labels(self):
        """Label -> the label whose values it gets; the first time, a right limit, gets those of the first point after it."""
        found, last = {}, self._moving.wrt.last()
        for target in self._elements:
            source = self._element(target.n)
            labels = [last] * len(target.own_labels) if source is None else source.own_labels
            found.update(zip(target.own_labels, labels))
        return found | {self._moving.wrt.first(): self._elements[self._by].points[0]}

    def _element(self, n):
        """The element that element ``n`` gets its values from; None beyond the end."""
        return self._elements[n + self._by - 1] if n + self._by <= len(self._elements) else None

    def _of_labels(self) -> Iterator[tuple]:
        """Pairs of the variables over time."""
        model, first = self._moving.block.model(), self._moving.wrt.first()
        states = ComponentSet(v for d in derivatives(model, self._moving.wrt) for v in d.get_state_var().values())
        begins = self._elements[self._by].left
        variables = model.component_data_objects(Var, descend_into=(Block, Disjunct))
        for by_label in self._times.families(variables).values():
            for label, v in by_label.items():
                source = begins if label == first and v in states else self._labels.get(label)
                if source in by_label:
                    yield v, by_label[source]

    def _of_elements(self) -> Iterator[tuple]:
        """Pairs of the variables over elements and boundaries."""
        moving, number = self._moving, len(self._elements)
        yield from _moved(moving.r, 0, self._by, lambda index: 1.0)
        if moving.limits is not None:
            yield from _moved(moving.limits.copy, 0, self._by, lambda index: _at(moving.limits.copy, index, 0, number))
        if moving.hysteresis is not None:
            for component in (moving.hysteresis.n, moving.hysteresis.m):
                yield from _moved(component, 1, self._by, lambda index, c=component: _at(c, index, 1, number))
        if moving.state_jumps is not None:
            yield from self._of_jumps(moving.state_jumps)

    def _of_jumps(self, jumps):
        """Pairs of the laws of jumps; none acts beyond the end."""
        yield from _moved(jumps.e, 1, self._by, lambda index: 0.0)
        yield from _moved(jumps.copy, 0, self._by, lambda index: None)
        if jumps.impacts is not None:
            impacts = jumps.impacts
            for component in (impacts.impulse, impacts.second, impacts.above, impacts.below, impacts.leaving):
                yield from _moved(component, 1, self._by, lambda index: 0.0)
            for component in (impacts.velocity, impacts.direction):
                yield from _moved(component, 0, self._by, lambda index: None)
            if impacts.drift is not None:
                for component in (impacts.drift, impacts.rate):
                    yield from _moved(component, 1, self._by, lambda index: 0.0)


def _moved(component, position, by, beyond) -> Iterator[tuple]:
    """Pairs of a Var whose index has the number of an element or a boundary at ``position``; ``beyond`` gives others a source."""
    for index, v in component.items():
        full = index_tuple(index)
        source = (*full[:position], full[position] + by, *full[position + 1 :])
        source = source if len(source) > 1 else source[0]
        given = component[source] if source in component else beyond(full)
        if given is not None:
            yield v, given


def _at(component, index, position, number):
    """The data with another number in its index; None if there is none."""
    index = (*index[:position], number, *index[position + 1 :])
    return component[index] if index in component else None


def _elements_within(moving, dt):
    """The number of elements that the time ``dt`` contains.

    Raises
    ------
    FesdError
        as ``Shift``
    """
    wrt, elements = moving.wrt, moving.grid.elements
    if moving.sigma is not None:
        raise FesdError(wrt, "shift: its final time or stage lengths are free", "give the control stages a fixed duration")
    ends = [e.n for e in elements if e.inputs_change and abs(e.left - wrt.first() - dt) <= SAME * dt]
    if not ends:
        stages = sorted(e.left - wrt.first() for e in elements if e.inputs_change and e.n > 1)
        shown = ', '.join(f'{t:g}' for t in stages[:5]) + ', ...' * (len(stages) > 5)
        raise FesdError(wrt, f"shift: no control stage begins {dt:g} after the first time", f"take one of {shown or 'none'}")
    by = ends[0] - 1
    for before, after in zip(elements, elements[by:]):
        if any(abs(a - b - dt) > SAME * dt for a, b in zip((after.left, after.right), (before.left, before.right))):
            raise FesdError(
                wrt,
                f"shift: element {after.n}, [{after.left:g}, {after.right:g}], is not element {before.n}, "
                f"[{before.left:g}, {before.right:g}], moved by {dt:g}",
                "give the control stages the same length and number of elements",
            )
    return by
