"""What one Disjunction at one time leaves on the model: a form, the blended equations, and the ways back to the sources.

Everything stands in a block beside the Disjunction, one sub-block for each form; the Disjunction and its disjuncts are switched
off.

Takes: a ``System`` and the form that was chosen for it (None where one mode is left).
Leaves: the form's components, ``mode`` (eq. 7), ``own`` (copies of variables for implicit modes), marks INDICATOR.
"""

from weakref import ref

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap
from pyomo.core import Block, Constraint, Set, Var
from pyomo.core.expr.visitor import replace_expressions

from pyomo_fesd import marks
from pyomo_fesd.dcs import two_mode


class _Maps(AutoSlots.Mixin):
    """Where the generated components came from; kept as private data of the block that holds them."""

    __slots__ = ('disjunction', 'disjunct', 'sources', 'images', 'defined')

    def __init__(self):
        self.disjunction = ComponentMap()
        self.disjunct = ComponentMap()
        self.sources = ComponentMap()
        self.images = ComponentMap()
        #: on the model: the DisjunctionData that defines a variable
        self.defined = ComponentMap()


Block.register_private_data_initializer(_Maps, scope='pyomo_fesd.dcs')


def maps(component):
    """Where the generated components beside ``component`` came from."""
    return component.parent_block().private_data('pyomo_fesd.dcs')


def dcs_block(parent):
    """The block on ``parent`` for everything generated beside its components."""
    name = marks.GENERATED + 'dcs'
    if parent.component(name) is None:
        parent.add_component(name, Block())
    return parent.component(name)


def _form_block(system, form):
    """The block that holds one form of one Disjunction; made at its first time."""
    component, home = system.disjunction.parent_component(), dcs_block(system.disjunction.parent_block())
    name = component.local_name
    if form is None:
        name += '_single_mode'
    elif form is not two_mode:
        name += f'_{form.NAME}_{form.size(system)}'
    block = home.component(name)
    if block is None:
        block = Block()
        home.add_component(name, block)
        index = (component.index_set(),) if component.is_indexed() else ()
        if form is not None:
            form.declare(block, index, form.size(system))
        block.numbers = Set(dimen=1)
        block.mode = Constraint(*index, block.numbers)
    for j in range(1, 1 + _number_of_equations(system)):
        block.numbers.add(j)
    return block


def _number_of_equations(system):
    if system.equations is None:
        return sum(1 for _ in system.modes[0].constraints())
    return len(system.equations.defined)


def _index(disjunction):
    """Index of the data as a tuple, empty for a scalar Disjunction."""
    index = disjunction.index()
    return () if index is None else index if isinstance(index, tuple) else (index,)


def add(system, form, defined):
    """Generate everything for one Disjunction at one time, and switch the source off.

    Returns
    -------
    callable
        the sum of the multipliers of some modes, given by their numbers
    """
    block, index = _form_block(system, form), _index(system.disjunction)

    def weight(modes):
        return 1.0 if len(modes) == len(system.modes) else form.weight(block, index, system, modes)

    if form is None:
        _impose_only_mode(block, index, system)
    else:
        form.add(block, index, system)
        _blend(block, index, system, weight)
        _mark_indicators(block, system, weight)
        _map_form(block, index, system, form)
        defined.update((v, system.disjunction) for v in system.equations.defined)
    _switch_off(block, system)
    return weight


def _impose_only_mode(block, index, system):
    """One mode left: its equations and its region simply hold."""
    (mode,) = system.modes
    for j, con in enumerate(mode.constraints(), start=1):
        _connect(block, block.mode.add((*index, j), con.expr), system, [con])


def _mark_indicators(block, system, weight):
    """nu of every disjunct: the sum over the modes that it is part of."""
    for disjunct in system.tree.disjuncts():
        modes = [i for i, mode in enumerate(system.modes) if disjunct in mode]
        if modes:
            marks.mark(block, marks.INDICATOR, disjunct, weight(modes))


def _blend(block, index, system, weight):
    """v = sum_i nu_i f_i (eq. 7); v = f where all modes agree; mode copies of v where a mode is implicit."""
    equations = system.equations
    copies = [_copies(block, index, system, i) if None in f else f for i, f in enumerate(equations.rhs)]
    for j, v in enumerate(equations.defined):
        alike = [(modes, copies[modes[0]][j]) for modes in equations.alike[j]]
        if len(alike) == 1:
            expr = alike[0][1]
        else:
            expr = sum(weight(modes) * f for modes, f in alike if not (isinstance(f, (int, float)) and f == 0))
        _connect(block, block.mode.add((*index, j + 1), v == expr), system, [con for used in equations.used for con in used[j]])


def _copies(block, index, system, i):
    """Mode i's own copies v_i of the defined variables, with mode i's equations imposed on them (below eq. 7)."""
    equations = system.equations
    if block.component('own') is None:
        sets = (system.disjunction.parent_component().index_set(),) if index else ()
        block.implicit_modes = Set(dimen=1)
        block.own = Var(*sets, block.implicit_modes, block.numbers, dense=False)
        block.own_equation = Constraint(*sets, block.implicit_modes, block.numbers)
    block.implicit_modes.add(i + 1)
    own = [block.own[(*index, i + 1, j)] for j in range(1, 1 + len(equations.defined))]
    for copy, v in zip(own, equations.defined):
        copy.value = v.value
    swap = {id(v): copy for v, copy in zip(equations.defined, own)}
    for j, con in enumerate(equations.equations[i], start=1):
        body = replace_expressions(con.body, swap)
        _connect(block, block.own_equation.add((*index, i + 1, j), body == con.upper), system, [con])
    return own


def _connect(block, image, system, sources):
    maps = block.private_data('pyomo_fesd.dcs')
    maps.disjunction[image] = system.disjunction
    maps.sources[image] = sources
    for con in sources:
        maps.images.setdefault(con, []).append(image)


def _map_form(block, index, system, form):
    maps = block.private_data('pyomo_fesd.dcs')
    for con in form.equations(block, index):
        maps.disjunction[con] = system.disjunction
    for i, mode in enumerate(form.owners(system), start=1):
        condition = block.complementarity[(*index, i)]
        maps.disjunction[condition] = system.disjunction
        if mode is not None and len(system.modes[mode].innermost) == 1:
            (maps.disjunct[condition],) = system.modes[mode].innermost


def _switch_off(block, system):
    """The sources keep their contents, inactive, as after Pyomo's own GDP transformations."""
    for disjunction in (system.disjunction, *system.tree.nested):
        disjunction.deactivate()
    for disjunct in system.tree.disjuncts():
        if any(disjunct in mode for mode in system.modes):
            disjunct._deactivate_without_fixing_indicator()
            disjunct._transformation_block = ref(block)
        elif disjunct.active:
            if any(disjunct in mode for mode in system.tree.modes):
                marks.mark(block, marks.REPLACED, disjunct)
            disjunct.deactivate()
