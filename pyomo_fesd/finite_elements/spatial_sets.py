"""Refuse a second ContinuousSet that is not discretised yet: it would add equations over time whose elements cannot move.

Takes: a model and its ContinuousSet of time.
Leaves: nothing.
Does not apply: to a ContinuousSet without derivatives, which is a set like any other.
"""

from pyomo.core import Block
from pyomo.dae import ContinuousSet, DerivativeVar

from pyomo_fesd.core import FesdError, discretised, is_indexed_by


def refuse_waiting_space(model: Block, wrt: ContinuousSet) -> None:
    """Refuse derivatives over time and space where space is not discretised.

    pyomo.dae would later add discretisation equations over time at new points in space, without element lengths and without
    aggregated pairs.

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
