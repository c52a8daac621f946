"""``fesd.dcs``: Disjunctions and functions in pieces over time become a dynamic complementarity system."""

from contextlib import ExitStack

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.common.config import ConfigDict, ConfigValue, In, document_class_CONFIG
from pyomo.common.gc_manager import PauseGC
from pyomo.core import Block, Transformation, TransformationFactory
from pyomo.core.base.block import BlockData
from pyomo.core.util import target_list
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd import marks, records
from pyomo_fesd.dcs import heaviside, memory, stewart, two_mode
from pyomo_fesd.dcs.generate import add, dcs_block, maps
from pyomo_fesd.dcs.images import image, source
from pyomo_fesd.dcs.logic import modes_left, read_exclusions, read_logic, replace_logic
from pyomo_fesd.dcs.nested import Nesting
from pyomo_fesd.dcs.pieces import Pieces
from pyomo_fesd.dcs.system import Reader, refuse_twice_defined
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import TimeIndex, derivatives, find_continuous_set

#: The forms: 'auto' takes the smallest that applies, the first of those as small.
FORMS = {form.NAME: form for form in (two_mode, stewart, heaviside)}


@TransformationFactory.register('fesd.dcs', doc="Time-indexed Disjunctions to a dynamic complementarity system (Filippov)")
@document_class_CONFIG(methods=['apply_to', 'create_using'])
class DynamicComplementaritySystem(Transformation):
    """Replace every Disjunction over time by the Filippov multipliers of its modes (theory, eq. 2-7).

    For a Disjunction with modes i, regions R_i (its inequalities) and equations that define variables v (its equalities),

        v = sum_i nu_i f_i,   sum_i nu_i = 1,   nu_i >= 0,   nu_i = 0 outside the closure of R_i

    with the conditions on nu as complementarity in the smallest form that fits: eq. (5) for two modes, eq. (3) or (6) for more.
    An equation that all modes share is not blended; a mode that is switched off leaves nothing; if only one mode is left, its
    constraints hold as they are.  Nested Disjunctions are one system, whose modes are the ways down to an innermost disjunct.
    LogicalConstraints over time between the indicators of modes switch modes off, or become pairs that exclude combinations.

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
            description="'two_mode' (eq. 5), 'stewart' (eq. 3), 'heaviside' (eq. 6), or 'auto': the smallest that fits",
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
        remembered = ComponentSet(_disjunctions(instance, config.memory)) if config.memory else ComponentSet()
        nesting = Nesting(instance.model(), times, remembered)
        found = nesting.outermost(_disjunctions(instance, config.targets), config.targets or ())
        reader = Reader(derivatives(instance.model(), wrt), times)
        defined = instance.model().private_data('pyomo_fesd.dcs').defined
        with PauseGC(), ExitStack() as undo:
            inside = [disjunct for d in found if config.targets for disjunct in d.disjuncts if disjunct.active]
            Pieces(_one_block(instance), times, undo).replace_all([*_blocks(instance, config.targets), *inside])
            trees = [nesting.tree(d) for d in found]
            propositions = read_logic(_blocks(instance, config.targets), trees, times)
            modes = modes_left(trees, propositions)
            systems = [_read(reader, tree, modes[tree], tree.disjunction in remembered) for tree in trees]
            refuse_twice_defined(systems, defined)
            exclusions = read_exclusions(propositions, systems)
            forms = [self._form(config.form, system) for system in systems]
            undo.pop_all()
            weights = {system.tree: add(system, form, defined) for system, form in zip(systems, forms)}
            for proposition in propositions:
                replace_logic(dcs_block(proposition.constraint.parent_block()), proposition, exclusions, weights)
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
        if wanted == 'auto':
            return min((form for form in FORMS.values() if form.applies(system)), key=lambda form: form.count(system))
        form = FORMS[wanted]
        if not form.applies(system):
            raise FesdError(system.disjunction, f"form='{wanted}' does not fit: {form.why_not(system)}", "use form='auto'")
        return form

    # Pyomo's names for the reverse maps

    def get_src_disjunction(self, component):
        """The DisjunctionData that a generated constraint or complementarity came from."""
        return maps(component).disjunction[component]

    def get_src_disjunct(self, component):
        """The DisjunctData whose multiplier a generated complementarity holds.

        A step variable of the Heaviside form that is no mode's own multiplier has none: ``KeyError``.
        """
        return maps(component).disjunct[component]

    def get_src_constraint(self, component):
        """The constraints of the disjuncts that a generated constraint blends (a list, one or more for each mode).

        Of a pair that excludes modes, the LogicalConstraint that says so; for the image of a constraint or a Piecewise outside
        disjuncts, a list of this one.
        """
        if source(component) is not None:
            return [source(component)]
        found = maps(component).sources[component]
        if not isinstance(found, list):
            return found
        return [con if source(con) is None else source(con) for con in found]

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
        blocks = ComponentSet(d.transformation_block for d in disjunction.disjuncts if d.transformation_block is not None)
        marked = ComponentMap(item for block in blocks for item in marks.marked(block, marks.INDICATOR))
        return ComponentMap((d, marked[d]) for d in disjunction.disjuncts if d in marked)


def _blocks(instance, targets):
    """The blocks in which to look."""
    for target in targets or [instance]:
        if target.ctype is Block:
            yield from target.values() if not isinstance(target, BlockData) else [target]


def _one_block(instance):
    """The block that holds what belongs to all of ``instance``."""
    return instance if isinstance(instance, BlockData) else instance.parent_block()


def _read(reader, tree, modes, remembered):
    """One system; one mode that is left needs no memory."""
    return memory.read(reader, tree, modes) if remembered and len(modes) > 1 else reader.read(tree, modes)


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
