"""Where in a component's index the time stands: one place that splits ``unit[a].hyb[0.5].dj['k']`` into 0.5 and the rest."""

from collections import defaultdict

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, Var
from pyomo.core.base.block import BlockData
from pyomo.dae import ContinuousSet, DerivativeVar
from pyomo.gdp import Disjunct

from pyomo_fesd.errors import FesdError

#: Endings of the names of pyomo.dae's own equations.
DISCRETISATION = ('_disc_eq', '_cont_eq')


def is_indexed_by(component, wrt):
    """Whether ``wrt`` is one of the index sets of ``component`` itself."""
    return component.is_indexed() and any(s is wrt for s in component.index_set().subsets())


def time_position(component, wrt):
    """Position of ``wrt`` in the index tuple of ``component``; None if it does not index it.

    An index set of unknown dimension before ``wrt`` counts as one position, as Pyomo's own sets do.
    """
    if not component.is_indexed():
        return None
    position = 0
    for subset in component.index_set().subsets():
        if subset is wrt:
            return position
        position += subset.dimen or 1
    return None


class TimeIndex:
    """Splits the position of component data into its time label and everything else; remembers each component's answer.

    Example: with ``wrt = m.t``, ``split(m.unit['a'].hyb[0.5].dj)`` is ``(0.5, "unit[a].hyb[*].dj")``.
    """

    def __init__(self, wrt):
        self.wrt = wrt
        self._positions = ComponentMap()

    def _position(self, component):
        if component not in self._positions:
            self._positions[component] = time_position(component, self.wrt)
        return self._positions[component]

    def split(self, data):
        """Time label of ``data`` (None if it has none) and its name with ``*`` in the place of time."""
        time, parts = None, []
        while data is not None and data.parent_block() is not None:
            component = data.parent_component()
            name = component.local_name
            if component.is_indexed():
                index = data.index() if isinstance(data.index(), tuple) else (data.index(),)
                position = self._position(component)
                if position is not None:
                    time = index[position]
                    index = (*index[:position], '*', *index[position + 1 :])
                name += '[' + ','.join(map(str, index)) + ']'
            parts.append(name)
            data = data.parent_block()
        return time, '.'.join(reversed(parts))

    def time(self, data):
        """Time label of ``data``, or None."""
        while data is not None and data.parent_block() is not None:
            position = self._position(data.parent_component())
            if position is not None:
                index = data.index()
                return index[position] if isinstance(index, tuple) else index
            data = data.parent_block()
        return None

    def at(self, data, label):
        """The counterpart of ``data`` at another time; None if ``data`` has no time."""
        component = data.parent_component()
        position = self._position(component)
        if position is not None:
            index = data.index() if isinstance(data.index(), tuple) else (data.index(),)
            index = (*index[:position], label, *index[position + 1 :])
            return component[index if len(index) > 1 else index[0]]
        home = data.parent_block()
        other = None if home is None or home.parent_block() is None else self.at(home, label)
        if other is None:
            return None
        found = other.component(component.local_name)
        return found[data.index()] if component.is_indexed() else found

    def families(self, datas):
        """Group ``datas`` by name: ``{"unit[a].hyb[*].dj": {time label: data}}``; data without time are left out."""
        groups = defaultdict(dict)
        for data in datas:
            time, name = self.split(data)
            if time is not None:
                groups[name][time] = data
        return dict(groups)


def strip_time(name):
    """A family's name for people: ``hyb[*].dj`` becomes ``hyb.dj``, ``dj[*,k]`` becomes ``dj[k]``."""
    for full, short in (('[*]', ''), ('[*,', '['), (',*]', ']'), (',*,', ',')):
        name = name.replace(full, short)
    return name


def refuse_foreign(variables, model, where):
    """Refuse variables of another model: a rule that closes over ``m`` still means ``m`` when a clone of it is expanded.

    A temporary block that holds another model's blocks or constraints, as initialisers make them, holds its variables as well.
    """
    foreign = [c for c in ComponentMap((v.parent_component(), v) for v in variables) if c.model() is not model]
    held = _models_held(where) if foreign else ()
    for component in foreign:
        if not any(component.model() is other for other in held):
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


def find_continuous_set(block, wrt, caller):
    """The ContinuousSet that ``caller`` is to work on: ``wrt`` checked, or the only one below or above ``block``.

    Raises
    ------
    FesdError
        if ``wrt`` is not a ContinuousSet, if there is none, or if there are several and ``wrt`` was not given.
    """
    if wrt is not None:
        if getattr(wrt, 'ctype', None) is not ContinuousSet:
            raise FesdError(
                getattr(wrt, 'name', str(wrt)),
                f"{caller}: 'wrt' must be a pyomo.dae.ContinuousSet, not {type(wrt).__name__}",
                "pass the time set, e.g. wrt=m.t; an IDAES flowsheet has one when built with dynamic=True",
            )
        if wrt.model() is not block.model():
            raise FesdError(
                wrt, f"{caller}: this ContinuousSet belongs to another model than '{block.name}'", "pass the model's own"
            )
        return wrt
    found = ComponentMap()
    for root in (block, block.model()):
        for s in root.component_objects(ContinuousSet, descend_into=True):
            found[s] = s
        if found:
            break
    if len(found) == 1:
        return next(iter(found))
    names = ', '.join(s.name for s in found)
    raise FesdError(
        block,
        f"{caller}: the model has several ContinuousSets ({names})" if found else f"{caller}: the model has no ContinuousSet",
        "say which one with the keyword wrt" if found else "index the dynamic model by a pyomo.dae.ContinuousSet",
    )


def derivatives(block, wrt):
    """Every DerivativeVar with respect to ``wrt`` below ``block``, also after discretisation made it a plain Var."""
    for var in block.component_objects((Var, DerivativeVar), descend_into=(Block, Disjunct)):
        if isinstance(var, DerivativeVar) and any(s is wrt for s in var.get_continuousset_list()):
            yield var


def discretised(wrt):
    """Whether pyomo.dae has put its points on ``wrt``."""
    return 'scheme' in wrt.get_discretization_info()
