"""Conditional integration: a controller's integrator rests while its actuator is saturated (theory, eq. 6).

    dI/dt = rate   where low <= u <= high,      dI/dt = 0   elsewhere           u: the command before it is limited

This is the limit of ``smooth_heaviside`` in IDAES' CONDITIONAL_INTEGRATION.  Where the integral would drive u over the limit and
its resting lets u fall back, u slides along the limit.

Takes: the derivative of the integral, its rate while it integrates, the command and its limits.
Leaves: the Disjuncts ``below``, ``integrates`` and ``above`` with their Disjunction ``integration``.
Does not apply: to back calculation, dI/dt = rate + (v - u)/T: with v from ``saturation`` that is an equation.
"""

from pyomo.core import Constraint, inequality
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd.units.over_time import block_over, like, refuse_order, variable


def anti_windup(*sets, integral_rate, rate, command, low, high):
    """Let the integrator rest beyond the limits of the actuator.

    Of an IDAES PIDController, built without anti-windup: ``integral_rate=pid.mv_integral_component_dot``,
    ``command=pid.mv_unbounded``, and ``pid.mv_integration_eqn`` is deactivated.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    integral_rate : DerivativeVar or Var over ``sets``
        which nothing else defines
    rate : Var, Expression, expression or function (block, index, ...) -> expression
        its value while the controller integrates, e.g. gain times error
    command : Var, Expression, expression or function
        the controller's output before it is limited
    low, high : number, Param, expression or function

    Returns
    -------
    Block over ``sets``, to be added to the model; ``fesd.dcs`` transforms it

    Raises
    ------
    FesdError
        for limits in the wrong order; when the Block is added, for an ``integral_rate`` that is no variable
    """
    refuse_order('anti_windup', low, high, ('low', 'high'))
    return block_over(sets, _build, integral_rate=integral_rate, rate=rate, command=command, low=low, high=high)


def _build(block, integral_rate, rate, command, low, high):
    integral_rate = variable(integral_rate, block, 'integral_rate')
    low, high = like(low, command), like(high, command)
    regions = {'below': command <= low, 'integrates': inequality(low, command, high), 'above': command >= high}
    for name, region in regions.items():
        mode = Disjunct()
        block.add_component(name, mode)
        mode.region = Constraint(expr=region)
        mode.rate = Constraint(expr=integral_rate == (rate if name == 'integrates' else 0 * rate))
    block.integration = Disjunction(expr=[block.component(name) for name in regions])
