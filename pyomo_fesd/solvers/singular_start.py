"""A start at which the equations are dependent: Ipopt's own remedy, tried once and said.

Ipopt perturbs the constraint rows of its linear systems (``perturb_always_cd``) only when the linear solver reports them singular;
MUMPS does not always.

Takes: a function that runs Ipopt with further options, and the compiled problem.
Leaves: the better of two runs, and one warning.
Does not apply: where the user has set the option.
"""

import logging

import casadi as ca
import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import structural_rank
from scipy.sparse.linalg import splu

logger = logging.getLogger('pyomo_fesd')

OPTION = 'perturb_always_cd'
#: Ends of Ipopt that a singular step may cause; relative size of a pivot that is zero.
SINGULAR = (
    'Restoration_Failed',
    'Error_In_Step_Computation',
    'Infeasible_Problem_Detected',
    'Search_Direction_Becomes_Too_Small',
    'Maximum_Iterations_Exceeded',
)
DEPENDENT, TINY = 1e-14, 1e-300


def with_perturbation(run, compiled, options):
    """Return the answer of ``run({})``, or with perturbed constraints where it fails from a singular start and that helps.

    Parameters
    ----------
    run : callable (further options) -> (NlpResult, log)
    compiled : MpccFunctions
    options : dict, those of the user
    """
    answer, log = run({})
    if answer.status not in SINGULAR or OPTION in options or not is_singular(compiled):
        return answer, log
    again, second = run({OPTION: 'yes'})
    logger.warning(
        "casadi_ipopt: %s from a start with dependent equations; once more with %s='yes': %s",
        answer.status.replace('_', ' '),
        OPTION,
        again.status.replace('_', ' '),
    )
    return (again, log + second) if again.status == 'Solve_Succeeded' else (answer, log)


def is_singular(compiled) -> bool:
    """Return whether the equations are dependent at the start, as far as a sparse factorisation of J J' tells."""
    c = compiled
    equations = np.flatnonzero(np.asarray(c.lbg) == np.asarray(c.ubg))
    if not len(equations):
        return False
    jacobian = ca.Function('J', [c.x, c.p], [ca.jacobian(c.g, c.x)])(c.x0, c.parameters)
    free = np.asarray(c.lbx) < np.asarray(c.ubx)
    J = sparse.csr_matrix(jacobian.sparse())[equations][:, free]
    if structural_rank(J) < len(equations) or not np.all(np.isfinite(J.data)):
        return True
    scale = sparse.diags(1 / np.maximum(np.abs(J).max(axis=1).toarray().ravel(), TINY)) @ J
    try:
        pivots = np.abs(splu((scale @ scale.T).tocsc()).U.diagonal())
    except RuntimeError:
        return True
    return pivots.min() < DEPENDENT * pivots.max()
