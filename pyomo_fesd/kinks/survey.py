"""Which absolute values are replaced, and why others are left alone: everything is read before anything is written."""

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import Integral
from pyomo.gdp import Disjunct

from pyomo_fesd.kinks.rewriting import read
from pyomo_fesd.kinks.sources import expressions


class Survey:
    """Reads sources and the named Expressions that they use, each once.

    Parameters
    ----------
    sources : iterable of ConstraintData, ObjectiveData, ComplementarityData, ExpressionData
    exclude : list of components
    largest_eps : float
    protective : bool
        whether also to replace where smoothing may protect

    Attributes
    ----------
    matches : ComponentMap source -> list of (Match, guarded)
    """

    def __init__(self, sources, exclude, largest_eps, protective):
        self._exclude = ComponentSet(exclude)
        self._largest_eps = largest_eps * (1 + 1e-9)  # eps is a root of a square
        self._protective = protective
        self._guarded = ComponentSet()
        self.matches = ComponentMap()
        self._guarded = _closure(self._read_all(sources))

    def _read_all(self, sources):
        """Read ``matches``; returns the uses of named Expressions by source."""
        uses, waiting = ComponentMap(), list(sources)[::-1]
        while waiting:
            source = waiting.pop()
            if source not in self.matches:
                readings = [read(e, self.chooser(source)) for e in expressions(source)]
                self.matches[source] = [m for matches, _ in readings for m in matches]
                stays = self._excluded(source) or _in_disjunct(source)
                uses[source] = [] if stays else [u for _, named in readings for u in named]
                waiting.extend(e for e, _ in reversed(uses[source]))
        return uses

    def chooser(self, source):
        """The function (Match, guarded) -> bool that tells what is replaced in ``source``."""
        return lambda match, guarded: self.reason(source, match, guarded) is None

    def reason(self, source, match, guarded):
        """Why an absolute value is left alone; None if it is replaced."""
        if self._excluded(source) or self._excludes_variable(match.z):
            return "excluded"
        if _in_disjunct(source):
            return "inside a Disjunct: apply fesd.dcs first"
        if isinstance(source.parent_component(), Integral):
            return "inside an Integral, which is not over time (give the integrand an Expression over time)"
        if match.eps > self._largest_eps:
            return "eps is larger than largest_eps"
        if not self._protective and (guarded or source in self._guarded):
            return "inside a root, a logarithm, a denominator or a power, where smoothing may protect"
        return None

    def _excluded(self, component):
        """Whether a component, or a block around it, is excluded."""
        while self._exclude and component is not None:
            if component in self._exclude or component.parent_component() in self._exclude:
                return True
            component = component.parent_block()
        return False

    def _excludes_variable(self, z):
        return bool(self._exclude) and any(map(self._excluded, identify_variables(z, include_fixed=True)))


def _in_disjunct(source):
    """Whether a source stands in a Disjunct, where a condition would have no meaning."""
    block = source.parent_block()
    while block is not None and block.ctype is not Disjunct:
        block = block.parent_block()
    return block is not None


def _closure(uses):
    """Named Expressions that are used in a guarded place somewhere, or by such an Expression."""
    guarded = ComponentSet()
    waiting = [e for named in uses.values() for e, inside in named if inside]
    while waiting:
        expression = waiting.pop()
        if expression not in guarded:
            guarded.add(expression)
            waiting.extend(e for e, _ in uses[expression])
    return guarded
