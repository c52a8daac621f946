"""Refuse Disjunctions that are written out for several times without a time index: they would be passed over.

Takes: Disjunctions over a list of times, or filled one by one.
Leaves: nothing.
Does not apply: to a Disjunction about one time, such as a choice at the first or the last, and to one without time.
"""

from collections.abc import Iterable

from pyomo.core import Block, Constraint
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp.disjunct import DisjunctionData

from pyomo_fesd.core import FesdError, TimeIndex


def refuse_lists_of_times(disjunctions: Iterable[DisjunctionData], times: TimeIndex) -> None:
    """Refuse a Disjunction component without time whose data concern one time each, and all together several.

    Raises
    ------
    FesdError
    """
    covered = {}
    for data in disjunctions:
        if times.time(data) is not None or not data.parent_component().is_indexed():
            continue
        labels = _labels(data, times)
        if len(labels) == 1:
            component = data.parent_component()
            known = covered.setdefault(component.name, set())
            known |= labels
            if len(known) > 1:
                raise FesdError(
                    component,
                    f"a Disjunction for several times ({', '.join(f'{t:g}' for t in sorted(known))}, ...) that is not indexed by "
                    f"'{times.wrt.name}' itself: no mode would hold at other times, and no element boundary find its switches",
                    f"declare Disjunction({times.wrt.local_name}, rule=...), with Disjunction.Skip at times to be left out",
                )


def _labels(disjunction, times):
    """The times of the variables in the disjuncts."""
    rows = (c for d in disjunction.disjuncts for c in d.component_data_objects(Constraint, active=True, descend_into=Block))
    return {times.time(v) for c in rows for v in identify_variables(c.body, include_fixed=True)} - {None}
