"""``covariance``: how uncertain estimates are, from the reduced Hessian at a certified solution."""

import numpy as np
import pandas as pd
from pyomo.core import Block

from pyomo_fesd.core import FesdError, interruptible
from pyomo_fesd.sensitivities.branch_system import BranchSystem
from pyomo_fesd.sensitivities.outputs import gradients, read_outputs
from pyomo_fesd.solvers import certified_model, user_names

#: A variance may be negative by this part of the largest one, by round-off.
ROUND_OFF = 1e-9


@interruptible
def covariance(model: Block, estimates, variance: float = 1.0, **options) -> pd.DataFrame:
    """Return the covariance matrix of estimates at a certified least-squares solution.

    The objective is the sum of squared residuals of independent measurements with the same ``variance``; where they differ, divide
    each residual by its standard deviation.  To first order in the noise

        Cov = 2 variance W' (Z' H Z)^-1 W

    with the Hessian H of the Lagrangian, reduced to the active rows of the branch (Z spans their null space), and the gradients W
    of the estimates in Z.  Switching times move with the estimates, as element lengths are among the variables.  An estimate at an
    active bound has the variance 0.

    Parameters
    ----------
    model : Block
    estimates : component, expression, Switch, or a list or dict (name -> estimate) of these
        as ``outputs`` of ``sensitivity``
    variance : float
        of one measurement; the sum of squares divided by (number of measurements - number of estimates) estimates it
    options : options of ``mpec_hybrid``
        tolerances

    Returns
    -------
    pandas.DataFrame

    Raises
    ------
    FesdError
        as ``sensitivity``; and without an objective, or where it has no minimum to second order

    Source: Bard, Nonlinear Parameter Estimation (1974), section 7; Pirnay, Lopez-Negrete, Biegler, Math. Prog. Comp. 4 (2012) 307.
    """
    outputs = read_outputs(model, estimates)
    ready, certificate = certified_model(model, options, 'covariance')
    if not ready.compiled.has_objective:
        raise FesdError(model, "covariance: the model has no objective", "minimise the sum of squared residuals")
    if not certificate.certified:
        cause = f"its values are no certified solution: {certificate.grade.value}"
        raise FesdError(model, cause, "solve it with mpec_hybrid first")
    by_w, _ = gradients(outputs, ready.compiled, [])
    names = list(outputs)
    found = 2 * variance * ready.compiled.scale.f * BranchSystem(ready, [], user_names(model)).inverse(by_w, names)
    found = (found + found.T) / 2
    spread = np.linalg.eigvalsh(found)
    if spread[0] < -ROUND_OFF * max(abs(spread[-1]), abs(spread[0])):
        raise FesdError(model, "covariance: the solution is no minimum to second order", "solve it from another start")
    return pd.DataFrame(found, index=pd.Index(names, name='estimate'), columns=pd.Index(names, name='estimate'))
