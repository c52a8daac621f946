"""``fesd.smooth_to_complementarity``: |z| and its smoothings become exact (theory, eq. 8)."""

import logging

from pyomo.common.config import ConfigDict, ConfigValue, NonNegativeFloat, document_class_CONFIG
from pyomo.common.gc_manager import PauseGC
from pyomo.core import Transformation, TransformationFactory
from pyomo.core.util import target_list
from pyomo.dae import ContinuousSet

from pyomo_fesd import records
from pyomo_fesd.errors import FesdError
from pyomo_fesd.kinks.bounds import known_sign
from pyomo_fesd.kinks.home import add_for_source, continuous_sets, kinks_of, source_of
from pyomo_fesd.kinks.rewriting import rewrite
from pyomo_fesd.kinks.sources import expressions, put, sources
from pyomo_fesd.kinks.summary import Summary
from pyomo_fesd.kinks.survey import Survey
from pyomo_fesd.kinks.terms import Terms
from pyomo_fesd.timeindex import find_continuous_set

logger = logging.getLogger('pyomo_fesd')
NAME = 'fesd.smooth_to_complementarity'


def _components(arg):
    return list(arg) if isinstance(arg, (list, tuple)) else [arg]


@TransformationFactory.register(NAME, doc="abs() and its smoothings (IDAES smooth_abs, _max, _min, _bound) to complementarity")
@document_class_CONFIG(methods=['apply_to', 'create_using'])
class SmoothToComplementarity(Transformation):
    """Write every absolute value, exact or smoothed, as |z| = 2 s - z, 0 <= s perp s - z >= 0 (theory, eq. 8).

    Read as |z| are ``abs(z)`` and ``sqrt(z**2 + c)`` with a small constant c = eps**2, also written as power or product, in active
    Constraints, Objectives and Complementarities and the named Expressions that they use.  With |z| come
    max(a, b) = (a + b + |a - b|)/2 and what IDAES builds from it; like terms are collected, so it comes out as b + s.  One
    variable and one pair for each different z of a constraint; nothing where declared bounds tell the sign of z.

    All these are changed in place: same names, same indices, same active state.  There is no way
    back; ``create_using`` leaves the original as it is.  A second application changes nothing.

    Works before and after discretisation, and on models without time.  On a model that is not discretised yet, the later
    expansion by ``fesd.finite_elements`` continues with the new times.

    Returns
    -------
    Summary
        from ``apply_to``: what was replaced and what was left alone and why; also logged, at INFO

    Raises
    ------
    FesdError
        for targets and ``wrt`` that do not fit, and after ``fesd.finite_elements``; the model is then as it was
    """

    CONFIG = ConfigDict(NAME)
    CONFIG.declare(
        'targets',
        ConfigValue(
            domain=target_list,
            description="Blocks, Constraints, Objectives, Complementarities or Expressions to look at; default: the whole model",
        ),
    )
    CONFIG.declare('wrt', ConfigValue(description="the ContinuousSet whose expansion is followed; default: every one of the model"))
    CONFIG.declare(
        'exclude',
        ConfigValue(
            default=[],
            domain=_components,
            description="what is left alone: any of these, or Vars that occur in z",
        ),
    )
    CONFIG.declare(
        'largest_eps',
        ConfigValue(
            default=1e-2,
            domain=NonNegativeFloat,
            description="eps up to which sqrt(z**2 + eps**2) is read as |z|, in the units of z; a larger one is taken for physics",
        ),
    )
    CONFIG.declare(
        'protective',
        ConfigValue(
            default=False,
            domain=bool,
            description="replace also inside roots, logarithms, denominators and powers other than 1, 2, 3, ..., where "
            "smoothing may keep the argument away from 0",
        ),
    )

    def _apply_to(self, instance, **kwds):
        config = self.CONFIG(kwds.pop('options', {}))
        config.set_value(kwds)
        over = [find_continuous_set(instance, config.wrt, NAME)] if config.wrt is not None else _continuous_sets(instance)
        choice = {'exclude': config.exclude, 'largest_eps': config.largest_eps, 'protective': config.protective}
        with PauseGC():
            survey = Survey(sources(instance, config.targets), **choice)
            reasons = [(s, [survey.reason(s, *m) for m in matches]) for s, matches in survey.matches.items()]
            _refuse_moving_elements(s for s, found in reasons if None in found)
            summary = Summary()
            for source, found in reasons:
                _apply(source, found, survey.chooser(source), summary)
        for wrt in over:
            records.repeat_after_expansion(instance, NAME, wrt, targets=config.targets, **choice)
        logger.info('%s: %s', NAME, summary)
        return summary

    def get_src_constraint(self, condition):
        """The ConstraintData (or the data of another type) that a generated complementarity condition was made for."""
        return source_of(condition)


def _continuous_sets(instance):
    return list(instance.model().component_objects(ContinuousSet, descend_into=True))


def _refuse_moving_elements(changing):
    """A kink that is added after the conditions were summed up over the elements would not be located."""
    for source in changing:
        for wrt in continuous_sets(source):
            if wrt in records.records(source).grids:
                raise FesdError(
                    source,
                    f"it contains an absolute value, but the elements over '{wrt.name}' are movable already",
                    f"apply {NAME} before fesd.finite_elements",
                )


def _apply(source, reasons, chooser, summary):
    """Rewrite one source, if anything in it is to be replaced."""
    for reason in filter(None, reasons):
        summary.note_left(source, reason)
    if None in reasons:
        kinks = _Kinks(source)
        put(source, [rewrite(e, chooser, kinks.absolute) for e in expressions(source)])
        summary.note_changed(source, reasons.count(None), kinks.pairs)


class _Kinks:
    """The kinks of one source: equal z, or z and -z, share one s = max(0, z)."""

    def __init__(self, source):
        self._source = source
        self._number = kinks_of(source)
        self._known = {}
        self.pairs = 0

    def absolute(self, z):
        """|z| = 2 s - z; z and the result are Terms."""
        for sign in (1, -1):
            if z.key(sign) in self._known:
                return Terms(self._known[z.key(sign)], 2).add(z, -sign)
        self._number += 1  # counted also where bounds decide, so that a kink has the same number at all times
        expr = z.expression()
        sign = known_sign(expr)
        if sign:
            return Terms(z, sign)
        s = self._known[z.key()] = add_for_source(self._source, self._number, expr)
        self.pairs += 1
        return Terms(s, 2).add(z, -1)
