"""Name violated rows and pairs in the words of the user: component, mode, and physical time.

A generated component is named after its source: the Disjunction and the equations of its modes, the mode with hysteresis, the
state jump, the control.  Other components keep their name, with the physical time where elements move.

Takes: a model, its compiled variables and a point.
Leaves: the model's own values, put back.
Does not apply: to equations of pyomo.dae, which have names that a user knows (``x_disc_eq``).
"""

from collections.abc import Callable, Iterable
from functools import partial

from pyomo.core import Block, TransformationFactory
from pyomo.core.base.component import ComponentData
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import (
    MovingGrid,
    TimeIndex,
    continuous_sets,
    index_tuple,
    is_generated,
    kept_values,
    moving_grids,
    public_name,
    source_name,
)
from pyomo_fesd.solvers.plugin import review

#: Generated component of a moving grid -> (words, whether its index ends with an element; else with a boundary).
KINDS = {
    'cross': ("{}", True),
    'binary': ("{}", True),
    'one': ("{}", True),
    'exit': ("the end of sliding of {}", True),
    'equilibration': ("equal lengths of elements", True),
    'sign_after': ("the signs of {} after a jump", True),
    'parts': ("the region of {}", False),
    'region': ("the region of {}", False),
    'leaving': ("the end of {}", False),
    'least': ("the end of {}", False),
    'stays': ("{}, which never ends,", False),
    'happens': ("the guard of {}", False),
}


def user_names(model: Block, variables: Iterable = (), values: Iterable[float] = ()) -> Callable[[ComponentData], str]:
    """Return a function that names a constraint or a pair of ``model``; physical times are those of the point.

    Parameters
    ----------
    variables, values : iterables of equal length
        the point; default: the values of the model
    """
    grids = list(moving_grids(model).values())
    kept = [v for moving in grids for v in _lengths(moving)]
    point = dict(zip(map(id, variables), values))
    with kept_values(kept):
        for v in kept:
            v.set_value(float(point.get(id(v), v.value)), skip_validation=True)
        named = [_Names(moving) for moving in grids]

    def name(component):
        found = (review(partial(names.name, component), lambda _: None) for names in named)
        return next(filter(None, found), component.name)

    return name


def _lengths(moving):
    """Variables that the physical time of a grid depends on."""
    found = {id(v): v for e in moving.grid.elements for v in identify_variables(moving.duration(e), include_fixed=False)}
    return found.values()


class _Names:
    """Names on one moving grid."""

    def __init__(self, moving: MovingGrid):
        self._moving, self._times, self._physical = moving, TimeIndex(moving.wrt), moving.physical_time()
        laws = () if moving.hysteresis is None else moving.hysteresis.modes
        self._titles = {law.name: law.title for law in laws}

    def name(self, component) -> str | None:
        """The name of a component on this grid; None of others."""
        if component.parent_block() is self._moving.block or component.parent_block().parent_block() is self._moving.block:
            return self._of_grid(component)
        if self._moving.wrt not in continuous_sets(component):
            return None
        time = f"at time {self._physical[self._times.time(component)]:.6g}"
        return f"{self._of_source(component)} {time}" if is_generated(component) else f"{component.name} ({time})"

    def _of_source(self, component):
        """The equations of modes that a generated equation blends, or the Disjunction."""
        dcs = TransformationFactory('fesd.dcs')
        for find in (dcs.get_src_constraint, lambda c: [dcs.get_src_disjunction(c)]):
            try:
                names = dict.fromkeys(public_name(self._times.split(source)[1]) for source in find(component))
                return ' | '.join(names)
            except (KeyError, AttributeError):
                continue
        return source_name(self._times.split(component)[1])

    def _of_grid(self, component):
        kind, index = component.parent_component().local_name, index_tuple(component.index())
        if kind in KINDS:
            words, by_element = KINDS[kind]
            of = self._moving.sources.get(component)
            source = self._of_source(of[0]) if of else self._title(index[0])
            return f"{words.format(source)} {self._where(index, by_element)}"
        if kind == 'stage_length':
            return f"the sum of element lengths in control stage {index[0]}"
        # an equation between variables: the first of them that the user knows
        body = getattr(component, 'body', None)
        known = [v for v in identify_variables(body) if not is_generated(v)] if body is not None else []
        return f"the equation of {known[0].name} between elements" if known else "an equation between elements"

    def _title(self, name):
        title = self._titles.get(name, name)
        return source_name(title) if title == name and '.' in str(title) else title

    def _where(self, index, by_element):
        number = next((i for i in index[1:] if isinstance(i, int)), index[0])
        elements = self._moving.grid.elements
        if not isinstance(number, int):
            return "in an element"
        if by_element:
            element = elements[number - 1]
            return f"between times {self._physical[element.left]:.6g} and {self._physical[element.right]:.6g}"
        label = elements[0].left if number == 0 else elements[number - 1].right
        return f"at time {self._physical[label]:.6g}"
