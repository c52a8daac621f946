"""``fesd.dcs``: Disjunctions and functions in pieces over time become a dynamic complementarity system."""

from contextlib import ExitStack
from weakref import ref

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.common.config import ConfigDict, ConfigValue, In, document_class_CONFIG
from pyomo.common.gc_manager import PauseGC
from pyomo.core import Block, Constraint, Set, Transformation, TransformationFactory, Var
from pyomo.core.base.block import BlockData
from pyomo.core.expr.visitor import replace_expressions
from pyomo.core.util import target_list
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd import marks, records
from pyomo_fesd.dcs import memory, stewart, two_mode
from pyomo_fesd.dcs.images import image, source
from pyomo_fesd.dcs.pieces import Pieces
from pyomo_fesd.dcs.system import Reader, refuse_logic_over_time
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import TimeIndex, derivatives, find_continuous_set

#: The forms, smallest first: 'auto' takes the first that applies.
FORMS = {form.NAME: form for form in (two_mode, stewart)}


@TransformationFactory.register('fesd.dcs', doc="Time-indexed Disjunctions to a dynamic complementarity system (Filippov)")
@document_class_CONFIG(methods=['apply_to', 'create_using'])
class DynamicComplementaritySystem(Transformation):
    """Replace every Disjunction over time by the Filippov multipliers of its modes (theory, eq. 2-7).

    For a Disjunction with modes i, regions R_i (its inequalities) and equations that define variables v (its equalities),

        v = sum_i nu_i f_i,   sum_i nu_i = 1,   nu_i >= 0,   nu_i = 0 outside the closure of R_i

    with the conditions on nu as complementarity in the smallest form that fits: eq. (5) for two modes, eq. (3) for more.
    An equation that all modes share is not blended; a mode that is switched off leaves nothing; if only one mode is left, its
    constraints hold as they are.

    Functions in pieces over time (``Piecewise``, ``PiecewiseLinearFunction``, ``Expr_if``) become complementarity too, by eq. (8)
    where they are continuous and by eq. (5) where they jump.

    Works on a model before and after discretisation.  On a model that is not discretised yet, the later expansion by
    ``fesd.finite_elements`` continues with the new times.

    Raises
    ------
    FesdError
        naming the component, the cause and the fix; the model is then as it was.

    Source: paper, eq. (2)-(6); Stewart (1990); Nurkanovic and Diehl (2022).
    """

    CONFIG = ConfigDict('fesd.dcs')
    CONFIG.declare(
        'targets',
        ConfigValue(domain=target_list, description="Blocks or Disjunctions to transform; default: the whole model"),
    )
    CONFIG.declare('wrt', ConfigValue(description="the ContinuousSet of time; may be left out if there is only one"))
    CONFIG.declare(
        'form',
        ConfigValue(
            default='auto',
            domain=In(['auto', *FORMS]),
            description="'two_mode' (eq. 5), 'stewart' (eq. 3), or 'auto': the smallest that fits",
        ),
    )
    CONFIG.declare(
        'memory',
        ConfigValue(
            default=[],
            domain=target_list,
            description="Disjunctions (or Blocks with Disjunctions) with hysteresis: where regions overlap the last mode goes on; "
            "the mode at the first time is told by fixing its indicator there",
        ),
    )

    def _apply_to(self, instance, **kwds):
        config = self.CONFIG(kwds.pop('options', {}))
        config.set_value(kwds)
        wrt = find_continuous_set(instance, config.wrt, 'fesd.dcs')
        times = TimeIndex(wrt)
        found = [d for d in _disjunctions(instance, config.targets) if times.time(d) is not None]
        for block in _blocks(instance, config.targets):
            refuse_logic_over_time(block, times.time)
        reader = Reader(derivatives(instance.model(), wrt), times)
        with PauseGC(), ExitStack() as undo:
            remembered = ComponentSet(_disjunctions(instance, config.memory)) if config.memory else ()
            inside = [disjunct for d in found if config.targets for disjunct in d.disjuncts if disjunct.active]
            Pieces(_one_block(instance), times, undo).replace_all([*_blocks(instance, config.targets), *inside])
            systems = [memory.read(reader, d) if d in remembered else reader.read(d) for d in found]
            forms = [self._form(config.form, system) for system in systems]
            undo.pop_all()
            for system, form in zip(systems, forms):
                _add(system, form)
        keywords = {'targets': config.targets, 'form': config.form, 'memory': config.memory}
        records.repeat_after_expansion(instance, 'fesd.dcs', wrt, **keywords)
        records.rewrite_integrands(instance, 'fesd.dcs', wrt)

    def rewriter(self, instance, wrt, owner):
        """A function that replaces the functions in pieces of an integrand of ``owner``, which is built after this."""
        pieces = Pieces(_one_block(instance), TimeIndex(wrt), ExitStack())
        return lambda expression: pieces.replaced(expression, owner)

    @staticmethod
    def _form(wanted, system):
        if len(system.modes) == 1:
            return None
        if memory.applies(system):
            return memory
        for name, form in FORMS.items():
            if wanted in ('auto', name) and form.applies(system):
                return form
        raise FesdError(
            system.disjunction,
            f"form='{wanted}' does not fit: {len(system.modes)} modes with {len(system.regions.functions)} switching function(s)",
            "use form='auto'",
        )

    # Pyomo's names for the reverse maps

    def get_src_disjunction(self, component):
        """The DisjunctionData that a generated constraint or complementarity came from."""
        return _maps(component).disjunction[component]

    def get_src_disjunct(self, component):
        """The DisjunctData whose multiplier a generated complementarity holds."""
        return _maps(component).disjunct[component]

    def get_src_constraint(self, component):
        """The constraints of the disjuncts that a generated constraint blends (a list, one or more for each mode).

        For the image of a constraint or a Piecewise outside disjuncts, a list of this one.
        """
        if source(component) is not None:
            return [source(component)]
        return [con if source(con) is None else source(con) for con in _maps(component).sources[component]]

    def get_transformed_constraints(self, constraint):
        """The generated constraints that took the place of a ``constraint`` of a disjunct, or of one with functions in pieces."""
        alone = image(constraint)
        constraint = constraint if alone is None else alone
        disjunct = constraint.parent_block()
        while disjunct is not None and disjunct.ctype is not Disjunct:
            disjunct = disjunct.parent_block()
        if disjunct is None:
            return [] if alone is None else [alone]
        block = disjunct.transformation_block
        return [] if block is None else block.private_data('pyomo_fesd.dcs').images.get(constraint, [])

    def get_multipliers(self, disjunction):
        """nu of a transformed DisjunctionData: a ComponentMap from its disjuncts to expressions."""
        block = _dcs_block(disjunction)
        marked = ComponentMap(marks.marked(block, marks.INDICATOR)) if block is not None else ComponentMap()
        return ComponentMap((d, marked[d]) for d in disjunction.disjuncts if d in marked)


class _Maps(AutoSlots.Mixin):
    """Where the generated components came from; kept as private data of the block that holds them."""

    __slots__ = ('disjunction', 'disjunct', 'sources', 'images')

    def __init__(self):
        self.disjunction = ComponentMap()
        self.disjunct = ComponentMap()
        self.sources = ComponentMap()
        self.images = ComponentMap()


Block.register_private_data_initializer(_Maps, scope='pyomo_fesd.dcs')


def _maps(component):
    return component.parent_block().private_data('pyomo_fesd.dcs')


def _one_block(instance):
    """The block that holds what belongs to all of ``instance``."""
    return instance if isinstance(instance, BlockData) else instance.parent_block()


def _blocks(instance, targets):
    """The blocks in which to look."""
    for target in targets or [instance]:
        if target.ctype is Block:
            yield from target.values() if not isinstance(target, BlockData) else [target]


def _disjunctions(instance, targets):
    """Active DisjunctionData of the targets, in declaration order."""
    for target in targets or [instance]:
        if target.model() is not instance.model():
            raise FesdError(target, "fesd.dcs: this target belongs to another model", "give a component of the model itself")
        if target.ctype is Disjunction:
            yield from (d for d in (target.values() if hasattr(target, 'values') else [target]) if d.active)
        elif target.ctype is Block:
            for block in _blocks(instance, [target]):
                yield from block.component_data_objects(Disjunction, active=True, descend_into=Block)
        else:
            raise FesdError(
                target,
                f"fesd.dcs: a target must be a Block or a Disjunction, not a {target.ctype.__name__}",
                "give the block that holds the Disjunction, or the Disjunction itself",
            )


def _dcs_block(disjunction):
    """The block of everything generated on the parent of ``disjunction``; None before."""
    return disjunction.parent_block().component(marks.GENERATED + 'dcs')


def _form_block(system, form):
    """The block that holds one form of one Disjunction; made at its first time."""
    disjunction = system.disjunction
    component, parent = disjunction.parent_component(), disjunction.parent_block()
    if _dcs_block(disjunction) is None:
        parent.add_component(marks.GENERATED + 'dcs', Block())
    name = component.local_name
    if form is None:
        name += '_single_mode'
    elif form is not two_mode:
        name += f'_{form.NAME}_{form.size(system)}'
    block = _dcs_block(disjunction).component(name)
    if block is None:
        block = Block()
        _dcs_block(disjunction).add_component(name, block)
        index = (component.index_set(),) if component.is_indexed() else ()
        if form is two_mode:
            form.declare(block, index)
        elif form is not None:
            form.declare(block, index, form.size(system))
        block.numbers = Set(dimen=1)
        block.mode = Constraint(*index, block.numbers)
    for j in range(1, 1 + _number_of_equations(system)):
        block.numbers.add(j)
    return block


def _number_of_equations(system):
    if system.equations is None:
        return sum(1 for _ in system.modes[0].component_data_objects(Constraint, active=True, descend_into=Block))
    return len(system.equations.defined)


def _index(disjunction):
    """Index of the data as a tuple, empty for a scalar Disjunction."""
    index = disjunction.index()
    return () if index is None else index if isinstance(index, tuple) else (index,)


def _add(system, form):
    """Generate everything for one Disjunction at one time, and switch the source off."""
    block, index = _form_block(system, form), _index(system.disjunction)
    if form is None:
        _impose_only_mode(block, index, system)
    else:
        weights = form.add(block, index, system)
        _blend(block, index, system, weights)
        for disjunct, weight in zip(system.modes, weights):
            marks.mark(block, marks.INDICATOR, disjunct, weight)
        _map_form(block, index, system, form)
    _switch_off(block, system)


def _impose_only_mode(block, index, system):
    """One mode left: its equations and its region simply hold."""
    (disjunct,) = system.modes
    constraints = disjunct.component_data_objects(Constraint, active=True, descend_into=Block)
    for j, con in enumerate(constraints, start=1):
        _connect(block, block.mode.add((*index, j), con.expr), system, [con])


def _blend(block, index, system, weights):
    """v = sum_i nu_i f_i (eq. 7); v = f where all modes agree; mode copies of v where a mode is implicit."""
    equations = system.equations
    copies = [_copies(block, index, system, i) if None in f else f for i, f in enumerate(equations.rhs)]
    for j, v in enumerate(equations.defined):
        if equations.shared(j):
            expr = copies[0][j]
        else:
            expr = sum(w * f[j] for w, f in zip(weights, copies) if not (isinstance(f[j], (int, float)) and f[j] == 0))
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
    if form is memory:
        return  # its conditions belong to the elements, not to points in time
    owners = [d for d, patterns in zip(system.modes, system.regions.patterns) for _ in patterns]
    for i, disjunct in enumerate(owners, start=1):
        condition = block.complementarity[(*index, i)]
        maps.disjunction[condition] = system.disjunction
        maps.disjunct[condition] = disjunct


def _switch_off(block, system):
    """The sources keep their contents, inactive, as after Pyomo's own GDP transformations."""
    system.disjunction.deactivate()
    for disjunct in system.disjunction.disjuncts:
        if disjunct.active and disjunct not in ComponentSet(system.modes):
            disjunct.deactivate()
    for disjunct in system.modes:
        disjunct._deactivate_without_fixing_indicator()
        disjunct._transformation_block = ref(block)
