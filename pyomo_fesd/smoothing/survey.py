"""Decide which absolute values are replaced and why others are left alone, before the model is changed."""

from itertools import chain

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core.expr.visitor import identify_variables
from pyomo.dae import Integral
from pyomo.gdp import Disjunct

from pyomo_fesd.core import ancestry
from pyomo_fesd.smoothing.rewriting import PatternReader, may_match
from pyomo_fesd.smoothing.sources import expressions, wholes


class Survey:
    """Read sources and the named Expressions that they use, each once.

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
        self._guarded, self._reader = ComponentSet(), PatternReader()
        self.matches = ComponentMap()
        self._guarded = _closure(self._read_all(sources))

    def _read_all(self, sources):
        """Read ``matches`` and return the uses of named Expressions by source; sources with neither have no entry."""
        uses, waiting, met = ComponentMap(), list(sources)[::-1], set()
        while waiting:
            source = waiting.pop()
            if id(source) in met:
                continue
            met.add(id(source))
            if may_match(wholes(source)):
                self.matches[source], uses[source] = self._read(source)
                waiting.extend(e for e, _ in reversed(uses[source]))
        return uses

    def _read(self, source):
        """The matches and the uses of named Expressions in one source; no uses where the source stays as it is."""
        readings = [self._reader.read(e, self.replaced_in(source)) for e in expressions(source)]
        matches, uses = (list(chain.from_iterable(found)) for found in zip(*readings))
        return matches, [] if uses and (self._excluded(source) or _in_disjunct(source)) else uses

    def replaced_in(self, source):
        """Return the function (Match, guarded) -> bool that holds for the matches to replace in ``source``."""
        return lambda match, guarded: self.reason(source, match, guarded) is None

    def reason(self, source, match, guarded: bool) -> str | None:
        """Return why an absolute value is left alone; None if it is replaced."""
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
        return bool(self._exclude) and any(
            one in self._exclude or one.parent_component() in self._exclude for one in (*ancestry(component), component.model())
        )

    def _excludes_variable(self, z):
        return bool(self._exclude) and any(map(self._excluded, identify_variables(z, include_fixed=True)))


def _in_disjunct(source):
    """Whether a source is in a Disjunct, where a condition would have no meaning."""
    return any(block.ctype is Disjunct for block in ancestry(source.parent_block()))


def _closure(uses):
    """Named Expressions that are used inside a guarded argument, or by such an Expression."""
    guarded = ComponentSet()
    waiting = [e for named in uses.values() for e, inside in named if inside]
    while waiting:
        expression = waiting.pop()
        if expression not in guarded:
            guarded.add(expression)
            waiting.extend(e for e, _ in uses.get(expression, ()))
    return guarded
