"""The size of a model: what is in it, and what was left out."""

import pandas as pd
from pyomo.core import Block, Constraint
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd import marks


class Report(dict):
    """Counts by name; prints as a table."""

    def __repr__(self):
        return pd.Series(self).to_string()

    __str__ = __repr__


def report(model):
    """Count what the solver will see.

    Returns
    -------
    Report
        a dict: ``variables`` and ``constraints`` (active, as the solver counts them; multipliers among them in
        ``multipliers``), ``pairs`` (complementarity pairs in the homotopy), ``decided`` (pairs that only the branch decides,
        eq. 13), ``binaries at most`` (one a pair; the LPEC uses one for each bi-active pair), ``sources`` (complementarity
        conditions over time that the pairs stand for), ``disjunctions`` (transformed) and ``modes left out`` (switched-off
        disjuncts, which leave no multiplier)
    """
    variables, constraints = {}, 0
    for con in model.component_data_objects(Constraint, active=True, descend_into=Block):
        constraints += 1
        variables.update((id(v), v) for v in identify_variables(con.body, include_fixed=False))
    conditions = list(model.component_data_objects(Complementarity, active=True, descend_into=Block))
    for condition in conditions:
        for side in condition._args:
            variables.update((id(v), v) for v in identify_variables(side, include_fixed=False))
    decided = sum(1 for pair, _ in marks.marked(model, marks.DECIDED) if pair.active)
    sleeping = [
        c for c in model.component_data_objects(Complementarity, descend_into=Block) if not c.active and c.parent_component()
    ]
    disjunctions = [d for d in model.component_data_objects(Disjunction, descend_into=Block) if not d.active]
    left_out = sum(
        1 for d in disjunctions for mode in d.disjuncts if mode.transformation_block is None and not mode.active
    )
    return Report(
        {
            'variables': len(variables),
            'multipliers': sum(1 for v in variables.values() if marks.is_generated(v)),
            'constraints': constraints,
            'pairs': len(conditions) - decided,
            'decided': decided,
            'binaries at most': len(conditions) - decided,
            'sources': len(sleeping),
            'disjunctions': len(disjunctions),
            'modes left out': left_out,
        }
    )
