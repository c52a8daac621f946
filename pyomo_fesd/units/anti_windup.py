"""Conditional integration: a controller's integrator is held while its actuator is saturated (theory, eq. 6).

    dI/dt = rate   where low <= u <= high,      dI/dt = 0   elsewhere           u: the command before it is limited

This is the limit of ``smooth_heaviside`` in IDAES' CONDITIONAL_INTEGRATION.  Where the integral would drive u over the limit and
holding it lets u fall back, u slides along the limit.

Takes: the derivative of the integral, its rate while it integrates, the command and its limits.
Leaves: the Disjuncts ``below``, ``integrates`` and ``above`` with their Disjunction ``integration``.
Does not apply: to back calculation, dI/dt = rate + (v - u)/T: with v from ``saturation`` that is an equation.
"""

from pyomo.core import Block, Constraint, inequality
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd.units.over_time import block_over, refuse_order, variable, with_unit


def anti_windup(*sets, integral_rate, rate, command, low, high) -> Block:
    """Return a Block over ``sets`` that holds the integrator beyond the limits of the actuator; ``fesd.dcs`` transforms it.

    Of an IDAES PIDController, built without anti-windup: ``integral_rate=pid.mv_integral_component_dot``,
    ``command=pid.mv_unbounded``, and ``pid.mv_integration_eqn`` is deactivated.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    integral_rate : DerivativeVar or Var over ``sets``
        defined by nothing else
    rate : Var, Expression, expression or function (block, index, ...) -> expression
        its value while the controller integrates, e.g. gain times error
    command : Var, Expression, expression or function
        the controller's output before it is limited
    low, high : number, Param, expression or function

    Raises
    ------
    FesdError
        for limits in the wrong order; when the Block is added, for an ``integral_rate`` that is not a Var
    """
    refuse_order('anti_windup', low=low, high=high)
    return block_over(sets, _build_anti_windup, integral_rate=integral_rate, rate=rate, command=command, low=low, high=high)


def _build_anti_windup(block, integral_rate, rate, command, low, high):
    integral_rate = variable(integral_rate, block, 'integral_rate')
    low, high = with_unit(low, command), with_unit(high, command)
    regions = {'below': command <= low, 'integrates': inequality(low, command, high), 'above': command >= high}
    for name, region in regions.items():
        mode = Disjunct()
        block.add_component(name, mode)
        mode.region = Constraint(expr=region)
        mode.rate = Constraint(expr=integral_rate == (rate if name == 'integrates' else 0 * rate))
    block.integration = Disjunction(expr=[block.component(name) for name in regions])
