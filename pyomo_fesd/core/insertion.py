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

from pyomo_fesd.core.time_index import stored_index


def insert(component: IndexedComponent, index: tuple, content) -> ComponentData:
    """Add ``content`` at ``index`` and return its data."""
    return component._setitem_when_not_present(stored_index(index), content)


def add_copies(component: IndexedComponent, indices: Iterable) -> None:
    """Make the data of a Var whose rules are constant at ``indices`` without data: the first by its rules, the others after it."""
    first = None
    for index in indices:
        if first is None:
            first = component._getitem_when_not_present(index)
            continue
        data = component._data[index] = first.copy(first)
        data._index = index


def variable_at(component: IndexedComponent, index: tuple) -> ComponentData:
    """Return the data of a Var at ``index``; made as it was declared where there is none."""
    index = stored_index(index)
    data = component._data.get(index)
    return component._getitem_when_not_present(index) if data is None else data
