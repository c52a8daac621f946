"""Make empty data of Disjuncts and Complementarities as Pyomo makes them, in half of the time.

Pyomo declares, checks and constructs both indicators of a Disjunct like components of the user, and looks for components among the
attributes of a block.  There is a Disjunct of each mode at every time, so that takes a tenth of the time of a transformation.  Here
Pyomo makes such data once; others get the same attributes, with containers and indicators of their own.

Takes: a constructed Disjunct or Complementarity, and a stored index of its index set without data.
Leaves: what the component's own ``_setitem_when_not_present`` leaves there.
Does not apply: to classes derived from Pyomo's, whose constructors may do more.
"""

from collections.abc import Callable
from functools import cache
from operator import itemgetter
from weakref import ref

from pyomo.core.base.block import BlockData
from pyomo.core.base.indexed_component import IndexedComponent
from pyomo.gdp.disjunct import Disjunct, IndexedDisjunct
from pyomo.mpec.complementarity import Complementarity, IndexedComplementarity

#: Classes of components -> the type of which Pyomo makes the data that are copied.
COPIED = {IndexedDisjunct: Disjunct, IndexedComplementarity: Complementarity}

#: Attributes that say where data are.
OF_COMPONENT = ('_component', '_index')

# the attributes of blocks are known, and Pyomo's ``__setattr__`` looks for components among them
_set = object.__setattr__


def make_data(component: IndexedComponent, index) -> BlockData:
    """Make empty data at a stored ``index`` and return them."""
    if component.__class__ not in COPIED:
        return component._setitem_when_not_present(index)
    data = component._data[index] = _pattern(COPIED[component.__class__]).copy()
    _set(data, '_component', ref(component))
    _set(data, '_index', index)
    return data


@cache
def _pattern(ctype):
    """The pattern of the data of a type."""
    component = ctype([0])
    component.construct()
    return _Pattern(component._setitem_when_not_present(0))


class _Pattern:
    """The attributes of data and of the components on them, from which others are made.

    Parameters
    ----------
    data : BlockData
        with scalar components only
    """

    def __init__(self, data: BlockData):
        parts = [data, *data.component_map().values()]
        places = {id(part): k for k, part in enumerate(parts)}
        self._parts = [(part.__class__, *_attributes(part, places)) for part in parts]

    def copy(self) -> BlockData:
        """Return a copy, of no component yet."""
        copies = [object.__new__(cls) for cls, *_ in self._parts]
        for part, (_, slots, made_slots, shared, made) in zip(copies, self._parts):
            for name, value in slots.items():
                _set(part, name, value)
            for name, make in made_slots:
                _set(part, name, make(copies))
            attributes = part.__dict__
            # most attributes: all at once
            attributes.update(shared)
            for name, make in made:
                attributes[name] = make(copies)
        return copies[0]


def _attributes(part, places):
    """The slots and then the other attributes of a part, each as ``_shared_and_made``."""
    slots = {name: getattr(part, name) for name in part.__auto_slots__.slots if places[id(part)] or name not in OF_COMPONENT}
    return *_shared_and_made(slots, places), *_shared_and_made(part.__dict__, places)


def _shared_and_made(attributes, places):
    """The values of attributes that all copies of a part share, and functions that make those that each has alone."""
    makers = {name: _maker(value, places) for name, value in attributes.items()}
    shared = {name: value for name, value in attributes.items() if makers[name] is None}
    return shared, [(name, make) for name, make in makers.items() if make is not None]


def _maker(value, places) -> Callable | None:
    """The function from the copies of all parts to a value of a copy; None for one that all copies share."""
    kind, place = value.__class__, places.get(id(value() if isinstance(value, ref) else value))
    if place is not None:
        return (lambda copies: ref(copies[place])) if kind is ref else itemgetter(place)
    if kind not in (dict, list, tuple):
        return None
    inside = list(value.values() if kind is dict else value)
    makers = [_maker(inner, places) for inner in inside]
    if not any(makers):
        return None if kind is tuple else lambda copies: kind(value)
    makers = [make or (lambda copies, inner=inner: inner) for make, inner in zip(makers, inside)]
    if kind is dict:
        entries = list(zip(value, makers))
        return lambda copies: {key: make(copies) for key, make in entries}
    return lambda copies: kind([make(copies) for make in makers])
