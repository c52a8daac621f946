"""The record of a run as a JSON file, to attach to a bug report; a run that ends in an error leaves one too."""

import json
import math
import platform
import traceback
from dataclasses import asdict, fields
from importlib.metadata import version

import numpy as np

from pyomo_fesd.mpcc.results import MEASURES
from pyomo_fesd.mpcc.run import Step

#: Packages whose versions are recorded.
PACKAGES = ('pyomo', 'casadi', 'highspy', 'numpy', 'scipy')
#: What is recorded of ``results.extra_info``.
INFO = (
    *('outcome', 'stationarity', 'reason', *MEASURES, 'biactive_pairs', 'missing_values'),
    *('nlps', 'nlp_iterations', 'lpecs', 'binaries', 'eps_last', 'violated'),
)
#: What is recorded of a step; its point would only make the file large.
STEP = tuple(f.name for f in fields(Step) if f.name != 'w')


class Record:
    """Context in which a run is recorded: at its end, also by an error, the file is written.

    Parameters
    ----------
    path : path or None
        None: nothing is recorded
    results : Results
    config : ConfigDict
        options as given, with the timer

    Attributes
    ----------
    compiled : Compiled, once there is one
    run : Run, likewise
    """

    def __init__(self, path, results, config):
        self._path, self._results, self._config = path, results, config
        self.compiled = self.run = None

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if self._path is not None:
            content = self._content() | {'error': error and ''.join(traceback.format_exception(kind, error, trace))}
            with open(self._path, 'w') as file:
                json.dump(_plain(content), file, indent=1, allow_nan=False)

    def _content(self):
        results, info = self._results, self._results.extra_info
        timer = self._config.timer
        return {
            'versions': _versions(results),
            'options': {name: entry for name, entry in self._config.value().items() if name != 'timer'},
            'sizes': None if self.compiled is None else _sizes(self.compiled),
            'termination_condition': results.termination_condition.name,
            'objective': results.incumbent_objective,
            'results': {name: info.get(name).value() for name in INFO if name in info},
            'seconds': None if timer is None else _phases(timer),
            'steps': [] if self.run is None else [{name: getattr(step, name) for name in STEP} for step in self.run.steps],
            'starts': [] if self.run is None else [asdict(start) for start in self.run.starts],
        }


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
    """``content`` in what strict JSON has: numbers that are not finite, and whatever else it has not, become strings."""
    if isinstance(content, dict):
        return {str(key): _plain(entry) for key, entry in content.items()}
    if isinstance(content, (list, tuple, np.ndarray)):
        return [_plain(entry) for entry in content]
    if isinstance(content, np.generic):
        return _plain(content.item())
    if content is None or isinstance(content, (bool, int, str)):
        return content
    return content if isinstance(content, float) and math.isfinite(content) else str(content)
