"""The record of a run as a JSON file, to attach to a bug report; also of a run that ends in an error."""

import json
import math
import platform
import traceback
from dataclasses import asdict, fields
from importlib.metadata import version

import numpy as np

from pyomo_fesd.mpcc.algorithm import LogEntry, Run
from pyomo_fesd.mpcc.reporting.output_files import open_to_write, warn_of_loss
from pyomo_fesd.mpcc.reporting.pyomo_results import MEASURES

#: Packages whose versions are recorded.
PACKAGES = ('pyomo', 'casadi', 'highspy', 'numpy', 'scipy')
#: Entries of ``results.extra_info`` in the record.
INFO = (
    *('outcome', 'stationarity', 'reason', 'lower_objective', *MEASURES, 'biactive_pairs', 'missing_values'),
    *('nlps', 'nlp_iterations', 'lpecs', 'binaries', 'eps_last', 'violated'),
)
#: Fields of a LogEntry in the record; the point would make the file large.
LOGGED = tuple(f.name for f in fields(LogEntry) if f.name != 'w')


class RunRecord:
    """Context in which a run is recorded: at its end, also by an error, the file is written.

    Its beginning refuses a file that cannot be written.

    Parameters
    ----------
    path : path or None
        None for no record
    results : Results
    config : ConfigDict
        options as given, with the timer

    Attributes
    ----------
    compiled : MpccFunctions, once there is one
    run : Run, likewise
    """

    def __init__(self, path, results, config):
        self._path, self._results, self._config = path, results, config
        self.compiled = self.run = None

    def __enter__(self):
        if self._path is not None:
            open_to_write('json_file', self._path, 'a').close()
        return self

    def __exit__(self, kind, error, trace):
        if self._path is not None:
            content = self._content() | {'error': error and ''.join(traceback.format_exception(kind, error, trace))}
            try:
                with open(self._path, 'w') as file:
                    json.dump(_plain(content), file, indent=1, allow_nan=False)
            except OSError as failure:
                warn_of_loss('json_file', self._path, failure)

    def _content(self):
        results, info, run = self._results, self._results.extra_info, self.run or Run()
        timer = self._config.timer
        return {
            'versions': _versions(results),
            'options': {name: entry for name, entry in self._config.value().items() if name != 'timer'},
            'sizes': self.compiled and _sizes(self.compiled),
            'termination_condition': results.termination_condition.name,
            'objective': results.incumbent_objective,
            'results': {name: info.get(name).value() for name in INFO if name in info},
            'seconds': timer and _phases(timer),
            'steps': [_logged(entry) for entry in run.steps],
            'starts': [asdict(start) for start in run.starts],
        }


def _logged(entry):
    return {name: getattr(entry, name) for name in LOGGED}


def _versions(results):
    ours = '.'.join(map(str, results.solver_version))
    return {
        'pyomo_fesd': ours,
        **{name: version(name) for name in PACKAGES},
        'python': platform.python_version(),
        'platform': platform.platform(),
    }


def _sizes(c):
    return {
        'variables': len(c.variables),
        'constraints': len(c.constraints),
        'pairs': len(c.conditions),
        'decisions': len(c.decisions),
        'parameters': len(c.parameters),
        'nonzeros': c.nonzeros,
    }


def _phases(timer):
    """Seconds and calls by phase, with the phases inside."""
    return {
        name: {'seconds': inner.total_time, 'calls': inner.n_calls} | ({'of which': _phases(inner)} if inner.timers else {})
        for name, inner in timer.timers.items()
    }


def _plain(content):
    """``content`` as strict JSON; numbers that are not finite, and objects of other types, become strings."""
    if isinstance(content, dict):
        return {str(key): _plain(entry) for key, entry in content.items()}
    if isinstance(content, (list, tuple, np.ndarray)):
        return [_plain(entry) for entry in content]
    if isinstance(content, np.generic):
        return _plain(content.item())
    if content is None or isinstance(content, (bool, int, str)):
        return content
    return content if isinstance(content, float) and math.isfinite(content) else str(content)
