"""Space comes first: a second ContinuousSet that still waits for its points would bring equations whose elements cannot move.

Takes: a model and its ContinuousSet of time.
Leaves: nothing.
Does not apply: to a ContinuousSet without derivatives, which is a set like any other.
"""

from pyomo.core import Block
from pyomo.dae import DerivativeVar

from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import discretised, is_indexed_by


def refuse_waiting_space(model, wrt):
    """Refuse derivatives over time and space where space is not discretised.

    pyomo.dae would later add discretisation equations over time at new points in space, in which no element length stands, and
    nothing would be summed up there.

    Raises
    ------
    FesdError
    """
    for derivative in model.component_objects(DerivativeVar, descend_into=Block):
        waiting = [s for s in derivative.get_continuousset_list() if s is not wrt and not discretised(s)]
        if waiting and is_indexed_by(derivative, wrt):
            raise FesdError(
                waiting[0],
                f"it is not discretised yet, and '{derivative.name}' is over '{wrt.local_name}' as well",
                f"discretise it first, then apply fesd.finite_elements with wrt={wrt.local_name}",
            )
