"""``fesd.smooth_to_complementarity``: write |z| and its smoothings exactly (theory, eq. 8)."""

import logging

from pyomo.common.config import Bool, ConfigDict, ConfigValue, NonNegativeFloat, document_class_CONFIG
from pyomo.core import Transformation
from pyomo.core.base.block import BlockData
from pyomo.core.util import target_list
from pyomo.dae import ContinuousSet

from pyomo_fesd.core import (
    TRANSFORMATION,
    FesdError,
    TimeWriter,
    add_writer,
    continuous_sets,
    find_continuous_set,
    moving_grids,
    paused_collection,
    read_keywords,
    restored_on_error,
)
from pyomo_fesd.smoothing.generated_blocks import source_of
from pyomo_fesd.smoothing.rewritten_sources import SourceRewriter
from pyomo_fesd.smoothing.sources import sources
from pyomo_fesd.smoothing.summary import Summary
from pyomo_fesd.smoothing.survey import Survey

logger = logging.getLogger('pyomo_fesd')
NAME = 'fesd.smooth_to_complementarity'


def _list_of_components(arg):
    return list(arg) if isinstance(arg, (list, tuple)) else [arg]


@document_class_CONFIG(methods=['apply_to', 'create_using'])
class SmoothToComplementarity(Transformation):
    """Write every absolute value, exact or smoothed, as |z| = 2 s - z, 0 <= s perp s - z >= 0 (theory, eq. 8).

    ``abs(z)`` and ``sqrt(z**2 + c)`` with a small constant c = eps**2, also written as power or product, are read as |z| in active
    Constraints, Objectives and Complementarities and the named Expressions that they use.  This includes
    max(a, b) = (a + b + |a - b|)/2 and the IDAES functions made from it; like terms are collected, so the result is b + s.  One
    variable and one pair for each different z of a constraint; none where declared bounds decide the sign of z.

    The components are changed in place: same names, same indices, same active state.  The change cannot be reversed;
    ``create_using`` leaves the original as it is.  A second application changes nothing.

    Works before and after discretisation, and on models without time.  On a model that is not discretised yet, the later
    expansion by ``fesd.finite_elements`` continues at the new times.

    Returns
    -------
    Summary
        from ``apply_to``: counts of absolute values that were replaced, and left alone by reason; also logged, at INFO

    Raises
    ------
    FesdError
        for targets and ``wrt`` that do not fit, and after ``fesd.finite_elements``; the model is then unchanged
    """

    CONFIG = ConfigDict(NAME)
    CONFIG.declare(
        'targets',
        ConfigValue(
            domain=target_list,
            description="Blocks, Constraints, Objectives, Complementarities or Expressions to transform; default: the whole model",
        ),
    )
    CONFIG.declare('wrt', ConfigValue(description="the ContinuousSet whose expansion is followed; default: every one of the model"))
    CONFIG.declare(
        'exclude',
        ConfigValue(
            default=[],
            domain=_list_of_components,
            description="components to leave alone: any of these, or Vars that occur in z",
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
            domain=Bool,
            description="replace also inside roots, logarithms, denominators and powers other than 1, 2, 3, ..., where "
            "smoothing may keep the argument away from 0",
        ),
    )

    def _apply_to(self, instance, **kwds):
        config = read_keywords(self.CONFIG, kwds, NAME)
        over = [find_continuous_set(instance, config.wrt, NAME)] if config.wrt is not None else _continuous_sets(instance)
        choice = {'exclude': config.exclude, 'largest_eps': config.largest_eps, 'protective': config.protective}
        with TRANSFORMATION, restored_on_error(instance):
            summary = _replace_absolute_values(instance, config.targets, choice)
            for wrt in over:
                add_writer(_SmoothingWriter(instance, wrt, config.targets, choice))
        logger.info('%s: %s', NAME, summary)
        return summary

    def get_src_constraint(self, condition):
        """Return the ConstraintData (or data of another type) that a generated complementarity condition was made for."""
        return source_of(condition)


class _SmoothingWriter(TimeWriter):
    """One application of ``fesd.smooth_to_complementarity``; ``targets`` and ``choice`` are its keywords."""

    __slots__ = ('instance', 'targets', 'choice')

    def __init__(self, instance, wrt, targets, choice):
        super().__init__(instance if isinstance(instance, BlockData) else instance.parent_block(), wrt)
        self.instance, self.targets, self.choice = instance, targets, choice

    def write(self):
        """Replace the terms that the new times bring."""
        _replace_absolute_values(self.instance, self.targets, self.choice)


def _replace_absolute_values(instance, targets, choice):
    """Replace every absolute value of the targets; returns a ``Summary``."""
    with paused_collection():
        survey = Survey(sources(instance, targets), **choice)
        reasons = [(s, [survey.reason(s, *m) for m in matches]) for s, matches in survey.matches.items()]
        _refuse_moving_elements(s for s, found in reasons if None in found)
        summary, rewriter = Summary(), SourceRewriter()
        for source, found in reasons:
            for reason in filter(None, found):
                summary.note_left(source, reason)
            if None in found:
                pairs = rewriter.rewrite(source, found, survey.replaced_in(source))
                summary.note_changed(source, found.count(None), pairs)
    return summary


def _continuous_sets(instance):
    return list(instance.model().component_objects(ContinuousSet, descend_into=True))


def _refuse_moving_elements(changing):
    """Refuse to add pairs after the conditions were summed up over the elements: their switches would not be located."""
    for source in changing:
        for wrt in continuous_sets(source):
            if wrt in moving_grids(source):
                raise FesdError(
                    source,
                    f"it contains an absolute value, but the elements over '{wrt.name}' are movable already",
                    f"apply {NAME} before fesd.finite_elements",
                )
