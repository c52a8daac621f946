"""``LinearSolution``: a certified solution for other values of its parameters, to first order and within its branch.

    w(p) = w* + dw/dp (p - p*)

The derivative is that of the branch's first-order conditions (``BranchSystem``), so w(p) misses the solution for p by a term of
second order in p - p*, as long as the solution for p lies in the same branch.  It does not where an active inequality or a side of
a bi-active pair would move, or where another side or inequality would change its sign; then there is no answer.

Takes: a compiled model whose present values are certified.
Leaves: values for new parameters; nothing is factorised again.
Does not apply: to a parameter by which the solution has no derivative.

Source: Zavala, Biegler, Automatica 45 (2009) 86 (advanced-step NMPC).
"""

import numpy as np

from pyomo_fesd.core import FesdError
from pyomo_fesd.sensitivities.active_rows import NEAR
from pyomo_fesd.sensitivities.branch_system import BESIDE, BranchSystem

#: A parameter that differs by less, relative, has not changed: a plant that slides along a surface is measured on it to round-off.
SAME = 1e-6


class LinearSolution:
    """The present solution of a compiled model as a linear function of its parameters.

    Parameters
    ----------
    ready : PersistentModel
        compiled with the parameters, its present values certified
    parameters : list of VarData and ParamData
        in the order of the compiled ones
    name : callable
        the user's name of a component
    clipped : container of VarData
        variables that are cut to their bounds, where others refuse to leave them

    Raises
    ------
    FesdError
        where the solution has no multipliers
    """

    def __init__(self, ready, parameters, name, clipped=()):
        self._c, self._parameters, self._name = ready.compiled, parameters, name
        self._system = BranchSystem(ready, parameters, name)
        self._by_parameters, self._exists = self._system.by_parameters()
        self._near = max(ready.options.biactive_tol, NEAR)
        self._w, self._p, self._at = self._c.x0.copy(), self._c.parameters.copy(), self._c.evaluate(self._c.x0)
        self._clipped = np.array([v in clipped for v in self._c.variables], dtype=bool)

    def present(self) -> np.ndarray:
        """Return the (scaled) variables for the present parameters and bounds of the compiled model.

        Raises
        ------
        FesdError
            naming what would leave the branch, and a parameter by which there is no derivative
        """
        change = self._c.parameters - self._p
        change[np.abs(change) <= SAME * np.maximum(1.0, np.abs(self._p))] = 0.0
        missing = np.flatnonzero(~self._exists & (change != 0))
        if missing.size:
            raise FesdError(self._parameters[missing[0]], "the solution has no derivative by it", BESIDE)
        step = self._by_parameters @ change
        self._system.refuse_moving(step, change)
        w = self._w + step
        self._refuse_other_signs(step, change)
        low, high = self._c.lbx, self._c.ubx
        self._refuse(np.where(self._clipped, 0.0, np.maximum(low - w, w - high)), self._c.variables)
        return np.clip(w, low, high)

    def residual(self, w) -> float:
        """The largest violation of rows at ``w``, of second order in the change of the parameters."""
        at = self._c.evaluate(w)
        rows, _ = self._c.violations(w, at)
        return float(max(rows.max(initial=0.0), np.minimum(at.G, at.H).max(initial=0.0)))

    def objective(self, w) -> float:
        """The model's objective at ``w``."""
        return self._c.objective(self._c.evaluate(w).f)

    def _refuse_other_signs(self, step, change):
        """Refuse inequalities and sides that would change their signs, to first order."""
        c, at = self._c, self._at
        g, G, H = (values + moved for values, moved in zip((at.g, at.G, at.H), self._system.moved(step, change)))
        inequality = c.lbg < c.ubg
        self._refuse(np.where(inequality, np.maximum(c.lbg - g, g - c.ubg), 0.0), c.constraints)
        self._refuse(np.maximum(-G, -H), [condition.source for condition in c.conditions])

    def _refuse(self, misses, components):
        worst = int(np.argmax(misses)) if misses.size else 0
        if misses.size and misses[worst] > self._near:
            raise FesdError(
                self._name(components[worst]), f"it would leave the branch, by {misses[worst]:.2g}", "solve for the new values"
            )
