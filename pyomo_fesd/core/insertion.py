"""Add content at an index that is known to belong to the index set of a component.

Pyomo's own ``add`` looks the index up in the index set, whose product of Sets takes longer to search than all the rest.  This
function calls what Pyomo calls after the search, a method that its own component types override.

Takes: a Constraint or Complementarity, an index tuple at which it has no content yet, and the content; or a Var and an index tuple.
Leaves: the content, or the variable.
Does not apply: to an index that a user gives.
"""

from collections.abc import Iterable

from pyomo.core.base.component import ComponentData
from pyomo.core.base.indexed_component import IndexedComponent
from pyomo.mpec import Complementarity

from pyomo_fesd.core.fresh_data import make_data
from pyomo_fesd.core.time_index import stored_index


def insert(component: IndexedComponent, index: tuple, content) -> ComponentData:
    """Add ``content`` at ``index`` and return its data."""
    if component.ctype is not Complementarity:
        return component._setitem_when_not_present(stored_index(index), content)
    data = make_data(component, stored_index(index))
    data.set_value(content)
    return data


def add_copies(component: IndexedComponent, indices: Iterable) -> None:
    """Make the data of a Var whose rules are constant at ``indices`` without data: the first by its rules, the others after it."""
    first = None
    for index in indices:
        if first is None:
            first = component._getitem_when_not_present(index)
            continue
        copy_variable(component, index, first)


def copy_variable(component: IndexedComponent, index, like: ComponentData) -> ComponentData:
    """Make the data of a Var at a stored ``index`` like those of the same Var at another one, and return them."""
    data = component._data[index] = like.copy(like)
    data._index = index
    return data


class VariableMaker:
    """Makes data of Vars whose rules are constant: those of each Var once by its rules, and the others like them."""

    def __init__(self):
        self._made = {}

    def at(self, component: IndexedComponent, index: tuple) -> ComponentData:
        """Return the data at ``index``; made as they were declared where there are none."""
        index = stored_index(index)
        data = component._data.get(index)
        if data is not None:
            return data
        # a copy, which nobody changes; a component that was deleted may have had the same id
        like = self._made.get(id(component))
        if like is not None and like.parent_component() is component:
            return copy_variable(component, index, like)
        data = component._getitem_when_not_present(index)
        self._made[id(component)] = data.copy(data)
        return data
