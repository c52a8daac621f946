"""Write one Disjunction at one time: its multipliers, the blended equations (theory, eq. 7) and the way back to the sources.

Takes: a ``ModeSystem``, ``RecognisedSystem`` or ``HysteresisSystem``, and the form that was chosen for it (None where one mode is
    left).
Leaves: a block beside the Disjunction, of its name, with the components of the smallest form, ``mode`` (eq. 7) and ``own``
    (copies of variables for implicit modes), or blocks below for other forms and sizes; the record of multipliers; the Disjunction
    and its disjuncts are deactivated.
"""

from collections.abc import Callable
from itertools import chain
from weakref import ref

from pyomo.core import Block, Constraint, Set, Var
from pyomo.core.base.block import BlockData

from pyomo_fesd.core import GENERATED, exchanged, index_tuple, insert, sum_of, switched_systems
from pyomo_fesd.dcs.blended_copies import BlendedCopies, can_be_copied
from pyomo_fesd.dcs.continuation import Continuation
from pyomo_fesd.dcs.forms import heaviside
from pyomo_fesd.dcs.reading import split
from pyomo_fesd.dcs.source_maps import source_maps
from pyomo_fesd.dcs.weights import Weights


def dcs_block(parent: BlockData) -> BlockData:
    """Return the block on ``parent`` for everything generated beside its components."""
    return _below(parent, GENERATED + 'dcs')


class Blender:
    """Writes Disjunctions, each at one time; one that is built like another one becomes a copy of what was written for it.

    Parameters
    ----------
    defined : ComponentMap VarData -> DisjunctionData
        receives the variables that the modes define
    copies : dict id of a ModeSystem -> BlendedCopies
        those that are known, to which others are added; the model keeps the systems
    """

    def __init__(self, defined, copies):
        self._defined, self._copies, self._written, self._blocks = defined, copies, {}, {}

    def blend(self, system, form) -> Callable:
        """Write one Disjunction at one time, and deactivate the source.

        Parameters
        ----------
        system : ModeSystem, RecognisedSystem or HysteresisSystem
        form : module of ``forms``, or None where one mode is left

        Returns
        -------
        callable
            the sum of the multipliers of some modes, given by their numbers
        """
        block, index, parts = self._block(system, form), index_tuple(system.disjunction.index()), system.parts()
        copies = self._copies_like(system)
        if copies is None:
            weight = _blend(block, index, system, form, parts)
            if system.stated is not None and can_be_copied(system):
                self._written[id(system.first)] = block, index, system, form
        else:
            weight = copies.write(block, index, system, parts)
        for v in system.defined:
            self._defined[v] = system.disjunction
        _deactivate(block, system, parts)
        return weight

    def _copies_like(self, system):
        """The copies of what was written for a system that is built like this one, or None; made for the first one that asks."""
        like = id(system.first)
        if like in self._written:
            # at once, since the user may change what was written before there are further times
            self._copies[like] = BlendedCopies(*self._written.pop(like))
        return self._copies.get(like)

    def _block(self, system, form):
        """The block for one form of one Disjunction; that of Disjunctions that are built alike is sought once."""
        key = id(system.disjunction.parent_component()), id(system.first)
        if key not in self._blocks:
            self._blocks[key] = _form_block(system, form)
        return self._blocks[key]


def _blend(block, index, system, form, parts):
    """Write the multipliers and the blended equations; returns the weights of modes."""
    weight = Weights(block, index, system, form)
    if form is None:
        _impose_only_mode(block, index, system)
    else:
        form.add(block, index, system)
        _add_blended_equations(block, index, system, weight, Continuation(block, _index_sets(system), index, system, form))
        _record_multipliers(block, parts, weight)
        _record_sources_of_form(block, index, system, form)
    return weight


def _form_block(system, form):
    """The block for one form of one Disjunction; made at its first time."""
    block = _below(dcs_block(system.disjunction.parent_block()), system.disjunction.parent_component().local_name)
    kind = _kind(system, form)
    if kind:
        block = _below(block, GENERATED + kind)
    if block.component('mode') is None:
        sets = _index_sets(system)
        if form is not None:
            form.declare(block, sets, form.size(system.first))
        block.numbers = Set(dimen=1)
        block.mode = Constraint(*sets, block.numbers)
    for j in range(1 + len(block.numbers), 1 + _number_of_equations(system)):
        block.numbers.add(j)
    return block


def _below(parent, name):
    """The block ``name`` of ``parent``; made where there is none."""
    if parent.component(name) is None:
        parent.add_component(name, Block())
    return parent.component(name)


def _kind(system, form):
    """What form and size a block has; empty for the smallest form, whose block is that of its Disjunction."""
    if form is None:
        return 'single_mode'
    size = form.size(system.first)
    return '' if form is heaviside and size == 1 else f'{form.NAME}_{size}'


def _index_sets(system):
    component = system.disjunction.parent_component()
    return (component.index_set(),) if component.is_indexed() else ()


def _number_of_equations(system):
    if len(system.modes) == 1:
        return sum(1 for _ in system.modes[0].constraints())
    return len(system.defined)


def _impose_only_mode(block, index, system):
    """One mode left: its equations and its region hold as they are."""
    (mode,) = system.modes
    for j, con in enumerate(mode.constraints(), start=1):
        _record_sources(source_maps(block), insert(block.mode, (*index, j), con.expr), system, [con])


def _add_blended_equations(block, index, system, weight, continuation):
    """v = sum_i nu_i f_i (eq. 7); v = f where all modes agree; copies of v where a mode is implicit."""
    equations, maps = system.equations, source_maps(block)
    implicit = [equations.is_implicit(i) for i in range(len(system.modes))]
    rhs = [_implicit_mode(block, index, system, i, continuation) if implicit[i] else f for i, f in enumerate(equations.rhs)]
    for j, v in enumerate(equations.defined):
        if len(equations.alike[j]) == 1:
            expr = rhs[0][j]
        else:
            terms = _terms(system, j, rhs, implicit, continuation)
            expr = sum_of([weight(modes) * f for modes, f in terms if not _is_zero(f)])
        sources = list(chain(*(used[j] for used in equations.used)))
        _record_sources(maps, insert(block.mode, (*index, j + 1), v == expr), system, sources)


def _terms(system, j, rhs, implicit, continuation):
    """Yield modes by number with the right-hand side that they share; each alone where it is continued outside of its region."""
    for modes in system.equations.alike[j]:
        apart = [i for i in modes if not implicit[i] and any(system.laws[i][j].domains)]
        for i in apart:
            yield [i], continuation.law(i, rhs[i][j], system.laws[i][j].domains)
        if len(apart) < len(modes):
            rest = [i for i in modes if i not in apart]
            yield rest, rhs[rest[0]][j]


def _is_zero(f):
    return isinstance(f, (int, float)) and f == 0


def _implicit_mode(block, index, system, i, continuation):
    """Copies v_i of the defined variables for mode i, with the equations of mode i imposed on them (below eq. 7)."""
    equations = system.equations
    if block.component('own') is None:
        block.implicit_modes = Set(dimen=1)
        sets = (*_index_sets(system), block.implicit_modes, block.numbers)
        block.own = Var(*sets, dense=False)
        block.own_equation = Constraint(*sets)
    block.implicit_modes.add(i + 1)
    own = [block.own[(*index, i + 1, j)] for j in range(1, 1 + len(equations.defined))]
    for copy, v in zip(own, equations.defined):
        copy.value = v.value
        if all(law.rest is not None for law in system.laws[i]):
            _keep_sign(copy, v)
    swap = {id(v): copy for v, copy in zip(equations.defined, own)}
    for j, (con, law) in enumerate(zip(equations.equations[i], system.laws[i]), start=1):
        body = _continued_body(con.body - con.upper, equations.defined, swap, law, i, continuation)
        _record_sources(source_maps(block), block.own_equation.add((*index, i + 1, j), body == 0), system, [con])
    return own


def _keep_sign(copy, v):
    """Give a copy the sign of the bounds of v, which selects a root; other bounds need not hold outside of the region."""
    copy.setlb(0 if v.lb is not None and v.lb >= 0 else None)
    copy.setub(0 if v.ub is not None and v.ub <= 0 else None)


def _continued_body(body, defined, swap, law, i, continuation):
    """The body of an equation of an implicit mode for its copies, so that it has a solution outside of the region too."""
    if law.rest is None:
        return continuation.law(i, exchanged(body, swap), law.domains)
    own, rest = split(body, defined)
    # the exchange removes named expressions, so it comes before weights with hysteresis, which are some
    return continuation.law(i, exchanged(own, swap), law.domains) + continuation.side(i, rest, law.rest)


def _record_sources(maps, replacement, system, sources):
    maps.disjunction[replacement] = system.disjunction
    maps.connect(replacement, sources)


def _record_multipliers(block, parts, weight):
    """nu of every disjunct: the sum over the modes that it is part of."""
    multipliers = switched_systems(block).multipliers
    for disjunct, modes in parts:
        if modes:
            multipliers[disjunct] = weight(modes)


def _record_sources_of_form(block, index, system, form):
    maps = source_maps(block)
    for con in form.equations(block, index):
        maps.disjunction[con] = system.disjunction
    for pair, mode in form.owners(block, index, system):
        maps.disjunction[pair] = system.disjunction
        if mode is not None and len(system.modes[mode].innermost) == 1:
            (maps.disjunct[pair],) = system.modes[mode].innermost


def _deactivate(block, system, parts):
    """Deactivate the sources, which keep their contents as after Pyomo's own GDP transformations."""
    for disjunction in (system.disjunction, *system.tree.nested):
        disjunction.deactivate()
    treated = ref(block)
    for disjunct, modes in parts:
        if modes:
            disjunct._deactivate_without_fixing_indicator()
            disjunct._transformation_block = treated
        elif disjunct.active:
            if any(disjunct in mode for mode in system.tree.modes):
                switched_systems(block).excluded.add(disjunct)
            disjunct.deactivate()
