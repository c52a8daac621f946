"""Pyomo's results of a run: conditions, objective, a loader for values and multipliers, and the results of this solver only."""

from functools import partial
from operator import attrgetter

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.contrib.solver.common.results import SolutionStatus, TerminationCondition
from pyomo.contrib.solver.common.solution_loader import SolutionLoader
from pyomo.contrib.solver.common.util import NoDualsError, NoReducedCostsError, NoSolutionError
from pyomo.core.staleflag import StaleFlagManager

from pyomo_fesd.mpcc.algorithm import Outcome, as_good

#: Each outcome as Pyomo's termination condition and status; for an unknown status the best point decides.
CONDITIONS = {
    Outcome.CERTIFIED: (TerminationCondition.convergenceCriteriaSatisfied, SolutionStatus.optimal),
    Outcome.SOLVED: (TerminationCondition.convergenceCriteriaSatisfied, SolutionStatus.optimal),
    Outcome.FEASIBLE: (TerminationCondition.unknown, SolutionStatus.feasible),
    Outcome.RELAXED: (TerminationCondition.unknown, SolutionStatus.unknown),
    Outcome.INFEASIBLE: (TerminationCondition.locallyInfeasible, SolutionStatus.infeasible),
    Outcome.NO_BRANCH: (TerminationCondition.unknown, SolutionStatus.unknown),
    Outcome.UNBOUNDED: (TerminationCondition.unbounded, SolutionStatus.unknown),
    Outcome.TIME_LIMIT: (TerminationCondition.maxTimeLimit, SolutionStatus.unknown),
    Outcome.ITERATION_LIMIT: (TerminationCondition.iterationLimit, SolutionStatus.unknown),
    Outcome.INTERRUPTED: (TerminationCondition.interrupted, SolutionStatus.unknown),
    Outcome.STOPPED: (TerminationCondition.interrupted, SolutionStatus.unknown),
}
#: Outcomes whose least infeasible point shows what is wrong, unless there is a feasible one.
WITHOUT_POINT = (Outcome.NO_BRANCH, Outcome.INFEASIBLE, Outcome.TIME_LIMIT, Outcome.ITERATION_LIMIT)
#: Measures of a certificate, None without one.
MEASURES = ('violation', 'complementarity', 'violation_scaled', 'complementarity_scaled')
#: Number of violated pairs and rows that a report names.
NAMED = 5


def fill_results(results, model, run, loaded, compiled=None, reason='', names=lambda *_: attrgetter('name')):
    """Fill Pyomo's ``results`` from a ``Run``.

    Parameters
    ----------
    loaded : callable Block -> None
        called with ``model`` after values were loaded into it
    compiled : MpccFunctions, optional
        None if the model could not be compiled
    reason : str
        the cause, in that case
    names : callable (model, variables, values) -> callable component -> str
        names of rows and pairs at a point
    """
    condition, status = CONDITIONS[run.outcome]
    results.termination_condition = condition
    results.solution_status = _status_of(run) if status is SolutionStatus.unknown else status
    nlp, certificate = (None, None) if run.point is None else (run.point.nlp, run.point.certificate)
    results.solution_loader = Loader(model, compiled, run.w, nlp, loaded)
    info = results.extra_info
    info.outcome, info.steps, info.starts, info.eps_last = run.outcome.value, run.steps, run.starts, run.eps
    info.nlps, info.nlp_iterations = run.counts.nlps, run.counts.iterations
    info.lpecs, info.binaries = run.counts.lpecs, run.counts.binaries
    info.pairs = info.missing_values = None
    if compiled is not None:
        info.pairs, info.missing_values = len(compiled.conditions), compiled.missing
        if run.point is not None and compiled.has_objective:
            results.incumbent_objective = compiled.objective(compiled.evaluate(run.point.w).f)
    _fill_certificate(info, certificate)
    info.lower_objective = None if compiled is None else _lower_objective(compiled, run)
    if info.lower_objective is not None:
        info.reason += f"; a feasible point with objective {info.lower_objective:.7g} was found too, but is not certified"
    info.violated = _violated(compiled, run, partial(names, model))
    if info.violated:
        reason = 'largest violations: ' + ', '.join(f'{name} ({amount:.1e})' for name, amount in info.violated)
    info.reason = reason or info.reason


def _fill_certificate(info, certificate):
    info.stationarity = 'B' if certificate is not None and certificate.certified else 'not certified'
    info.reason = '' if certificate is None else certificate.grade.value
    info.biactive_pairs = getattr(certificate, 'biactive', None)
    for name in MEASURES:
        setattr(info, name, getattr(certificate, name, None))


def _lower_objective(compiled, run):
    """The objective of the lowest feasible point where a certified one that is not ``as_good`` is the result, else None."""
    point, lowest = run.point, run.lowest
    if point is None or lowest is None or not point.certificate.certified or point.f <= as_good(lowest, None):
        return None
    return compiled.objective(compiled.evaluate(lowest.w).f)


def _status_of(run):
    if run.w is None:
        return SolutionStatus.noSolution
    if run.point is None:
        return SolutionStatus.unknown
    return SolutionStatus.feasible if run.point.certificate.feasible else SolutionStatus.infeasible


def _violated(c, run, names):
    """The most violated rows and pairs of a run that found no feasible point, by name."""
    if run.outcome not in WITHOUT_POINT or run.point is not None or run.w is None:
        return []
    at = c.evaluate(run.w)
    rows, _ = c.violations(run.w, at)
    amounts = [*rows, *np.abs(np.minimum(at.G, at.H))]
    components = [*c.constraints, *(condition.source for condition in c.conditions)]
    largest = sorted(zip(components, map(float, amounts)), key=lambda item: -item[1])
    name, found = names(c.variables, c.values(run.w)), {}
    for component, amount in largest:
        # pairs of one source may share a name
        if amount > 0 and len(found) < NAMED:
            found.setdefault(name(component), amount)
    return list(found.items())


class Loader(SolutionLoader):
    """Values of a point and the multipliers of its NLP.

    Parameters
    ----------
    model : Block
    compiled : MpccFunctions or None
    w : array or None
    nlp : NlpResult or None
    loaded : callable Block -> None, optional
        called with ``model`` after values were loaded into it
    """

    def __init__(self, model, compiled, w, nlp, loaded=lambda model: None):
        self._pyomo_model, self._c, self._w = model, compiled, None if w is None else compiled.values(w)
        self._nlp, self._loaded = nlp, loaded

    def get_number_of_solutions(self):
        """1, or 0 if no point was reached."""
        return int(self._w is not None)

    def get_vars(self, vars_to_load=None):
        """Values by variable."""
        if self._w is None:
            raise NoSolutionError()
        return _select(ComponentMap, self._c.variables, self._w, vars_to_load)

    def get_duals(self, cons_to_load=None):
        """Multipliers of the constraints in the NLP, in Pyomo's sign; a branch NLP has fixed the pairs."""
        if self._nlp is None:
            raise NoDualsError()
        return _select(dict, self._c.constraints, self._in_model_units(self._nlp.lam_g, self._c.scale.g), cons_to_load)

    def get_reduced_costs(self, vars_to_load=None):
        """Multipliers of the bounds in the NLP, in Pyomo's sign."""
        if self._nlp is None:
            raise NoReducedCostsError()
        return _select(ComponentMap, self._c.variables, self._in_model_units(self._nlp.lam_x, self._c.scale.x), vars_to_load)

    def _in_model_units(self, multipliers, scale):
        # the NLP may have more rows than the model, and slacks
        return -self._c.sign * multipliers[: len(scale)] * scale / self._c.scale.f

    def load_import_suffixes(self):
        """Load multipliers into import suffixes, which stay empty without any."""
        try:
            super().load_import_suffixes()
        except (NoDualsError, NoReducedCostsError):
            pass

    def load_vars(self, vars_to_load=None):
        if vars_to_load is None and self._w is not None:
            for v, number in zip(self._c.variables, self._w.tolist()):
                v.set_value(number, skip_validation=True)
            StaleFlagManager.mark_all_as_stale(delayed=True)
        else:
            super().load_vars(vars_to_load)
        self._loaded(self._pyomo_model)


def _select(kind, components, numbers, selected):
    """``kind`` from components to numbers, for all or the selected; a range in two rows has the sum of its multipliers."""
    found = kind()
    for component, number in zip(components, map(float, numbers)):
        found[component] = found.get(component, 0.0) + number
    return found if selected is None else kind((c, found[c]) for c in selected)
