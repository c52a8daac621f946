"""Time series as inputs: given values on physical time, linear between their times or stepped.

    linear    du/dt = (v_{k+1} - v_k)/(T_{k+1} - T_k)     T_k < t < T_{k+1},   u(t_0) given
    stepped   u(t)  = v_k                                 T_k < t <= T_{k+1}

The times T_k are known, so no complementarity finds them: they become points of the ContinuousSet, that is boundaries between
elements which keep their physical time, and between two of them the rate, or the value, is a constant.  Controls in
``piecewise_constant`` are not divided by them.

Takes: a ContinuousSet that is not discretised yet, times and values.
Leaves: a Var over it: a state with a given rate, or fixed; points of the ContinuousSet; a record of them in ``SwitchedSystems``.
Does not apply: with a free final time or free stage lengths, where labels have no given time.
"""

from pyomo.core import Block, Constraint
from pyomo.core.base.var import IndexedVar
from pyomo.dae import ContinuousSet, DerivativeVar

from pyomo_fesd.core import GENERATED, FesdError, discretised, switched_systems
from pyomo_fesd.modeling.time_series import TimeSeries, read_time_series

#: Points of the ContinuousSet closer than this part of the horizon are the same.
SAME = 1e-9


def signal(wrt: ContinuousSet, times, values=None, kind: str = 'linear', tolerance: float = 0.0, units=None) -> IndexedVar:
    """Return an input over ``wrt`` with given ``values`` at given ``times``, to be added to a block: ``m.u = signal(...)``.

    Parameters
    ----------
    wrt : ContinuousSet
    times : sequence of float, or pandas.Series
        increasing, in the unit of time of the model; a Series holds the values too, a dictionary likewise
    values : sequence of float or of Pyomo quantities, optional
    kind : str
        'linear': straight lines between the points; 'stepped': each value holds from its time to the next one
    tolerance : float
        points without which the series changes by no more are left out; the default 0 leaves out those without any effect
    units : Pyomo unit, optional
        of the Var; by default that of the values

    Raises
    ------
    FesdError
        for times and values that are no series or do not cover the horizon; when it is added to a block, if ``wrt`` is discretised
    """
    if getattr(wrt, 'ctype', None) is not ContinuousSet:
        raise FesdError(getattr(wrt, 'name', str(wrt)), "signal: this is not a ContinuousSet", "e.g. signal(m.t, times, values)")
    if not isinstance(kind, str) or kind not in KINDS:
        raise FesdError(wrt, f"signal: kind={kind!r}", f"give one of {', '.join(map(repr, KINDS))}")
    series, units = read_time_series(wrt, times, values, kind == 'stepped', tolerance, units)
    return KINDS[kind](wrt, series, units=units)


class _Signal(IndexedVar):
    """A Var over time with the values of a time series."""

    def __init__(self, wrt: ContinuousSet, series: TimeSeries, **kwargs):
        super().__init__(wrt, **kwargs)
        self._series = series

    def construct(self, data=None) -> None:
        """Add the times of the series to the ContinuousSet, and the Var."""
        if not self._constructed:
            wrt = self.index_set()
            if discretised(wrt):
                raise FesdError(self, f"signal: '{wrt.name}' is discretised already", "add it before fesd.finite_elements")
            self._series = self._series.at_points(list(wrt), SAME * (wrt.last() - wrt.first()))
            record = switched_systems(wrt.parent_block())
            for t in self._series.inside(wrt.first(), wrt.last()):
                if t not in wrt:
                    wrt.add(t)
                    record.breakpoints.append((wrt, t))
            record.signals.add(self)
            super().construct(data)


class SteppedSignal(_Signal):
    """Fixed at every time to the value before it: a time of a step belongs to the stage that ends there."""

    def construct(self, data=None) -> None:
        """Fix all values."""
        super().construct(data)
        for t in self:
            self[t].fix(self._series.before(t))

    def _getitem_when_not_present(self, index):
        found = super()._getitem_when_not_present(index)
        found.fix(self._series.before(index))
        return found


class LinearSignal(_Signal):
    """A state whose rate is a ``SteppedSignal``."""

    def construct(self, data=None) -> None:
        """Add the rate, in a generated block."""
        if self._constructed:
            return
        super().construct(data)
        for t in self:
            self[t].set_value(self._series.at(t))
        wrt, parent = self.index_set(), self.parent_block()
        self[wrt.first()].fix()
        name = f'{GENERATED}signal_{self.local_name}'
        parent.add_component(name, Block())
        block = parent.component(name)
        block.slope = SteppedSignal(wrt, self._series.slopes())
        block.rate = DerivativeVar(self, wrt=wrt)
        block.line = Constraint(wrt, rule=lambda b, t: b.rate[t] == b.slope[t])

    def _getitem_when_not_present(self, index):
        found = super()._getitem_when_not_present(index)
        found.set_value(self._series.at(index))
        return found


#: keyword ``kind`` -> class
KINDS = {'linear': LinearSignal, 'stepped': SteppedSignal}
