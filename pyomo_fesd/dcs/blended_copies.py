"""Copy what was written for one Disjunction at one time to others that are built like it.

The expressions of its equations, conditions and multipliers are built again from the variables and Params of the others
(``core/stamp.py``): nothing is solved for a variable, nothing is blended.

Takes: a system that ``blending.py`` has written, with its block and index, at once after that: a user may change what was written.
Leaves: for others of the same ``first`` the same components on their block, at their index, and the same entries of the records.
Does not apply: where a mode is implicit, or continued outside of its region: start values and bounds of these variables are found
    one by one.
"""

from itertools import chain, islice
from typing import NamedTuple

from pyomo.core import Var
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import Dependents, Stamp, Step, VariableMaker, index_tuple, insert, switched_systems
from pyomo_fesd.dcs.source_maps import source_maps
from pyomo_fesd.dcs.weights import Weights


def can_be_copied(system) -> bool:
    """Return whether all variables that are written for a system are those of its form."""
    implicit = any(map(system.first.equations.is_implicit, range(len(system.modes))))
    return not implicit and not any(any(law.domains) for laws in system.laws for law in laws)


class _Row(NamedTuple):
    """A constraint or condition.

    Attributes
    ----------
    name, rest : str, tuple
        its component, and its index without that of the Disjunction
    is_pair : bool
    sources : list of int, or None
        of the equations of all modes, the numbers of those that it replaces
    mode : int or None
        the mode whose multiplier it holds
    """

    name: str
    rest: tuple
    is_pair: bool
    sources: list | None
    mode: int | None


class BlendedCopies:
    """Writes copies of one Disjunction.

    Parameters
    ----------
    block : BlockData
        with all that was written for it
    index : tuple
        of the Disjunction
    system : ModeSystem or RecognisedSystem
    form : module of ``forms``
    """

    def __init__(self, block, index, system, form):
        self._form, self._maker = form, VariableMaker()
        record, maps = switched_systems(block), source_maps(block)
        variables = [v for component in block.component_objects(Var, descend_into=False) for v in _at(component, index)]
        own = set(map(id, variables))
        self._variables = [(*_name_and_rest(v, index), v in record.selectors) for v in variables]
        steps = [step for step in record.steps if id(step.nu) in own]
        self._number_of_steps = len(steps)
        dependents = [one for one in record.dependents if own.issuperset(map(id, one.variables))]
        self._dependents = [(len(one.variables), len(one.arguments), one.values) for one in dependents]
        weights = {tuple(modes): record.multipliers[disjunct] for disjunct, modes in system.parts() if modes}
        self._weighted = list(weights)
        rows = [row for row, source in maps.disjunction.items() if source is system.disjunction]
        self._rows = _described(rows, block, index, system, form)
        self._build = Stamp([*system.stated.parts, *variables]).builder(
            [
                *chain(*((step.nu, step.c) for step in steps)),
                *chain(*(chain(one.variables, one.arguments) for one in dependents)),
                *weights.values(),
                *chain(*map(_contents, rows)),
            ]
        )

    def write(self, block, index, system, parts) -> Weights:
        """Write a copy for another system at its ``index`` on its ``block``; returns the weights of its modes."""
        record, own = switched_systems(block), []
        for name, rest, is_selector in self._variables:
            v = self._maker.at(block.component(name), (*index, *rest))
            own.append(v)
            if is_selector:
                record.selectors.add(v)
        built = iter(self._build([*system.stated.parts, *own]))
        record.steps += [Step(next(built), next(built)) for _ in range(self._number_of_steps)]
        for variables, arguments, values in self._dependents:
            one = Dependents(tuple(islice(built, variables)), tuple(islice(built, arguments)), values)
            record.dependents.append(one)
            self._form.start(block, one.variables, one.arguments)
        weights = Weights(block, index, system, self._form, zip(self._weighted, built))
        for disjunct, modes in parts:
            if modes:
                record.multipliers[disjunct] = weights(modes)
        self._write_rows(block, index, system, built)
        return weights

    def _write_rows(self, block, index, system, built):
        """Write the rows with the contents that come next in ``built``, and their sources."""
        maps, disjunction, modes = source_maps(block), system.disjunction, system.modes
        equations = list(chain(*system.stated.equalities))
        for name, rest, is_pair, sources, mode in self._rows:
            content = complements(next(built), next(built)) if is_pair else next(built)
            row = insert(block.component(name), (*index, *rest), content)
            maps.disjunction[row] = disjunction
            if sources is not None:
                maps.connect(row, [equations[k] for k in sources])
            if mode is not None and len(modes[mode].innermost) == 1:
                (maps.disjunct[row],) = modes[mode].innermost


def _at(component, index):
    """The data of a component whose index begins with ``index``, in the order of the rest, in which forms make them."""
    found = {index_tuple(key): data for key, data in component._data.items()}
    return [found[key] for key in sorted(key for key in found if key[: len(index)] == index)]


def _name_and_rest(data, index):
    return data.parent_component().local_name, index_tuple(data.index())[len(index) :]


def _contents(row):
    return row._args if row.ctype is Complementarity else (row.expr,)


def _described(rows, block, index, system, form):
    """The rows without their contents."""
    maps, modes = source_maps(block), {id(pair): mode for pair, mode in form.owners(block, index, system)}
    numbers = {id(con): k for k, con in enumerate(chain(*system.stated.equalities))}
    found = []
    for row in rows:
        sources = [numbers[id(con)] for con in maps.sources[row]] if row in maps.sources else None
        is_pair = row.ctype is Complementarity
        found.append(_Row(*_name_and_rest(row, index), is_pair, sources, modes.get(id(row))))
    return found
