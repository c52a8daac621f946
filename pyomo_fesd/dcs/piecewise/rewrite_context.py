"""The view that the rules for piecewise functions have of a model: one time of one component."""

from functools import cached_property

from pyomo.core import Constraint
from pyomo.core.expr import identify_variables

from pyomo_fesd.core import FesdError, is_generated, switched_systems
from pyomo_fesd.dcs.piecewise.breakpoints import Breakpoints
from pyomo_fesd.dcs.piecewise.generated_blocks import GeneratedBlocks
from pyomo_fesd.dcs.piecewise.replaced_constraints import deactivate
from pyomo_fesd.dcs.time_variables import TimeVariables


class SharedContext:
    """The part of a context that is the same for all of one model.

    Parameters
    ----------
    instance : BlockData
        holds the new variables
    times : TimeIndex
    undo : ExitStack
        receives callbacks that undo all changes

    Attributes
    ----------
    breakpoints : Breakpoints
    interpolations : GeneratedBlocks
        of functions of several arguments
    """

    def __init__(self, instance, times, undo):
        self.times, self.undo, self._model = times, undo, instance.model()
        self.breakpoints = Breakpoints(GeneratedBlocks(instance, 'surfaces', times, undo))
        self.interpolations = GeneratedBlocks(instance, 'meshes', times, undo)
        self._made = {}

    @cached_property
    def variables(self):
        """The derivatives and states; read where a piecewise function has a condition."""
        return TimeVariables(self._model, self.times.wrt)

    def once(self, make, key, *others):
        """Return ``make(key, *others)``, made once for each key."""
        if key not in self._made:
            self._made[key] = make(key, *others)
        return self._made[key]


class RewriteContext:
    """One time of one component.

    Attributes
    ----------
    shared : SharedContext
    owner : component that is named in messages
    time : time label
    """

    def __init__(self, shared, owner, time):
        self.shared, self.owner, self.time = shared, owner, time

    def positive_part(self, q, level):
        """Return max(0, q - level)."""
        return self.shared.breakpoints.positive_part(self.time, q, level)

    def indicator(self, q, level, sign=1):
        """Return 1 where sign (q - level) > 0, else 0.

        Raises
        ------
        FesdError
            where q contains a jump, a derivative, or a variable that the owner itself defines
        """
        for v in identify_variables(q, include_fixed=True):
            for refused, cause, fix in REFUSED:
                if refused(self, v):
                    raise FesdError(self.owner, f"its condition on '{q}' contains {cause.format(v.name)}", fix)
        return self.shared.breakpoints.indicator(self.time, q, level, sign)

    def keep_inside(self, q, lower, upper):
        """Impose lower <= q <= upper."""
        self.shared.breakpoints.keep_inside(self.time, q, lower, upper)

    def slope_of_difference(self, then, otherwise, q, level):
        """Return f with ``then - otherwise`` = f (q - level) everywhere; None where it jumps."""
        return self.shared.breakpoints.quantities.slope_of_difference(then, otherwise, q, level)

    def deactivate(self, component):
        """Deactivate a function whose value has been replaced."""
        deactivate(component, self.shared.undo)


def _jumps(context, v):
    return is_generated(v) and v.parent_component() in switched_systems(v.parent_block()).selectors


def _is_derivative(context, v):
    return context.shared.variables.is_derivative(v)


def _is_defined_here(context, v):
    """Whether the owner is an equation of which a variable is one side."""
    owner = context.owner
    stands_alone = owner.ctype is Constraint and owner.equality and any(side is v for side in owner.expr.args)
    return stands_alone and not context.shared.variables.is_state(v)


#: Variables that a condition cannot contain: test, cause and fix.
REFUSED = (
    (_jumps, "a function that jumps", "join conditions on continuous quantities by land, lor and lnot"),
    (
        _is_derivative,
        "the derivative '{}'",
        "write it on states; a derivative here would make the branch depend on itself",
    ),
    (
        _is_defined_here,
        "'{}', which it defines itself",
        "write it on states, or on variables that do not jump at the switch",
    ),
)
