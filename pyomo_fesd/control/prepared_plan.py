"""``PreparedPlan``: a plan solved for a predicted state, corrected to first order when the measurement arrives (advanced step).

Takes: a compiled control problem whose present values are certified, and the modes with hysteresis at its first time.
Leaves: the corrected plan as values of the model, its controls within their bounds.
Does not apply: where the measured state lies in another branch, or has another mode with hysteresis; the plan is solved again then.
"""

from collections.abc import Iterable

from pyomo.common.collections import ComponentSet
from pyomo.core import Var

from pyomo_fesd.core import FesdError
from pyomo_fesd.mpcc import Contradiction
from pyomo_fesd.sensitivities import LinearSolution
from pyomo_fesd.solvers import user_names


class PreparedPlan:
    """The present plan of a control problem as a linear function of its parameters.

    Parameters
    ----------
    instance : PersistentModel
        compiled with all ``parameters``
    parameters : list of VarData and ParamData
    controls : list of Var
        cut to their bounds
    modes : list of VarData
        among the parameters, multipliers of modes with hysteresis at the first time: no correction leads to another mode

    Raises
    ------
    FesdError
        where the plan has no multipliers
    """

    def __init__(self, instance, parameters: list, controls: Iterable[Var], modes: list):
        self._instance, self._modes, self._values = instance, modes, [v.value for v in modes]
        instance.refresh()
        clipped = ComponentSet(v for u in controls for v in u.values())
        self._linear = LinearSolution(instance, parameters, user_names(instance.model), clipped)

    def correct(self) -> tuple[float, float]:
        """Load the plan for the present parameters; returns its objective and the largest residual of its equations.

        Raises
        ------
        FesdError
            where the branch would change; the model is left as it was
        """
        for v, number in zip(self._modes, self._values):
            if v.value != number:
                raise FesdError(v, "another mode with hysteresis is measured than was predicted", "solve for it")
        try:
            self._instance.refresh()
        except Contradiction as error:
            raise FesdError(self._instance.model, str(error), "give bounds that do not cross") from None
        w = self._linear.present()
        compiled = self._instance.compiled
        for v, number in zip(compiled.variables, compiled.values(w)):
            v.set_value(float(number), skip_validation=True)
        return self._linear.objective(w), self._linear.residual(w)
