"""Count the variables, constraints and pairs that a solver will see, and the switching that was left out.

Takes: a model, before or after the transformations.
Leaves: the model as it is.
"""

from __future__ import annotations

from pyomo.common.collections import ComponentSet
from pyomo.common.dependencies import pandas as pd
from pyomo.core import Block, Constraint, Objective
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity

from pyomo_fesd.core import Mixed, all_hints, is_generated, moving_grids, read_complementarity, refuse_no_model


class Report(dict):
    """Counts by name; prints as a table."""

    def __repr__(self):
        return pd.Series(self).to_string()

    __str__ = __repr__


def report(model, blocks: bool = False) -> Report | pd.DataFrame:
    """Count the components that the solver will see.

    Parameters
    ----------
    blocks : bool
        also count each child block of ``model``, e.g. the units of a flowsheet

    Returns
    -------
    pandas.DataFrame
        with ``blocks``: a row for each of them and the last for all; a variable in equations of two blocks counts in both
    Report
        a dict: ``variables`` and ``constraints`` (active, as the solver counts them; multipliers among them in
        ``multipliers``), ``pairs`` (complementarity pairs in the homotopy), ``decided`` (pairs that only the branch decides,
        eq. 13), ``binaries at most`` (one a pair; the LPEC uses one for each bi-active pair), ``sources`` (complementarity
        conditions over time that the pairs are made from; one between two bounds counts twice), ``disjunctions`` (transformed)
        and ``modes left out`` (switched-off disjuncts, which leave no multiplier)
    """
    refuse_no_model(model, 'report')
    return _by_block(model) if blocks else Report(_seen_by_solver(model) | _transformed_parts(model))


def _by_block(model):
    children = [b for b in model.component_objects(Block, descend_into=False) if b.active]
    counts = {b.local_name: pd.DataFrame([report(data) for data in b.values() if data.active]).sum() for b in children}
    rows = {name: row for name, row in counts.items() if row.any()}
    return pd.DataFrame.from_dict(rows | {'all': report(model)}, orient='index')


def _seen_by_solver(model):
    """Counts of active components; a condition between two bounds becomes two pairs, with the two parts of its function."""
    constraints, objectives, conditions = (
        list(model.component_data_objects(ctype, active=True, descend_into=Block))
        for ctype in (Constraint, Objective, Complementarity)
    )
    expressions = [c.body for c in constraints] + [o.expr for o in objectives] + [s for c in conditions for s in c._args]
    variables = ComponentSet(v for e in expressions for v in identify_variables(e, include_fixed=False))
    deciding = _deciding(model)
    decided = sum(c in deciding for c in conditions)
    mixed = sum(isinstance(read_complementarity(c), Mixed) for c in conditions)
    pairs = len(conditions) - decided + mixed
    return {
        'variables': len(variables) + 2 * mixed,
        'multipliers': sum(map(is_generated, variables)),
        'constraints': len(constraints) + mixed,
        'pairs': pairs,
        'decided': decided,
        'binaries at most': pairs,
    }


def _transformed_parts(model):
    """Counts of the conditions, Disjunctions and modes that the transformations replaced."""
    deciding = _deciding(model)
    conditions = model.component_data_objects(Complementarity, descend_into=Block)
    disjunctions = [d for d in model.component_data_objects(Disjunction, descend_into=(Block, Disjunct)) if _is_transformed(d)]
    return {
        'sources': sum(not c.active and c not in deciding and _is_summed_up(c) for c in conditions),
        'disjunctions': len(disjunctions),
        'modes left out': sum(mode.transformation_block is None for d in disjunctions for mode in d.disjuncts),
    }


def _deciding(model):
    """The conditions that only the branch decides."""
    return ComponentSet(hint.pair for hint in all_hints(model).branch_constraints)


def _is_transformed(disjunction):
    """Whether ``fesd.dcs`` has replaced a Disjunction."""
    return not disjunction.active and any(mode.transformation_block is not None for mode in disjunction.disjuncts)


def _is_summed_up(condition):
    """Whether an inactive condition counts by pairs that are made from it."""
    return getattr(condition, '_args', None) is not None and not (_is_equilibration(condition) or _is_split(condition))


def _is_split(condition):
    """Whether pairs have taken the place of a condition with two bounds on one side."""
    return any(condition in moving.splits for moving in moving_grids(condition).values())


def _is_equilibration(condition):
    """Whether an inactive condition is one of step equilibration that another option switched off."""
    return any(condition.parent_component() is moving.equilibration for moving in moving_grids(condition).values())
