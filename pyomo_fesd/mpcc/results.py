"""Pyomo's results of a run: conditions, objective, a loader for values and multipliers, and what only this solver reports."""

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.contrib.solver.common.results import SolutionStatus, TerminationCondition
from pyomo.contrib.solver.common.solution_loader import SolutionLoader
from pyomo.contrib.solver.common.util import NoDualsError, NoReducedCostsError, NoSolutionError

from pyomo_fesd.indicators import set_indicators
from pyomo_fesd.mpcc.run import Outcome

#: What each outcome is in Pyomo's words.
CONDITIONS = {
    Outcome.CERTIFIED: (TerminationCondition.convergenceCriteriaSatisfied, SolutionStatus.optimal),
    Outcome.SOLVED: (TerminationCondition.convergenceCriteriaSatisfied, SolutionStatus.optimal),
    Outcome.FEASIBLE: (TerminationCondition.unknown, SolutionStatus.feasible),
    Outcome.RELAXED: (TerminationCondition.unknown, SolutionStatus.unknown),
    Outcome.INFEASIBLE: (TerminationCondition.locallyInfeasible, SolutionStatus.infeasible),
    Outcome.UNBOUNDED: (TerminationCondition.unbounded, SolutionStatus.unknown),
    Outcome.TIME_LIMIT: (TerminationCondition.maxTimeLimit, SolutionStatus.unknown),
    Outcome.ITERATION_LIMIT: (TerminationCondition.iterationLimit, SolutionStatus.unknown),
    Outcome.INTERRUPTED: (TerminationCondition.interrupted, SolutionStatus.unknown),
    Outcome.STOPPED: (TerminationCondition.interrupted, SolutionStatus.unknown),
}
#: Measures of a certificate, None without one.
MEASURES = ('violation', 'complementarity', 'violation_scaled', 'complementarity_scaled')
#: Violated pairs and rows that a report names.
NAMED = 5


def fill(results, model, run, compiled=None, reason=''):
    """Fill Pyomo's ``results`` from a ``Run``.

    Parameters
    ----------
    compiled : Compiled, optional
        None where nothing could be compiled
    reason : str
        why, in that case
    """
    condition, status = CONDITIONS[run.outcome]
    if status is SolutionStatus.unknown:
        # stopped by a limit: what the best point is decides
        status = _status_of(run)
    results.termination_condition, results.solution_status = condition, status
    results.solution_loader = Loader(model, compiled, run.w, None if run.point is None else run.point.nlp)
    if run.point is not None and compiled.has_objective:
        results.incumbent_objective = compiled.objective(run.point.f)
    info = results.extra_info
    info.outcome, info.steps, info.starts, info.eps_last = run.outcome.value, run.steps, run.starts, run.eps
    info.nlps, info.nlp_iterations = run.counts.nlps, run.counts.iterations
    info.lpecs, info.binaries = run.counts.lpecs, run.counts.binaries
    info.pairs = None if compiled is None else len(compiled.conditions)
    info.missing_values = None if compiled is None else compiled.missing
    _fill_certificate(info, None if run.point is None else run.point.certificate)
    lost = run.outcome is Outcome.INFEASIBLE and run.w is not None
    info.violated = _violated(compiled, run.w) if lost else []
    if info.violated:
        reason = 'largest violations: ' + ', '.join(f'{name} ({amount:.1e})' for name, amount in info.violated)
    info.reason = reason or info.reason


def _fill_certificate(info, certificate):
    info.stationarity = 'B' if certificate is not None and certificate.certified else 'not certified'
    info.reason = '' if certificate is None else certificate.grade.value
    info.biactive_pairs = None if certificate is None else certificate.biactive
    for name in MEASURES:
        setattr(info, name, None if certificate is None else getattr(certificate, name))


def _status_of(run):
    if run.w is None:
        return SolutionStatus.noSolution
    if run.point is None:
        return SolutionStatus.unknown
    return SolutionStatus.feasible if run.point.certificate.feasible else SolutionStatus.infeasible


def _violated(c, w):
    """The most violated rows and pairs at ``w``, by name."""
    at = c.evaluate(w)
    rows, _ = c.violations(w, at)
    named = [(con.name, float(v)) for con, v in zip(c.constraints, rows)]
    named += [(cond.name, float(v)) for cond, v in zip(c.conditions, np.abs(np.minimum(at.G, at.H)))]
    named = sorted(named, key=lambda item: -item[1])[:NAMED]
    return [(name, amount) for name, amount in named if amount > 0]


class Loader(SolutionLoader):
    """Values of the point found and the multipliers of its branch NLP.

    Loading also sets the indicator variables of the disjuncts that ``fesd.dcs`` transformed.
    """

    def __init__(self, model, compiled, w, nlp):
        self._pyomo_model, self._c, self._w = model, compiled, None if w is None else compiled.values(w)
        self._nlp = nlp

    def get_number_of_solutions(self):
        """1, or 0 if no point was reached."""
        return int(self._w is not None)

    def get_vars(self, vars_to_load=None):
        """Values by variable."""
        if self._w is None:
            raise NoSolutionError()
        return _select(ComponentMap, self._c.variables, self._w, vars_to_load)

    def get_duals(self, cons_to_load=None):
        """Multipliers of the constraints in the branch NLP, in Pyomo's sign; the pairs are fixed there."""
        if self._nlp is None:
            raise NoDualsError()
        c = self._c
        lam = -c.sign * self._nlp.lam_g[: len(c.constraints)] * c.scale.g / c.scale.f
        return _select(dict, c.constraints, lam, cons_to_load)

    def get_reduced_costs(self, vars_to_load=None):
        """Multipliers of the bounds in the branch NLP, in Pyomo's sign."""
        if self._nlp is None:
            raise NoReducedCostsError()
        c = self._c
        # a relaxation may have a slack behind the variables
        lam = -c.sign * self._nlp.lam_x[: len(c.variables)] * c.scale.x / c.scale.f
        return _select(ComponentMap, c.variables, lam, vars_to_load)

    def load_import_suffixes(self):
        """Multipliers into import suffixes, which stay empty where there are none."""
        try:
            super().load_import_suffixes()
        except (NoDualsError, NoReducedCostsError):
            pass

    def load_vars(self, vars_to_load=None):
        super().load_vars(vars_to_load)
        set_indicators(self._pyomo_model)


def _select(kind, components, numbers, wanted):
    """``kind`` from components to numbers, for all or the wanted ones; a range in two rows has the sum of its multipliers."""
    found = kind()
    for component, number in zip(components, map(float, numbers)):
        found[component] = found.get(component, 0.0) + number
    return found if wanted is None else kind((c, found[c]) for c in wanted)
