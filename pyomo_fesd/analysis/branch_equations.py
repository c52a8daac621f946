"""A copy of a model in which every pair is the equation of its present branch: for tools that know equations only.

    0 <= G perp H >= 0      becomes      G = 0   where G <= H at the present values,   else   H = 0

with the element lengths fixed at their present values.  At a solution the copy is a square system with that solution, which tools
such as IDAES' DiagnosticsToolbox count and examine; on the model itself they find as many degrees of freedom as there are pairs.

Takes: a model with present values, best a solution.
Leaves: a clone; the model as it is.
Does not apply: to searching for another branch.
"""

from pyomo.core import Block, ConstraintList, Var
from pyomo.core.base.block import BlockData
from pyomo.mpec import Complementarity

from pyomo_fesd.analysis.degrees_of_freedom import Given, equations_of, pair_sides
from pyomo_fesd.core import FesdError, moving_grids, refuse_no_model, value_or_nan

NAME = 'branch_equations'


def branch_equations(model: Block) -> BlockData:
    """Return a clone of ``model`` whose pairs are the equations of their present branch, in a ConstraintList ``branch_equations``.

    Raises
    ------
    FesdError
        for a pair without a value, and for a Block of a model
    """
    refuse_no_model(model, NAME)
    if model.model() is not model:
        raise FesdError(model, f"{NAME}: this is a Block of a model", "pass the model")
    copy = model.clone()
    given = Given(copy)
    pairs = [c for c, _ in equations_of(copy, given) if c.ctype is Complementarity]
    copy.add_component(NAME, ConstraintList())
    for pair in pairs:
        copy.component(NAME).add(_smaller(pair) == 0)
    for condition in list(copy.component_objects(Complementarity, descend_into=Block)):
        condition.deactivate()  # with its container: assert_units_consistent refuses an active one
    grids = moving_grids(copy)
    for moving in grids.values():
        for v in moving.block.component_data_objects(Var, descend_into=Block):
            v.fix()
        moving.block.deactivate()
    grids.clear()  # elements of the copy do not move
    return copy


def _smaller(pair):
    sides = pair_sides(pair)
    numbers = [value_or_nan(side) for side in sides]
    for number in numbers:
        if number != number:
            raise FesdError(pair, f"{NAME}: a side has no value", "solve or simulate first")
    return sides[numbers.index(min(numbers))]
