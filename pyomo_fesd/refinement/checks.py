"""Arguments and models that ``refine`` refuses."""

from collections.abc import Iterator
from math import inf
from numbers import Integral, Real

from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.core import Block, Objective, TransformationFactory
from pyomo.core.base.var import VarData
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import FesdError, check_keywords, discretised
from pyomo_fesd.simulation import states_fixed_later


def objectives(model: Block) -> Iterator:
    """Return the active objectives."""
    return model.component_data_objects(Objective, active=True, descend_into=Block)


def read_quantities(quantities) -> list[tuple]:
    """Return ``(component, index)`` of all data named; the data themselves may be replaced when a round is undone."""
    named = quantities if isinstance(quantities, (list, tuple)) else [] if quantities is None else [quantities]
    found = []
    for q in named:
        if not hasattr(q, 'is_indexed'):
            raise FesdError(q, f"refine: quantities: this is a {type(q).__name__}, not a component", "give e.g. m.x[2] or m.cost")
        found += [(d.parent_component(), d.index()) for d in (q.values() if q.is_indexed() else [q])]
    return found


def read_options(given: dict) -> tuple[dict, dict]:
    """Return the keywords of ``fesd.finite_elements`` among ``given``, and the options of ``mpec_hybrid``."""
    grids, solver = TransformationFactory('fesd.finite_elements').CONFIG, SolverFactory('mpec_hybrid').CONFIG
    keywords = {name: value for name, value in given.items() if name in grids}
    options = {'time_limit' if name == 'timelimit' else name: value for name, value in given.items() if name not in grids}
    check_keywords(grids, keywords, 'refine')
    check_keywords(solver, options, 'refine')
    return _converted(grids, keywords), _converted(solver, options)


def _converted(declared, given):
    read = declared(given)
    return {name: read.get(name).value() for name in given}


def read_nfe(nfe):
    """Return the number of elements of the first round, or a list of numbers."""
    grids = TransformationFactory('fesd.finite_elements').CONFIG
    check_keywords(grids, {'nfe': nfe}, 'refine')
    return grids({'nfe': nfe}).nfe


def check(model: Block, wrt: ContinuousSet, tolerance: float, max_rounds: int, tee: bool) -> None:
    """Refuse numbers out of range, models that are discretised, and degrees of freedom without an objective."""
    check_keywords(SolverFactory('mpec_hybrid').CONFIG, {'tee': tee}, 'refine')
    if isinstance(tolerance, bool) or not isinstance(tolerance, Real) or not 0 < tolerance < inf:
        raise FesdError('tolerance', f"refine: it is {tolerance!r}", "give a positive number, e.g. 1e-6")
    if not isinstance(max_rounds, Integral) or max_rounds < 2:
        raise FesdError('max_rounds', f"refine: it is {max_rounds!r}", "an error is estimated by comparison: give 2 at least")
    if discretised(wrt):
        raise FesdError(wrt, "refine: it is discretised already", "leave fesd.finite_elements to refine")
    if not any(True for _ in objectives(model)):
        for v in states_fixed_later(model, wrt):
            raise degree_of_freedom(v, "fixed after the first time")


def degree_of_freedom(v: VarData, how: str = "free") -> FesdError:
    """Return the error of a model with degrees of freedom but without an objective, which a simulation cannot solve."""
    return FesdError(
        v,
        f"refine: it is {how}, and there is no objective",
        "fix inputs, at the end of each stage if they are in piecewise_constant; with degrees of freedom, give an objective (0 is "
        "one)",
    )
