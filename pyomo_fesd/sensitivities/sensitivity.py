"""``sensitivity``: exact derivatives of a certified solution."""

import pandas as pd
from pyomo.core import Block

from pyomo_fesd.core import FesdError, interruptible
from pyomo_fesd.mpcc import parameter_data
from pyomo_fesd.sensitivities.branch_system import BranchSystem
from pyomo_fesd.sensitivities.outputs import gradients, read_outputs
from pyomo_fesd.solvers import certified_model, user_names


@interruptible
def sensitivity(model: Block, parameters, outputs, **options) -> pd.DataFrame:
    """Return the exact derivatives of outputs by parameters at the model's present, certified solution.

    In the branch of a solution w (one side of each pair zero, decisions of step equilibration in force) the first-order conditions
    are equations F(w, lam; p) = 0: the gradient of the Lagrangian and the active rows c_A.  The implicit function theorem gives

        [H A'; A 0] (dw/dp, dlam/dp) = -(d^2 L/dw dp, dc_A/dp),      do/dp = o_p + o_w' dw/dp

    with the Hessian H of the Lagrangian and A = dc_A/dw.  Element lengths are among w, so derivatives of states contain the jumps
    of sensitivities at switches (saltation matrices), and derivatives of switching times are sums of those of lengths.  The
    forward and the adjoint system are both solved: their residuals prove that the derivative exists and is unique, also where
    rows are redundant.  Nothing of the model is changed.

    Parameters
    ----------
    model : Block
        solved by ``mpec_hybrid``, or simulated
    parameters : component or list
        mutable Params and fixed variables, indexed or not
    outputs : component, expression, Switch, or a list or dict (name -> output) of these
        variables, Expressions, the objective, and the times of ``switches(model)``
    options : options of ``mpec_hybrid``
        tolerances

    Returns
    -------
    pandas.DataFrame
        a row for each output, a column for each parameter, by their names

    Raises
    ------
    FesdError
        with the reason, where the point is not certified, or where the derivative does not exist: an inequality or a bi-active pair
        without a positive multiplier that does not stay as it is (strict complementarity), active rows that contradict each other
        to first order (LICQ), or an output that they do not determine (a grazing contact, free element lengths)

    Source: Fiacco, Introduction to Sensitivity and Stability Analysis in Nonlinear Programming (1983), chapter 3; Leine, Nijmeijer,
    Dynamics and Bifurcations of Non-Smooth Mechanical Systems (2004), section 7 (saltation matrix).
    """
    components = parameters if isinstance(parameters, (list, tuple)) else [parameters]
    data, outputs = parameter_data(components), read_outputs(model, outputs)
    ready, certificate = certified_model(model, options, 'sensitivity', components)
    if not certificate.certified:
        cause = f"its values are no certified solution: {certificate.grade.value}"
        raise FesdError(model, cause, "solve it with mpec_hybrid first")
    by_w, by_p = gradients(outputs, ready.compiled, data)
    found = by_p + BranchSystem(ready, data, user_names(model)).derivatives(by_w, list(outputs))
    index, columns = pd.Index(list(outputs), name='output'), pd.Index([p.name for p in data], name='parameter')
    return pd.DataFrame(found, index=index, columns=columns)
