"""One scenario: build, solve, read; whatever happens becomes a row."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.contrib.solver.common.results import SolutionStatus
from pyomo.core import value

from pyomo_fesd.core import FesdError

#: Columns of a row besides the scenario's own and the outputs.
COLUMNS = ('outcome', 'certified', 'objective', 'seconds', 'reason', 'warnings')
FAILED = 'failed'
#: A solution counts as one with these.
SOLUTIONS = (SolutionStatus.optimal, SolutionStatus.feasible)


@dataclass(frozen=True)
class Scenario:
    """Runs scenarios; can be pickled if its functions can.

    Attributes
    ----------
    build : callable (**values) -> model, ready for the solver
    outputs : dict name -> name of a component, or callable (model) -> number
    solve : callable (model), or None for ``mpec_hybrid``
    options : dict, of ``mpec_hybrid``
    """

    build: Callable
    outputs: Mapping
    solve: Callable | None = None
    options: dict = field(default_factory=dict)

    def __call__(self, values: dict) -> dict:
        """Return the row of the scenario with ``values``: ``COLUMNS`` and outputs; None where there is no number."""
        started = time.perf_counter()
        row = dict.fromkeys([*COLUMNS, *self.outputs])
        row['certified'] = False
        try:
            model = self.build(**values)
            if self._solved(model, row):
                row |= {name: self._read(model, name, output) for name, output in self.outputs.items()}
        except Exception as error:  # a scenario that fails, however, is a row with its reason
            row |= {'outcome': FAILED, 'reason': ' '.join(f'{type(error).__name__}: {error}'.split())}
        row['seconds'] = time.perf_counter() - started
        return row

    def _solved(self, model, row):
        """Solve; returns whether the model has a solution."""
        if self.solve is not None:
            self.solve(model)
            row |= {'outcome': 'solved', 'reason': '', 'warnings': ''}
            return True
        results = SolverFactory('mpec_hybrid').solve(
            model, load_solutions=True, raise_exception_on_nonoptimal_result=False, **self.options
        )
        info = results.extra_info
        row |= {'outcome': results.solution_status.name, 'reason': info.reason, 'objective': results.incumbent_objective}
        row['certified'] = results.solution_status is SolutionStatus.optimal
        # the log of another process is easily lost
        row['warnings'] = '; '.join(' '.join(message.split()) for message in info.warnings)
        return results.solution_status in SOLUTIONS

    @staticmethod
    def _read(model, name, output):
        if callable(output):
            found = output(model)
            return None if found is None else float(found)
        component = model.find_component(output)
        if component is None:
            raise FesdError(model, f"sweep: it has no component '{output}' for the output '{name}'", "give the name of a component")
        return float(value(component))
