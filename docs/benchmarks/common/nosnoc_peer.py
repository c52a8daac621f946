"""What every study that runs the PyPI package nosnoc 0.2.0 needs of it."""

from copy import deepcopy

from nosnoc import IrkSchemes, NosnocOpts

SCHEMES = {'RADAU': IrkSchemes.RADAU_IIA, 'GAUSS': IrkSchemes.GAUSS_LEGENDRE, 'LEGENDRE': IrkSchemes.GAUSS_LEGENDRE}


def options(scheme, tolerance=None, **settings):
    """Options of nosnoc: its defaults except for ``settings``.

    Parameters
    ----------
    scheme : str
        'Radau' or 'Gauss' in any spelling of this repository, such as 'LAGRANGE-RADAU'
    tolerance : float or None
        of complementarity; None leaves nosnoc's default of 1e-8.  The homotopy ends at sigma_N, so a smaller tolerance is reached
        only if sigma_N is lowered to it.
    """
    result = NosnocOpts(irk_scheme=SCHEMES[scheme.upper().removeprefix('LAGRANGE-')], **settings)
    # all instances share this dict, and nosnoc writes the tolerance into it
    result.opts_casadi_nlp = deepcopy(NosnocOpts.opts_casadi_nlp)
    if tolerance is not None:
        result.comp_tol = result.sigma_N = tolerance
    return result


def work(results):
    """Number of NLPs of a homotopy and the sum of their iterations."""
    iterations = [n for n in results['nlp_iter'] if n is not None]
    return {'nlps': len(iterations), 'iterations': sum(iterations)}
