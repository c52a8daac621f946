"""Find the time in the index of a component: ``unit[a].hyb[0.5].dj['k']`` is split into 0.5 and the rest."""

from collections import defaultdict
from typing import Any, NamedTuple

from pyomo.common.collections import ComponentSet
from pyomo.core import Block, Constraint, Var
from pyomo.core.base.block import BlockData
from pyomo.dae import ContinuousSet, DerivativeVar
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd.core.errors import FesdError
from pyomo_fesd.core.own_data import data_of, declared, entries_of, own_components

#: Endings of the names of pyomo.dae's own equations.
DISCRETISATION = ('_disc_eq', '_cont_eq')
#: Types of components on a block.
VARIABLES, DISJUNCTIONS, BLOCKS = {Var, DerivativeVar}, {Disjunction}, {Block, Disjunct}


def index_tuple(index) -> tuple:
    """Return an index as a tuple: empty for a scalar, whose index is None."""
    return () if index is None else index if isinstance(index, tuple) else (index,)


def stored_index(index: tuple):
    """Return an index tuple as Pyomo stores it, None for a scalar: it finds a tuple of one only after a search of its own."""
    return index if len(index) > 1 else index[0] if index else None


def ancestry(data):
    """Yield ``data`` and the blocks around it, from the inside out, without the model."""
    while data is not None and data.parent_block() is not None:
        yield data
        data = data.parent_block()


def index_sets(component) -> list:
    """Return the sets that index a component itself, in their order."""
    return list(component.index_set().subsets(expand_all_set_operators=False)) if component.is_indexed() else []


def is_discretisation_equation(constraint) -> bool:
    """Whether pyomo.dae has written a Constraint (or one of its data) for its discretisation."""
    return constraint.parent_component().local_name.endswith(DISCRETISATION)


def is_indexed_by(component, wrt) -> bool:
    """Whether ``wrt`` is one of the index sets of ``component`` itself."""
    return component.is_indexed() and (component.index_set() is wrt or any(s is wrt for s in index_sets(component)))


def time_position(component, wrt) -> int | None:
    """Position of ``wrt`` in the index tuple of ``component``; None if ``wrt`` does not index it.

    An index set of unknown dimension before ``wrt`` counts as one position, as Pyomo's own sets do.
    """
    position = 0
    for subset in index_sets(component):
        if subset is wrt:
            return position
        position += subset.dimen or 1
    return None


class _Place(NamedTuple):
    """A component and the blocks around it.

    Attributes
    ----------
    component : IndexedComponent or Block
        kept, so that no other one gets its id
    outer, inner : time labels of the outermost and of the innermost block over time around it, None without one
    name : with ``*`` in place of the time
    position : of the time in its own index, or None
    """

    component: Any
    outer: float | None
    inner: float | None
    name: str
    position: int | None


class TimeIndex:
    """Split the index of component data into the time label and the rest; each component is read once.

    Parameters
    ----------
    wrt : ContinuousSet

    Example: with ``wrt = m.t``, ``split(m.unit['a'].hyb[0.5].dj)`` is ``(0.5, "unit[a].hyb[*].dj")``.
    """

    def __init__(self, wrt):
        self.wrt = wrt
        self._places, self._names = {}, {}

    def _place(self, component):
        place = self._places.get(id(component))
        if place is None:
            place = self._places[id(component)] = self._read_place(component)
        return place

    def _read_place(self, component):
        block = component.parent_block()
        if block is None:
            return _Place(component, None, None, '', None)
        name, position = component.local_name, time_position(component, self.wrt)
        if block.parent_block() is None:
            return _Place(component, None, None, name, position)
        outer, prefix = self.split(block)
        return _Place(component, outer, self.time(block), f'{prefix}.{name}', position)

    def split(self, data) -> tuple:
        """Time label of ``data`` (None if it has none) and its name with ``*`` in place of the time."""
        component = data.parent_component()
        _, time, _, name, position = self._place(component)
        if not component.is_indexed():
            return time, name
        # ``index()`` asks the component too whether this is so, which takes longer than the rest
        index = index_tuple(data._index)
        if position is not None:
            time, index = index[position] if time is None else time, _replaced(index, position, '*')
        # a name is the same at all times, and takes longer to write than to find
        full = self._names.get((id(component), index))
        if full is None:
            full = self._names[id(component), index] = f'{name}[{",".join(map(str, index))}]'
        return time, full

    def _split_scalar(self, component):
        """``split`` of a scalar component, of which nothing is kept: there are many, and each is read once."""
        block = component.parent_block()
        if block is None or block.parent_block() is None:
            return None, component.local_name
        time, prefix = self.split(block)
        return time, f'{prefix}.{component.local_name}'

    def time(self, data):
        """Time label of ``data``, or None; of a whole indexed component, as a Suffix may hold, that of the block it is on."""
        component = data.parent_component()
        _, _, inner, _, position = self._place(component)
        if position is None or (data is component and data.is_indexed()):
            return inner
        index = data._index
        return index[position] if index.__class__ is tuple else index

    def at(self, data, label):
        """The data, or the whole component, of the same name at another time; None if ``data`` has no time."""
        component = data.parent_component()
        position = self._place(component).position
        if position is not None and not _is_whole(data):
            index = _replaced(index_tuple(data.index()), position, label)
            return component[stored_index(index)]
        block = data.parent_block()
        other = None if block is None or block.parent_block() is None else self.at(block, label)
        if other is None:
            return None
        found = other.component(component.local_name)
        return found[data.index()] if component.is_indexed() and not _is_whole(data) else found

    def families(self, datas) -> dict:
        """Group ``datas`` by name: ``{"unit[a].hyb[*].dj": {time label: data}}``; data without time are left out."""
        groups = defaultdict(dict)
        for data in datas:
            time, name = self.split(data)
            if time is not None:
                groups[name][time] = data
        return dict(groups)

    def families_in(self, components) -> dict:
        """Group the data of whole ``components`` as ``families`` does, in less time where they are over time themselves."""
        groups = defaultdict(dict)
        # an index set without members has no dimension, and so no place for the time
        for component in filter(len, components):
            if not component.is_indexed():
                time, name = self._split_scalar(component)
                if time is not None:
                    groups[name][time] = component
                continue
            _, outer, _, _, position = self._place(component)
            if position is None or outer is not None:
                for data in data_of(component):
                    time, name = self.split(data)
                    if time is not None:
                        groups[name][time] = data
                continue
            if component.index_set() is self.wrt:
                by_time = dict(entries_of(component))
                groups[self.split(next(iter(by_time.values())))[1]].update(by_time)
                continue
            by_rest = {}
            for index, data in entries_of(component):
                index = index_tuple(index)
                rest = index[:position], index[position + 1 :]
                if rest not in by_rest:
                    by_rest[rest] = groups[self.split(data)[1]]
                by_rest[rest][index[position]] = data
        return dict(groups)


def _is_whole(data):
    """Whether this is an indexed component and not one of its data."""
    return data is data.parent_component() and data.is_indexed()


def _replaced(index, position, new):
    return (*index[:position], new, *index[position + 1 :])


def strip_time(name: str) -> str:
    """Remove the ``*`` of the time from a name: ``hyb[*].dj`` becomes ``hyb.dj``, ``dj[*,k]`` becomes ``dj[k]``."""
    for full, short in (('[*]', ''), ('[*,', '['), (',*]', ']'), (',*,', ',')):
        name = name.replace(full, short)
    return name


def refuse_foreign(variables, model, where) -> None:
    """Refuse variables of another model: a rule that closes over ``m`` still refers to ``m`` when a clone of it is expanded.

    Variables are accepted if ``where`` is a temporary block that holds blocks or constraints of their model, as initialisers make.

    Raises
    ------
    FesdError
        names the component of the other model
    """
    foreign = [c for c in ComponentSet(v.parent_component() for v in variables) if c.model() is not model]
    held = _models_held(where) if foreign else ()
    for component in foreign:
        if component.model() not in held:
            raise FesdError(
                where,
                f"it refers to '{component.name}' of another model (of which this one is perhaps a clone)",
                "let rules take components from their own argument, e.g. d.model().x[t] instead of m.x[t], or transform before "
                "cloning",
            )


def _models_held(block):
    """The models that the blocks and constraints in ``block`` belong to."""
    held = ComponentSet()
    if isinstance(block, BlockData):
        held.update(c.model() for c in block.component_data_objects((Block, Constraint), descend_into=Block))
    return held


def refuse_no_model(block, caller: str) -> None:
    """Refuse what is not a model or a Block of one, and a model that has no data yet.

    Raises
    ------
    FesdError
    """
    if not hasattr(block, 'component_objects'):
        name = getattr(block, 'name', repr(block))
        raise FesdError(name, f"{caller}: this is a {type(block).__name__}, not a model", "pass the model, or a Block of it")
    if not block.model().is_constructed():
        raise FesdError(
            block, f"{caller}: the components of an abstract model have no data", "pass an instance: model.create_instance()"
        )


def find_continuous_set(block, wrt, caller: str) -> ContinuousSet:
    """Return ``wrt`` after a check, or without ``wrt`` the only ContinuousSet below or above ``block``.

    Raises
    ------
    FesdError
        if ``block`` is no model, if ``wrt`` is not a ContinuousSet of the model, if there is none, or if there are several and
        ``wrt`` was not given
    """
    refuse_no_model(block, caller)
    if wrt is not None:
        return _checked(wrt, block, caller)
    levels = (ComponentSet(own_components(root, ContinuousSet, Block)) for root in (block, block.model()))
    found = next(filter(None, levels), ())
    if len(found) == 1:
        return next(iter(found))
    if found:
        cause, fix = f"several ContinuousSets ({', '.join(s.name for s in found)})", "say which one with the keyword wrt"
    else:
        cause, fix = "no ContinuousSet", "index the dynamic model by a pyomo.dae.ContinuousSet"
    raise FesdError(block, f"{caller}: the model has {cause}", fix)


def _checked(wrt, block, caller):
    """``wrt`` if it is a ContinuousSet of the model of ``block``."""
    if getattr(wrt, 'ctype', None) is not ContinuousSet:
        raise FesdError(
            getattr(wrt, 'name', str(wrt)),
            f"{caller}: 'wrt' must be a pyomo.dae.ContinuousSet, not {type(wrt).__name__}",
            "pass the time set, e.g. wrt=m.t; an IDAES flowsheet has one when built with dynamic=True",
        )
    if wrt.model() is not block.model():
        raise FesdError(wrt, f"{caller}: this ContinuousSet belongs to another model than '{block.name}'", "pass the model's own")
    return wrt


def derivatives(block, wrt):
    """Yield every DerivativeVar with respect to ``wrt`` below ``block``, also after discretisation made it a plain Var.

    Blocks over ``wrt`` are not searched: they are many, and a derivative lies beside its state, which is over all times.
    """
    for place in _blocks_without_time(block, wrt):
        for var in declared(place, VARIABLES):
            if isinstance(var, DerivativeVar) and any(s is wrt for s in var.get_continuousset_list()):
                yield var


def _blocks_without_time(block, wrt):
    """``block`` and those below it that ``wrt`` does not index, without the disjuncts of a Disjunction of mere expressions."""
    yield block
    nameless = {id(d._autodisjuncts) for d in declared(block, DISJUNCTIONS)}
    for inner in declared(block, BLOCKS):
        if not is_indexed_by(inner, wrt) and id(inner) not in nameless:
            for data in data_of(inner):
                yield from _blocks_without_time(data, wrt)


def discretised(wrt) -> bool:
    """Whether pyomo.dae has discretised ``wrt``."""
    return 'scheme' in wrt.get_discretization_info()


def continuous_sets(data) -> ComponentSet:
    """The ContinuousSets that index ``data`` or a block around it."""
    sets = (s for one in ancestry(data) for s in index_sets(one.parent_component()))
    return ComponentSet(s for s in sets if s.ctype is ContinuousSet)
