"""What the rules for functions in pieces see of a model: one time of one component."""

from pyomo.common.collections import ComponentSet
from pyomo.core import Constraint
from pyomo.core.expr import identify_variables

from pyomo_fesd import marks
from pyomo_fesd.dcs.home import Home
from pyomo_fesd.dcs.images import switch_off
from pyomo_fesd.dcs.surfaces import Surfaces
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import derivatives


class Shared:
    """What all places of one model have in common.

    Parameters
    ----------
    instance : BlockData
        holds the new variables
    times : TimeIndex
    undo : ExitStack
        is told how to take back what is written

    Attributes
    ----------
    surfaces : Surfaces
    meshes : Home
        of functions of several arguments
    """

    def __init__(self, instance, times, undo):
        self.undo = undo
        self.surfaces = Surfaces(Home(instance, 'surfaces', times, undo))
        self.meshes = Home(instance, 'meshes', times, undo)
        self._rates = ComponentSet(derivatives(instance.model(), times.wrt))
        self._states = ComponentSet(d.get_state_var() for d in self._rates)
        self._made = {}

    def is_rate(self, v):
        """Whether ``v`` is data of a derivative with respect to time."""
        return v.parent_component() in self._rates

    def is_state(self, v):
        """Whether ``v`` is data of a differential state."""
        return v.parent_component() in self._states

    def once(self, make, key, *others):
        """``make(key, *others)``, once for each key."""
        if key not in self._made:
            self._made[key] = make(key, *others)
        return self._made[key]


class Place:
    """One time of one component.

    Attributes
    ----------
    shared : Shared
    owner : component that is named in messages
    time : time label
    """

    def __init__(self, shared, owner, time):
        self.shared, self.owner, self.time = shared, owner, time

    def positive_part(self, q, level):
        """max(0, q - level)."""
        return self.shared.surfaces.positive_part(self.time, q, level)

    def indicator(self, q, level, sign=1):
        """1 where sign (q - level) > 0, else 0.

        Raises
        ------
        FesdError
            where q cannot decide: it contains a jump, a derivative, or what the owner itself defines
        """
        for v in identify_variables(q, include_fixed=True):
            for refused, cause, fix in REFUSED:
                if refused(self, v):
                    raise FesdError(self.owner, f"its condition on '{q}' contains {cause.format(v.name)}", fix)
        return self.shared.surfaces.indicator(self.time, q, level, sign)

    def keep_inside(self, q, lower, upper):
        """Impose lower <= q <= upper."""
        self.shared.surfaces.keep_inside(self.time, q, lower, upper)

    def bends_by(self, then, otherwise, q, level):
        """f where ``then - otherwise`` is f (q - level), None where it jumps."""
        return self.shared.surfaces.bends_by(then, otherwise, q, level)

    def switch_off(self, component):
        """Deactivate a function whose value has been replaced."""
        switch_off(component, self.shared.undo)


def _jumps(place, v):
    return marks.is_generated(v) and v.parent_component().local_name == 'alpha'


def _is_rate(place, v):
    return place.shared.is_rate(v)


def _is_defined_here(place, v):
    """Whether the owner is an equation of which a variable is one side."""
    owner = place.owner
    stands_alone = owner.ctype is Constraint and owner.equality and any(side is v for side in owner.expr.args)
    return stands_alone and not place.shared.is_state(v)


#: Variables that a condition cannot contain: test, cause and fix.
REFUSED = (
    (_jumps, "a function that jumps", "join conditions on what does not jump by land, lor and lnot"),
    (_is_rate, "the derivative '{}'", "let states decide; a rate that decides makes the pieces depend on themselves"),
    (_is_defined_here, "'{}', which it defines itself", "let states decide, or variables that do not jump at the switch"),
)
