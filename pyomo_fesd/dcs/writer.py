"""Write a dynamic complementarity system: once when ``fesd.dcs`` is applied, and again at the times that follow."""

from collections.abc import Callable
from contextlib import ExitStack

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentSet
from pyomo.core import Block
from pyomo.core.base.block import BlockData
from pyomo.dae import ContinuousSet
from pyomo.gdp import Disjunction

from pyomo_fesd.core import FesdError, TimeIndex, TimeWriter, discretised, paused_collection, switched_systems
from pyomo_fesd.dcs.blending import Blender, dcs_block
from pyomo_fesd.dcs.exclusion_pairs import write_exclusions
from pyomo_fesd.dcs.forms import heaviside, hysteresis, stewart
from pyomo_fesd.dcs.piecewise import PiecewiseRewriter, may_contain_functions
from pyomo_fesd.dcs.reading import (
    Analyses,
    Nesting,
    SystemReader,
    modes_left,
    read_exclusions,
    read_logic,
    refuse_lists_of_times,
    refuse_twice_defined,
)
from pyomo_fesd.dcs.source_maps import defined_variables
from pyomo_fesd.dcs.time_variables import TimeVariables

#: The forms: 'auto' takes the smallest that applies, the first of those as small.
FORMS = {form.NAME: form for form in (stewart, heaviside)}


class DcsWriter(TimeWriter):
    """One application of ``fesd.dcs``.

    Attributes
    ----------
    targets : list of components
    form : str
    hysteresis : list of components
        Disjunctions (or Blocks) whose modes have hysteresis
    defines : list of Var or VarData
        variables that modes define
    """

    __slots__ = ('targets', 'form', 'hysteresis', 'defines', '_analyses')
    # those of one model do not apply to its clone
    __autoslot_mappers__ = {'_analyses': AutoSlots.encode_as_none}

    def __init__(self, block, wrt, targets, form, hysteresis, defines):
        super().__init__(_one_block(block), wrt)
        self.targets, self.form, self.hysteresis, self.defines = targets or [block], form, hysteresis, defines
        self._analyses = None

    def write(self) -> None:
        """Write every Disjunction and piecewise function that is active at some time, and deactivate it."""
        model, times, defined = self.block.model(), TimeIndex(self.wrt), defined_variables(self.block)
        with_hysteresis = ComponentSet(_disjunctions(model, self.hysteresis))
        nesting = Nesting(model, times, with_hysteresis)
        targeted = list(_disjunctions(model, self.targets))
        refuse_lists_of_times(targeted, times)
        found = nesting.outermost(targeted, self.targets)
        # where time is not discretised yet, the same Disjunctions follow at further times
        analyses, self._analyses = self._analyses or Analyses(), None
        reader = SystemReader(TimeVariables(model, self.wrt, self.defines), times, analyses)
        with paused_collection(), ExitStack() as undo:
            trees = [nesting.tree(d) for d in found]
            propositions = read_logic(_blocks(self.targets), trees, times)
            modes = modes_left(trees, propositions)
            plain = [tree for tree in trees if tree.disjunction not in with_hysteresis and _holds_constraints_only(tree)]
            known = {tree: reader.recognise(tree, modes[tree]) for tree in plain}
            rewriter = PiecewiseRewriter(self.block, times, undo)
            rewriter.replace_all([*_blocks(self.targets), *self._disjuncts(found)], _disjuncts_of(known.values()))
            systems = [
                known.get(tree) or _read_system(reader, tree, modes[tree], tree.disjunction in with_hysteresis) for tree in trees
            ]
            refuse_twice_defined(systems, defined)
            exclusions = read_exclusions(propositions, systems)
            forms = _forms(self.form, systems)
            undo.pop_all()
            blender = Blender(defined, analyses.copies)
            weights = {system.tree: blender.blend(system, form) for system, form in zip(systems, forms)}
            for proposition in propositions:
                write_exclusions(dcs_block(proposition.constraint.parent_block()), proposition, exclusions, weights)
        self._analyses = None if discretised(self.wrt) else analyses

    def _disjuncts(self, disjunctions):
        """The active disjuncts, where Disjunctions are among the targets: no block of the targets need contain them."""
        named = any(target.ctype is Disjunction for target in self.targets)
        return [disjunct for d in disjunctions if named for disjunct in d.disjuncts if disjunct.active]

    def integrand(self, owner) -> Callable:
        """Return a function that replaces the piecewise functions of an integrand of ``owner``."""
        rewriter = PiecewiseRewriter(self.block, TimeIndex(self.wrt), ExitStack())
        return lambda expression: rewriter.replaced(expression, owner)


def continues_everywhere(block: Block, wrt: ContinuousSet) -> bool:
    """Return whether ``fesd.dcs``, applied to all of ``block``, waits for points of ``wrt``: then it writes all that is left."""
    waiting = switched_systems(block).waiting
    return any(isinstance(w, DcsWriter) and w.wrt is wrt and len(w.targets) == 1 and w.targets[0] is block for w in waiting)


def _one_block(instance):
    """The block that holds the components common to all of ``instance``."""
    return instance if isinstance(instance, BlockData) else instance.parent_block()


def _blocks(targets):
    """The blocks among the targets, one by one."""
    for target in targets:
        if target.ctype is Block:
            yield from target.values() if not isinstance(target, BlockData) else [target]


def _holds_constraints_only(tree):
    """Whether piecewise functions that are not replaced yet could lie in the Constraints of the disjuncts only."""
    return not any(map(may_contain_functions, tree.disjuncts()))


def _disjuncts_of(systems):
    """The disjuncts of the systems that were recognised, by id."""
    modes = (mode for system in systems if system is not None for mode in system.modes)
    return {id(disjunct): disjunct for mode in modes for disjunct in mode.disjuncts}


def _read_system(reader, tree, modes, with_hysteresis):
    """Read one system; a single mode needs no hysteresis."""
    if not with_hysteresis or len(modes) == 1:
        return reader.read(tree, modes)
    hysteresis.refuse_ambiguous(tree.disjunction, modes)
    return reader.read_hysteresis(tree, modes)


def _forms(name, systems):
    """The form of each system; of those that are built alike it is chosen once."""
    known, forms = {}, []
    for system in systems:
        first = system.first
        if id(first) not in known:
            known[id(first)] = _form(name, first)
        forms.append(known[id(first)])
    return forms


def _form(name, system):
    """The form that the keyword ``form`` names; None where one mode is left."""
    if len(system.modes) == 1:
        return None
    if hysteresis.applies(system):
        return hysteresis
    if name == 'auto':
        return min((form for form in FORMS.values() if form.applies(system)), key=lambda form: form.count(system))
    form = FORMS[name]
    if not form.applies(system):
        raise FesdError(system.disjunction, f"form='{name}' does not fit: {form.why_not(system)}", "use form='auto'")
    return form


def _disjunctions(model, targets):
    """Active DisjunctionData of the targets, in declaration order."""
    for target in targets:
        if target.model() is not model:
            raise FesdError(target, "fesd.dcs: this target belongs to another model", "give a component of the model itself")
        if target.ctype is Disjunction:
            yield from (d for d in (target.values() if hasattr(target, 'values') else [target]) if d.active)
        elif target.ctype is Block:
            for block in _blocks([target]):
                yield from block.component_data_objects(Disjunction, active=True, descend_into=Block)
        else:
            raise FesdError(
                target,
                f"fesd.dcs: a target must be a Block or a Disjunction, not a {target.ctype.__name__}",
                "give the block that holds the Disjunction, or the Disjunction itself",
            )
