"""The step function of an expression c: the Heaviside form, functions that jump and friction are made of it (theory, eq. 5).

    c/[c] = p - n,    0 <= alpha  perp  n >= 0,    0 <= 1 - alpha  perp  p >= 0

so alpha is 1 where c > 0 and 0 where c < 0; p = max(0, c) and n = max(0, -c) are continuous in time where c is.  [c] is the unit
of c, 1 in most models.

Takes: a block of its own, and c as an expression.
Leaves: ``alpha``, ``p``, ``n``, ``switching`` (c = p - n) and ``complementarity`` (its last index: 1 and 2) on that block.
Does not apply: to continuous piecewise functions, which need one variable only (``positive_part.py``).
"""

from math import nan

from pyomo.core import Constraint, Var
from pyomo.core.base.block import BlockData
from pyomo.core.base.var import VarData
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core.evaluation import value_or_zero
from pyomo_fesd.core.insertion import insert
from pyomo_fesd.core.switched_systems import Dependents, Step, switched_systems
from pyomo_fesd.core.time_index import stored_index
from pyomo_fesd.core.units_of_measure import without_unit

#: Values below this are 0.
ZERO = 1e-8


def declare_step(block: BlockData, *sets) -> None:
    """Declare the components on ``block`` over the ``sets`` (without sets: as scalars)."""
    sparse = {'dense': False} if sets else {}
    block.alpha = Var(*sets, **sparse, bounds=(0, 1))
    block.p = Var(*sets, **sparse, bounds=(0, None))
    block.n = Var(*sets, **sparse, bounds=(0, None))
    block.switching = Constraint(*sets)
    block.complementarity = Complementarity(*sets, [1, 2])
    systems = switched_systems(block)
    systems.selectors.add(block.alpha)
    systems.continuous[block.p] = systems.continuous[block.n] = block.switching


def add_step(block: BlockData, index: tuple, c, lean: float = 0.0) -> VarData:
    """Add the step function of c at ``index`` (empty for a scalar) and return alpha.

    Parameters
    ----------
    lean : float
        alpha starts at 1/2, changed by ``lean`` towards the side of c at the present values
    """
    systems = switched_systems(block)
    alpha, p, n = (variable[stored_index(index)] for variable in (block.alpha, block.p, block.n))
    start_step((p, n, alpha), c, lean)
    insert(block.switching, index, without_unit(c) == p - n)
    insert(block.complementarity, (*index, 1), complements(alpha >= 0, n >= 0))
    insert(block.complementarity, (*index, 2), complements(1 - alpha >= 0, p >= 0))
    systems.steps.append(Step(alpha, c))
    systems.dependents.append(Dependents((p, n, alpha), (c,), step_values))
    return alpha


def start_step(variables: tuple, c, lean: float = 0.0) -> None:
    """Set the start values of p, n and alpha from the present value of c."""
    now = float(value_or_zero(c))  # start values may be numpy numbers, whose comparisons cannot be subtracted
    starts = max(now, 0.0), max(-now, 0.0), 0.5 + lean * ((now > 0) - (now < 0))
    for variable, start in zip(variables, starts):
        variable.set_value(start, skip_validation=True)


def step_values(arguments: list[float]) -> list[float]:
    """Return p, n and alpha of one value of c; alpha is nan, open, where c is 0."""
    (c,) = arguments
    return [max(c, 0.0), max(-c, 0.0), nan if abs(c) <= ZERO else float(c > 0)]
