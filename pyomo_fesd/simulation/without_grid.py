"""Simulate a model that has no elements: they are laid, simulated, and taken away again.

Where the elements between two boundaries that keep their time have the same equations, a few of them are laid and march
(``marching_elements``): two on the whole of a single interval, where these have the same equations although the second contains
the last time; else a few at the beginning of each interval.  All of them are laid where states jump at their boundaries
(``state_jump``, contacts), and where equations or results contain the time itself, data over time or an ``Integral``.

Takes: a model before ``fesd.finite_elements``; ``fesd.dcs`` is applied while it is simulated.
Leaves: the trajectory; values at the times that the ContinuousSet has.  All else on the model is as before.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from pyomo.common.collections import ComponentSet
from pyomo.common.dependencies import pandas as pd
from pyomo.core import Block, TransformationFactory, Var
from pyomo.dae import ContinuousSet, DerivativeVar, Integral
from pyomo.gdp import Disjunct

from pyomo_fesd.core import (
    TimeIndex,
    all_switched_systems,
    own_components,
    own_data,
    phase,
    restored,
    share_elements,
    with_points,
    withheld_messages,
)
from pyomo_fesd.dcs import continues_everywhere
from pyomo_fesd.finite_elements import FiniteElements, lay_elements
from pyomo_fesd.results import SWITCHES, switches
from pyomo_fesd.simulation.inputs import hold_first_values
from pyomo_fesd.simulation.marching_elements import ElementsDiffer, TimeInElements

logger = logging.getLogger('pyomo_fesd')

#: Places of elements that march in each interval, and how many times as many elements there are where it is worth while.
PLACES, WORTH_IT = 3, 2
#: Largest part of an interval that its places take.
PART = 0.5
#: Options of ``fesd.finite_elements`` that ``simulate`` takes for a model without elements.
OPTIONS = 'nfe', 'ncp', 'scheme', 'cross_complementarity', 'piecewise_constant', 'continuous', 'fixed_points'


class WithoutGrid:
    """Lays elements for one simulation.

    Parameters
    ----------
    model : Block
    wrt : ContinuousSet
    inputs : list of Var
        the value at the end of each control stage holds throughout it
    grid : dict
        those of ``OPTIONS`` that are given
    timer : HierarchicalTimer
    """

    def __init__(self, model: Block, wrt: ContinuousSet, inputs: list[Var], grid: dict, timer):
        self._model, self._wrt, self._timer = model, wrt, timer
        self._config = FiniteElements.CONFIG(grid)
        # the times that elements add have no values of an input
        self._held = list(ComponentSet([*self._config.piecewise_constant, *inputs]))
        fixed = self._config.fixed_points
        self._points, self._numbers = with_points(wrt, fixed), share_elements(wrt, self._config.nfe, fixed)

    def simulate(self, march: Callable[[list[int]], Callable], whole: Callable[[], pd.DataFrame]) -> pd.DataFrame:
        """Simulate with elements that march where these are alike, else on the ``whole`` grid.

        Parameters
        ----------
        march : callable
            prepares numbers of elements, one for each interval, or raises ElementsDiffer; returns a function as the next one
        whole : callable
            returns the trajectory and leaves values on the elements
        """
        known = _Values(self._model.model())
        found = self._marched(known, march) if self._may_march() else None
        if found is None:
            with restored(self._model, self._wrt):
                self._lay()
                self._start()
                found = whole()
                found.attrs[SWITCHES] = switches(self._model, self._wrt)
                known.read()
        known.write()
        return found

    def _marched(self, known, march):
        """The trajectory of elements that march; None if they differ."""
        # the fewer places, the sooner the march begins
        for lay in (self._lay_two, self._lay_few) if self._may_march_on_two() else (self._lay_few,):
            try:
                return self._marched_on(known, march, lay)
            except TimeInElements:
                return None
            except ElementsDiffer:
                continue
        return None

    def _marched_on(self, known, march, lay):
        """The trajectory of elements that march on the places that ``lay`` makes."""
        with restored(self._model, self._wrt):
            with withheld_messages(logger.name) as messages:
                lay()
            try:
                run = march(self._numbers)
            except ElementsDiffer:
                # what is laid next says the same again
                messages.clear()
                raise
            finally:
                for message in messages:
                    logger.handle(message)
            found = run()
            known.read()
            return found

    def _may_march(self):
        """Whether it is worth while, and nothing is known that makes elements differ."""
        root, worth = self._model.model(), sum(self._numbers) >= WORTH_IT * (PLACES + 1) * len(self._numbers)
        integrals = root.component_objects(Integral, descend_into=(Block, Disjunct))
        systems = all_switched_systems(root)
        return worth and not (systems.resets or systems.contacts) and next(integrals, None) is None

    def _may_march_on_two(self):
        """Whether two places may do: in one interval, and without hysteresis, whose modes end at a boundary before the last.

        With one point each, two places would not show numbers that change with time.
        """
        alone = len(self._numbers) == 1 and self._config.ncp > 1
        return alone and not all_switched_systems(self._model.model()).hysteresis

    def _lay_two(self):
        """Lay two elements, with the ends of the only interval."""
        self._lay(nfe=2)

    def _lay_few(self):
        """Lay ``PLACES`` elements in each interval, and one for the rest of it."""
        ends = zip(self._points, self._points[1:], self._numbers)
        here = [a + min(PLACES / number, PART) * (b - a) for a, b, number in ends]
        inner = [*self._config.fixed_points, *here]
        self._lay(nfe=[PLACES, 1] * len(here), fixed_points=inner)

    def _start(self):
        """Let variables at the times that the elements have added begin with the values of the first time."""
        families = TimeIndex(self._wrt).families_in(own_components(self._model.model(), Var, (Block, Disjunct)))
        hold_first_values(families.values(), self._wrt.first(), ComponentSet(v for u in self._held for v in u.values()))

    def _lay(self, **places):
        """Lay the whole grid, or the ``places`` of elements that march: options of ``fesd.finite_elements``."""
        with phase(self._timer, 'transform'):
            if not continues_everywhere(self._model, self._wrt):
                TransformationFactory('fesd.dcs').apply_to(self._model, wrt=self._wrt)
            given = {name: self._config[name] for name in OPTIONS} | {'piecewise_constant': self._held, 'wrt': self._wrt} | places
            lay = lay_elements if places else TransformationFactory('fesd.finite_elements').apply_to
            lay(self._model, **given)


class _Values:
    """Values of the variables that a model has before elements are laid; those of indicators set the Booleans."""

    def __init__(self, root):
        places = Block, Disjunct
        self._variables = [v for ctype in (Var, DerivativeVar) for v in own_data(root, ctype, places) if not v.fixed]
        self._numbers = []

    def read(self):
        """Read what the simulation has found."""
        self._numbers = [(v, v.value) for v in self._variables]

    def write(self):
        """Write it to the model as it was before."""
        for v, number in self._numbers:
            v.set_value(number, skip_validation=True)
