"""``ControlStep``: the answer of one step of predictive control, and where it comes from."""

from dataclasses import dataclass, field

from pyomo.contrib.mpc import ScalarData

from pyomo_fesd.core import strip_time

#: Where an answer comes from.
BRANCH, SIMULATED, FULL, DEADLINE, PLAN = ('branch', 'simulated branch', 'full run', 'deadline', 'plan')
#: Of a plan that was prepared for a predicted state.
CORRECTED = 'correction'


@dataclass(frozen=True)
class ControlStep:
    """The answer of one step.

    Attributes
    ----------
    controls : ScalarData
        of the first control stage; ``load_data`` of the plant's interface takes it
    origin : str
        'branch': certified, in the branch of the shifted plan or one that descends from it; 'simulated branch': certified, in the
        branch of a simulation; 'full run': of the homotopy; 'deadline': the best feasible point at the deadline; 'plan': no
        feasible point was found, and the plan of the step before goes on; 'correction': a certified plan for the predicted state,
        corrected to first order
    certified : bool
    reason : str
        the certificate, or why there is none
    objective : float or None
        of the new plan; None with the origin 'plan'
    seconds : float
        of the whole step
    results : list of Results
        of its solves, see ``mpec_hybrid``
    """

    controls: ScalarData
    origin: str
    certified: bool
    reason: str
    objective: float | None
    seconds: float
    results: list = field(repr=False, default_factory=list)

    def row(self) -> dict:
        """Return everything but the results as a row of a table, with the controls by name."""
        kept = {name: getattr(self, name) for name in ('origin', 'certified', 'reason', 'objective', 'seconds')}
        return kept | {strip_time(str(name)): number for name, number in self.controls.get_data().items()}
