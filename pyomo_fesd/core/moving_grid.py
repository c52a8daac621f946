"""The record of a moving grid: elements whose lengths are variables, and what ``fesd.finite_elements`` put on them.

Written by ``fesd.finite_elements`` (the instants by ``at``); read by simulation, refinement, diagnostics and results.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Model, value
from pyomo.core.base.var import VarData
from pyomo.dae import ContinuousSet
from pyomo.mpec import Complementarity

from pyomo_fesd.core.grid import Element, Grid
from pyomo_fesd.core.own_data import declared

_SCOPE = 'pyomo_fesd.core.moving_grid'


@dataclass(frozen=True)
class Split:
    """The pairs that replace one mixed condition l <= x <= u perp F = p - n.

    Attributes
    ----------
    p, n : VarData or None
        the positive and the negative part of F; None where x is given, or l = u
    """

    p: VarData | None = None
    n: VarData | None = None


class MovingGrid(AutoSlots.Mixin):
    """One ContinuousSet with elements of variable length h_n = r_n hbar_n.

    Attributes
    ----------
    wrt : ContinuousSet
    block : Block
        the generated block that holds the lengths, pairs and equations below
    grid : Grid
        the nominal elements, hbar_n, with the stages between boundaries that keep their time, and the scheme
    r : Var over 1..N
        length multipliers r_n
    sigma : Expression over 1..N, or None
        time of the plant in one unit of the labels, where the final time or the lengths of the control stages are variables
    held : Constraint or None
        equations that hold controls constant on each control stage
    complementarities : list of TimeComplementarity
        the complementarity conditions over time
    pairs : Complementarity or None
        the aggregated pairs of eq. (11), by (condition, element, ...)
    sources : ComponentMap
        aggregated pair -> the user's conditions at single times that it sums up
    splits : ComponentMap
        a user's mixed condition -> the ``Split`` that replaces it
    split_sources : ComponentMap
        a pair of a ``Split`` -> the user's mixed condition
    nonnegative : Constraint or None
        signs of sides that bounds do not imply
    sign_after : Constraint or None
        signs of sides after a state jump, by (condition, element, side)
    left_limit : Constraint or None
        Gauss: multipliers at element boundaries, which are not collocation points
    limits : Block or None
        ``copy`` and ``copied`` by element: values right of the left boundary of variables that jump with the modes
    activity : Expression or None
        activity theta_n of step equilibration, by (condition, element)
    eta : Expression or None
        by element: 1 where nothing switches between n and n + 1, else 0 (eq. 12)
    equilibration : Complementarity or None
        the pairs of step equilibration, by element
    state_jumps : StateJumps or None
    hysteresis : Hysteresis or None
    explicit_time : tuple of str
        names of what depends on the time label
    instants : dict
        physical time -> ``Instant``
    begin : float or None
        physical time at which the first element begins, of elements that march along; else the first label
    known : int
        number of first elements that were there in the round before, of elements that march along; else 0
    """

    __slots__ = (
        'wrt',
        'block',
        'grid',
        'r',
        'sigma',
        'held',
        'complementarities',
        'pairs',
        'sources',
        'splits',
        'split_sources',
        'nonnegative',
        'sign_after',
        'left_limit',
        'limits',
        'activity',
        'eta',
        'equilibration',
        'state_jumps',
        'hysteresis',
        'explicit_time',
        'instants',
        'begin',
        'known',
    )

    def __init__(self, wrt: ContinuousSet, block: Block, grid: Grid):
        for name in self.__slots__:
            setattr(self, name, None)
        self.wrt, self.block, self.grid = wrt, block, grid
        self.complementarities, self.explicit_time, self.instants, self.known = [], (), {}, 0
        self.sources, self.splits, self.split_sources = ComponentMap(), ComponentMap(), ComponentMap()

    @property
    def new_elements(self) -> tuple[Element, ...]:
        """The elements that are not known."""
        return self.grid.elements[self.known :]

    def source(self, condition):
        """Return the user's condition that a generated one belongs to; any other is its own source."""
        return self.split_sources.get(condition, condition)

    def pairs_of_elements(self) -> list[Complementarity]:
        """Return the generated pairs by (name, element, ...)."""
        return [self.pairs, *([] if self.hysteresis is None else [self.hysteresis.binary])]

    def pairs_of_boundaries(self) -> Iterator[Complementarity]:
        """Yield the generated pairs by (name, boundary, ...)."""
        if self.hysteresis is not None:
            yield from (self.hysteresis.parts, self.hysteresis.region, self.hysteresis.least, self.hysteresis.leaving)
        if self.state_jumps is not None:
            yield from (self.state_jumps.happens, self.state_jumps.binary)
            if self.state_jumps.impacts is not None:
                yield from (self.state_jumps.impacts.impact, self.state_jumps.impacts.slip)

    def element_length(self, element: Element):
        """Return h_n as an expression, in labels of the ContinuousSet."""
        return element.length * self.r[element.n]

    def speed(self, element: Element):
        """Return the time of the plant in one unit of the labels inside an element: r_n, or r_n sigma_n."""
        return self.r[element.n] if self.sigma is None else self.r[element.n] * self.sigma[element.n]

    def duration(self, element: Element):
        """Return h_n as an expression, in time of the plant."""
        return element.length * self.speed(element)

    def time_expression(self, label: float):
        """Return the physical time of a label (eq. 9 and 10) as an expression of the element lengths."""
        time = float(self.wrt.first())
        for element in self.grid.elements:
            if label <= element.left:
                break
            inside = label < element.right
            time += self.duration(element) * (self.grid.tau[element.points.index(label)] if inside else 1.0)
        return time

    def physical_time(self) -> dict[float, float]:
        """Return the physical time of every label of the elements (eq. 9 and 10), in order of time."""
        first = self.grid.elements[0].left
        time = {first: float(first if self.begin is None else self.begin)}
        for element in self.grid.elements:
            left, h = time[element.left], value(self.duration(element))
            time.update((label, left + c * h) for label, c in zip(element.points, self.grid.tau))
            time[element.right] = left + h
        return {label: time[label] for label in self.wrt if label in time}


class _MovingGrids(AutoSlots.Mixin):
    """Private data of a model: its moving grids by ContinuousSet."""

    __slots__ = ('by_set',)

    def __init__(self):
        self.by_set = ComponentMap()


Block.register_private_data_initializer(_MovingGrids, scope=_SCOPE)


def moving_grids(block: Block) -> ComponentMap:
    """Return the moving grids of the model that ``block`` belongs to: ContinuousSet -> MovingGrid.

    Models that were transformed and then added to this one keep their grids.
    """
    model = block.model()
    found = model.private_data(_SCOPE).by_set
    embedded = [grid for part in _embedded_models(model) for grid in part.private_data(_SCOPE).by_set.items()]
    return ComponentMap([*found.items(), *embedded]) if embedded else found


def add_moving_grid(moving: MovingGrid) -> None:
    """Record a moving grid on its model."""
    moving.wrt.model().private_data(_SCOPE).by_set[moving.wrt] = moving


def _embedded_models(model: Block) -> Iterator[Model]:
    """Yield the models that are blocks of ``model``, as in the extensive form of a stochastic program, and those in them."""
    for block in declared(model, {Block}):
        if isinstance(block, Model):
            yield block
            yield from _embedded_models(block)
