"""``sweep``: many scenarios of one model."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed

import pandas as pd

from pyomo_fesd.core import FesdError, check_keywords
from pyomo_fesd.scenarios.progress_bar import progress_bar
from pyomo_fesd.scenarios.results_file import ResultsFile
from pyomo_fesd.scenarios.scenario import COLUMNS, Scenario
from pyomo_fesd.solvers import MpecHybridConfig

NOT_RUN = 'not run'


def sweep(
    build: Callable,
    scenarios: pd.DataFrame,
    outputs: Sequence[str] | Mapping = (),
    executor=None,
    path=None,
    solve: Callable | None = None,
    progress: bool = True,
    **options,
) -> pd.DataFrame:
    """Solve a model for each row of a table; returns the table with the results beside.

    A scenario that fails is a row with its reason; the others go on.  With a ``path`` each row is written as soon as it is known.
    A sweep that was interrupted or killed goes on when it is called again with the same ``path``: scenarios whose row the file has
    are not solved again.

    Parameters
    ----------
    build : callable
        called with the values of a row as keywords; returns a model that is ready for the solver.  For other processes it must be
        a function of a module
    scenarios : pandas.DataFrame
        a row for each scenario, a column for each keyword of ``build``
    outputs : list of names of components, or dict column -> name of a component or callable (model) -> number
    executor : concurrent.futures.Executor or Dask client, optional
        runs the scenarios; default: one after the other here
    path : str or Path, optional
        CSV file of the rows
    solve : callable (model), optional
        instead of ``mpec_hybrid``, for example ``pyomo_fesd.simulate``; it fails with an exception
    progress : bool
        whether to show the progress bar of tqdm, if it is installed
    options : options of ``mpec_hybrid``

    Returns
    -------
    pandas.DataFrame
        with the index of ``scenarios``, its columns, and ``outcome`` (``'optimal'``; ``'failed'`` after an exception; ``'not run'``
        where the executor lost the scenario, which is then tried again by the next call), ``certified``, ``objective``,
        ``seconds``, ``reason``, ``warnings`` (what the review of ``mpec_hybrid`` says of the solution, such as a missed crossing),
        and a column for each output (empty without a solution)

    Raises
    ------
    FesdError
        for columns that have the same name, for a file of another sweep, and for unknown options, before anything is solved
    """
    check_keywords(MpecHybridConfig(), options, 'sweep')
    outputs = dict(outputs) if isinstance(outputs, Mapping) else {name: name for name in outputs}
    columns = [*map(str, scenarios.columns), *COLUMNS, *outputs]
    twice = sorted({name for name in columns if columns.count(name) > 1})
    if twice:
        raise FesdError('sweep', f"the column(s) {', '.join(twice)} would occur twice", "rename them in the table or in outputs")
    given = [dict(zip(map(str, scenarios.columns), row)) for row in scenarios.astype(object).itertuples(index=False, name=None)]
    file = None if path is None else ResultsFile(path, columns, given)
    rows = {} if file is None else dict(file.done)
    left = {position: values for position, values in enumerate(given) if position not in rows}
    runs = _here if executor is None else _elsewhere(executor)
    with progress_bar(len(given), len(rows), progress) as advance:
        for position, row in runs(Scenario(build, outputs, solve, options), left):
            rows[position] = given[position] | row
            if file is not None and row['outcome'] != NOT_RUN:
                file.add(position, rows[position])
            advance()
    return _table(rows, columns, scenarios)


def _here(run, left):
    for position, values in left.items():
        yield position, run(values)


def _elsewhere(executor):
    """The function that runs scenarios by ``executor`` and yields them as they end."""
    executor = executor.get_executor() if hasattr(executor, 'get_executor') else executor

    def runs(run, left):
        futures = {executor.submit(run, values): position for position, values in left.items()}
        try:
            for future in as_completed(futures):
                yield futures[future], _row(future)
        finally:
            # after Ctrl-C or an error here nothing else begins
            for future in futures:
                future.cancel()

    return runs


def _row(future):
    """The row of a scenario, or the reason why the executor has none."""
    error = future.exception()
    if error is None:
        return future.result()
    return {'outcome': NOT_RUN, 'certified': False, 'reason': ' '.join(f'{type(error).__name__}: {error}'.split())}


def _table(rows, columns, scenarios):
    """The rows in the order of the scenarios; those that were read from a file get their types."""
    found = pd.DataFrame([rows[position] for position in range(len(scenarios))], columns=columns, index=scenarios.index)
    for name in scenarios.columns:
        found[str(name)] = scenarios[name]
    found['certified'] = found['certified'].map(lambda cell: cell is True or cell == 'True').astype(bool)
    for name in ('objective', 'seconds', *columns[len(scenarios.columns) + len(COLUMNS) :]):
        found[name] = pd.to_numeric(found[name])
    return found.fillna({'reason': '', 'warnings': '', 'outcome': ''})
