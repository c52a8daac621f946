"""Let ``casadi_ipopt`` answer to the names of Ipopt's executable, for scripts and initialisers that ask for it by name.

    SolverFactory('ipopt'),  SolverFactory('ipopt_v2'),  idaes' get_solver and InitializerBase      ->      casadi_ipopt

Takes: an explicit call.
Leaves: two names of Pyomo's registries with another class, until it is undone; a line in the log.
Does not apply: to solvers that exist already, to classes that are called directly, and to other solvers (``ipopt_l1``, PETSc).
"""

import logging

import pyomo.environ as pyo
from pyomo.contrib.solver.common.factory import SolverFactory as NewSolverFactory

logger = logging.getLogger('pyomo_fesd')

#: Keywords of solvers that run an executable; they have no effect here.
OF_EXECUTABLE = ('executable', 'solver_io', 'solver', 'type', 'validate', 'warmstart', 'io_options', 'keepfiles')


def _own(kwds):
    return {name: given for name, given in kwds.items() if name not in OF_EXECUTABLE}


class ExecutableKeywords:
    """A solver that accepts the keywords of an executable."""

    def __init__(self, **kwds):
        super().__init__(**_own(kwds))


class LegacyExecutableKeywords(ExecutableKeywords):
    """The same in Pyomo's older interface."""

    def solve(self, model, **kwds):
        """Solve ``model``, without the keywords of an executable."""
        return super().solve(model, **_own(kwds))

    def set_options(self, given: str) -> None:
        """Set options written as ``"tol=1e-8 max_iter=50"``."""
        for entry in given.split():
            name, _, text = entry.partition('=')
            self.options[name] = _number(text)


def _number(text):
    for convert in (int, float):
        try:
            return convert(text)
        except ValueError:
            pass
    return text


class Replacement:
    """Solvers that answer to the names ``ipopt`` and ``ipopt_v2`` until it is undone, or the context is left.

    Parameters
    ----------
    legacy, new : classes for Pyomo's older and newer registry
    """

    def __init__(self, legacy: type, new: type):
        self._before = []
        for registry, names, stands_in in ((pyo.SolverFactory, ('ipopt', 'ipopt_v2'), legacy), (NewSolverFactory, ('ipopt',), new)):
            for name in names:
                self._before.append((registry, name, registry._cls.get(name), registry._doc.get(name)))
                registry._cls[name] = stands_in
                registry._doc[name] = "The Ipopt in casadi's wheel, in place of an executable"
        logger.info(
            "casadi_ipopt stands in for 'ipopt' and 'ipopt_v2' of SolverFactory, also where idaes' get_solver asks for them"
        )

    def undo(self) -> None:
        """Give the names back what they meant before."""
        for registry, name, known, doc in reversed(self._before):
            for table, entry in ((registry._cls, known), (registry._doc, doc)):
                if entry is None:
                    table.pop(name, None)
                else:
                    table[name] = entry
        self._before = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.undo()
