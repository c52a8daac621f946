"""The size of a model: what is in it, and what was left out."""

from collections import Counter

import pandas as pd
from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint, Objective
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd import marks
from pyomo_fesd.complementarity import Mixed, read
from pyomo_fesd.elements.mixed import replacement


class Report(dict):
    """Counts by name; prints as a table."""

    def __repr__(self):
        return pd.Series(self).to_string()

    __str__ = __repr__


def report(model, blocks=False):
    """Count what the solver will see.

    Parameters
    ----------
    blocks : bool
        also count each block that stands on ``model``, e.g. the units of a flowsheet

    Returns
    -------
    pandas.DataFrame
        with ``blocks``: a row for each of them and the last for all; a variable that stands in equations of two blocks counts in
        both
    Report
        a dict: ``variables`` and ``constraints`` (active, as the solver counts them; multipliers among them in
        ``multipliers``), ``pairs`` (complementarity pairs in the homotopy), ``decided`` (pairs that only the branch decides,
        eq. 13), ``binaries at most`` (one a pair; the LPEC uses one for each bi-active pair), ``sources`` (complementarity
        conditions over time that the pairs stand for; one between two bounds counts twice), ``disjunctions`` (transformed) and
        ``modes left out`` (switched-off disjuncts, which leave no multiplier)
    """
    if blocks:
        children = [b for b in model.component_objects(Block, descend_into=False) if b.active]
        rows = {b.local_name: _sum(report(data) for data in b.values() if data.active) for b in children}
        rows = {name: row for name, row in rows.items() if any(row.values())}
        return pd.DataFrame.from_dict(rows | {'all': report(model)}, orient='index')
    constraints = list(model.component_data_objects(Constraint, active=True, descend_into=Block))
    conditions = list(model.component_data_objects(Complementarity, active=True, descend_into=Block))
    deciding = ComponentMap(marks.marked(model, marks.DECIDED))
    decided = sum(1 for c in conditions if c in deciding)
    mixed = sum(1 for c in conditions if isinstance(read(c), Mixed))
    objectives = model.component_data_objects(Objective, active=True, descend_into=Block)
    expressions = [c.body for c in constraints] + [o.expr for o in objectives] + [s for c in conditions for s in c._args]
    variables = ComponentSet(v for e in expressions for v in identify_variables(e, include_fixed=False))
    own = (c for c in model.component_data_objects(Complementarity, descend_into=Block) if not c.active and c not in deciding)
    disjunctions = [d for d in model.component_data_objects(Disjunction, descend_into=(Block, Disjunct)) if _transformed(d)]
    return Report(
        {
            # a condition between two bounds becomes two pairs, with the two parts of its function
            'variables': len(variables) + 2 * mixed,
            'multipliers': sum(1 for v in variables if marks.is_generated(v)),
            'constraints': len(constraints) + mixed,
            'pairs': len(conditions) - decided + mixed,
            'decided': decided,
            'binaries at most': len(conditions) - decided + mixed,
            'sources': sum(
                1 for c in own if getattr(c, '_args', None) is not None and not _is_equilibration(c) and not _is_split(c)
            ),
            'disjunctions': len(disjunctions),
            'modes left out': sum(1 for d in disjunctions for mode in d.disjuncts if mode.transformation_block is None),
        }
    )


def _sum(reports):
    """Counts of all data of an indexed block; what two of them share counts in both."""
    total = Counter()
    for counts in reports:
        total.update(counts)
    return dict(total)


def _transformed(disjunction):
    """Whether ``fesd.dcs`` has taken the place of a Disjunction."""
    return not disjunction.active and any(mode.transformation_block is not None for mode in disjunction.disjuncts)


def _is_split(condition):
    """Whether pairs have taken the place of a condition with two bounds on one side."""
    return not marks.is_generated(condition) and replacement(condition) is not None


def _is_equilibration(condition):
    """Whether an inactive condition is one of step equilibration that another option switched off."""
    return condition.parent_component().local_name == 'equilibration' and marks.is_generated(condition)
