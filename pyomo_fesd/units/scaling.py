"""Scaling by a first guess: every variable near 1, every equation with a largest gradient entry of 1.

    s_x = 1/max(|x|, least),     s_g = 1/max_j |dg/dx_j|/s_x_j                at the present values

A flowsheet in SI units has enthalpies of 1e9 J beside flows of 1e-3 m3/s; without scaling its residuals mean nothing.

Takes: a block whose variables have sensible values.
Leaves: ``scaling_factor`` Suffixes, as IDAES keeps them, where a variable or constraint has no factor yet.
Does not apply: to variables at zero, such as those of an empty vessel, and equations with variables without a value: they get no
factor.
"""

import logging
from math import isnan, nan

from pyomo.common.collections import ComponentMap
from pyomo.common.gc_manager import PauseGC
from pyomo.core import Block, Constraint, Suffix
from pyomo.core.base.suffix import SuffixFinder
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import gradients, is_generated, variables_below

logger = logging.getLogger('pyomo_fesd')

NAME = 'scaling_factor'


def scale_by_values(block, least: float = 1e-3) -> int:
    """Set a ``scaling_factor`` from the present values where there is none, and return the number of factors set.

    Components that the package generates are scaled already and get none.

    Parameters
    ----------
    block : Block
        a model or flowsheet, best after discretisation and with a first guess
    least : float
        smallest magnitude of a variable that is not zero
    """
    with PauseGC():
        new = _factors(block, least)
        for component, factor in new.items():
            _set_factor(component, factor)
    return len(new)


def _factors(block, least):
    """Factors of the variables and equations that have none."""
    find = SuffixFinder(NAME, None, block.model()).find
    variables = list(variables_below(block))
    free = (v for v in variables if v.value and not v.fixed)
    new = ComponentMap((v, 1 / max(abs(v.value), least)) for v in _unscaled(free, find))
    factors = {id(v): new.get(v) or find(v) or 1.0 for v in variables}
    equations = list(_unscaled(block.component_data_objects(Constraint, active=True, descend_into=Block), find))
    found = [_equation_factor(*slopes, factors) for slopes in gradients(c.body for c in equations)]
    _warn_without_value([c for c, factor in zip(equations, found) if isnan(factor)])
    new.update((c, factor) for c, factor in zip(equations, found) if factor > 0)
    return new


def _unscaled(datas, find):
    """Data of the user without a factor."""
    generated = ComponentMap()
    for data in datas:
        component = data.parent_component()
        if component not in generated:
            generated[component] = is_generated(component)
        if not generated[component] and find(data) is None:
            yield data


def _equation_factor(variables, slopes, factors):
    """The factor that scales the largest entry of an equation's gradient in scaled variables to 1; 0 for none, NaN if undefined."""
    scaled = [abs(slope) / factors.get(id(v), 1.0) for slope, v in zip(slopes, variables) if not v.fixed]
    if any(map(isnan, scaled)):
        return nan
    return 1 / max(scaled) if any(scaled) else 0.0


def _warn_without_value(equations):
    if equations:
        missing = [v for v in identify_variables(equations[0].body, include_fixed=True) if v.value is None]
        logger.warning(
            "scale_by_values: %d equations have no gradient at the present values and get no factor, such as '%s'%s. Give values "
            "first, by an initialiser or simulate.",
            len(equations),
            equations[0].name,
            f", where '{missing[0].name}' has none" if missing else '',
        )


def _set_factor(component, factor):
    block = component.parent_block()
    if block.component(NAME) is None:
        block.add_component(NAME, Suffix(direction=Suffix.EXPORT))
    block.component(NAME)[component] = factor
