"""Scaling by a guess: every variable near 1, every equation with a largest gradient entry of 1.

    s_x = 1/max(|x|, least),     s_g = 1/max_j |dg/dx_j|/s_x_j                at the present values

A flowsheet in SI units has enthalpies of 1e9 J beside flows of 1e-3 m3/s; without scaling its residuals mean nothing.

Takes: a block whose variables have sensible values.
Leaves: ``scaling_factor`` Suffixes, as IDAES keeps them, where a variable or constraint has no factor yet.
Does not apply: to values that say nothing, such as the zeros of an empty vessel: they get no factor.
"""

from pyomo.core import Block, Constraint, Suffix, Var
from pyomo.core.base.suffix import SuffixFinder
from pyomo.core.expr.calculus.derivatives import Modes, differentiate
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd import marks

NAME = 'scaling_factor'


def scale_by_values(block, least=1e-3):
    """Give what has no ``scaling_factor`` one that follows from the present values.

    Parameters
    ----------
    block : Block
        a model or flowsheet, best after discretisation and with a first guess
    least : float
        smallest magnitude of a variable that is not zero

    Returns
    -------
    int
        how many factors were set; what the package generates is scaled already
    """
    find = SuffixFinder(NAME, None, block.model()).find
    factors, count = {}, 0
    for v in block.component_data_objects(Var, descend_into=Block):
        given = find(v)
        if given is None and not v.fixed and v.value and not marks.is_generated(v):
            given = _set(v, 1 / max(abs(v.value), least))
            count += 1
        factors[id(v)] = given or 1.0
    for c in block.component_data_objects(Constraint, active=True, descend_into=Block):
        if find(c) is None and not marks.is_generated(c):
            largest = _largest(c.body, factors)
            if largest > 0:
                _set(c, 1 / largest)
                count += 1
    return count


def _largest(body, factors):
    """The largest entry of the gradient in scaled variables."""
    variables = list(identify_variables(body, include_fixed=False))
    slopes = differentiate(body, wrt_list=variables, mode=Modes.reverse_numeric) if variables else []
    return max((abs(slope) / factors.get(id(v), 1.0) for slope, v in zip(slopes, variables)), default=0.0)


def _set(component, factor):
    home = component.parent_block()
    if home.component(NAME) is None:
        home.add_component(NAME, Suffix(direction=Suffix.EXPORT))
    home.component(NAME)[component] = factor
    return factor
