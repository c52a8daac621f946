"""Switches with hysteresis: relays, relief valves, pumps with level switches (eq. E1, E2).

    acts above:   on while signal >= low,    off while signal <= high       (relief valve, pump that empties)
    acts below:   on while signal <= high,   off while signal >= low        (heater, pump that fills)

Between low and high the relay stays in its mode.

Takes: the signal, the two thresholds, the output, and its value in each mode.
Leaves: two Disjuncts with their Disjunction ``switch``; its multiplier comes from ``fesd.dcs`` with ``hysteresis=[the Block]``.
Does not apply: to equal thresholds, between which a relay chatters or slides: write a Disjunction without hysteresis.
"""

from pyomo.core import Block, Constraint
from pyomo.dae import ContinuousSet
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd.core import FesdError, TimeIndex
from pyomo_fesd.units.over_time import block_over, refuse_order, variable, with_unit

#: acts -> (relation of the signal to low and high while on, while off)
UNTIL = {
    'above': (lambda signal, low, high: signal >= low, lambda signal, low, high: signal <= high),
    'below': (lambda signal, low, high: signal <= high, lambda signal, low, high: signal >= low),
}


def relay(*sets, signal, low, high, output, on, off=0, acts='above', start=None, names=('on', 'off')) -> Block:
    """Return a Block over ``sets`` with a switch that has hysteresis.

    Name the Block in ``hysteresis``: ``TransformationFactory('fesd.dcs').apply_to(m, hysteresis=[m.relay])``.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    signal : Var, Expression, expression or function (block, index, ...) -> expression
        the measured quantity
    low, high : number, Param, expression or function
        the thresholds
    output : Var over ``sets``
        the switched quantity, defined by nothing else
    on, off : number, Var, Expression, expression or function
        the output in each mode
    acts : 'above' or 'below'
        whether it goes on at ``high`` and off at ``low``, or on at ``low`` and off at ``high``
    start : one of ``names``, optional
        the mode at the first time; default: free, where both are possible
    names : (str, str)
        of the two Disjuncts

    Raises
    ------
    FesdError
        for thresholds in the wrong order, an unknown ``acts`` or ``start``, sets without a ContinuousSet; when the Block is added,
        for an output that is not a Var
    """
    for name, choice, known in (('acts', acts, list(UNTIL)), ('start', start, [*names, None])):
        if choice not in known:
            raise FesdError('relay', f"{name}={choice!r} is neither of {known[:2]}", f"give one of them as {name}")
    times = [s for s in sets if getattr(s, 'ctype', None) is ContinuousSet]
    if len(times) != 1:
        raise FesdError('relay', "a switch with hysteresis needs a time", "give one ContinuousSet among the sets, e.g. m.t")
    refuse_order('relay', low=low, high=high)
    given = dict(signal=signal, low=low, high=high, output=output, on=on, off=off)
    return block_over(sets, _Build(acts, names, times[0], start), **given)


class _Build:
    """Fill one block; at the first time, fix the mode to ``start``."""

    def __init__(self, acts, names, wrt, start):
        self._acts, self._names, self._wrt, self._start = acts, names, wrt, start

    def __call__(self, block, signal, low, high, output, on, off):
        output = variable(output, block, 'output')
        low, high = with_unit(low, signal), with_unit(high, signal)
        for name, until, value in zip(self._names, UNTIL[self._acts], (on, off)):
            mode = Disjunct()
            block.add_component(name, mode)
            mode.until = Constraint(expr=until(signal, low, high))
            mode.output = Constraint(expr=output == with_unit(value, output))
        block.switch = Disjunction(expr=[block.component(name) for name in self._names])
        if self._start is not None and TimeIndex(self._wrt).time(block) == self._wrt.first():
            block.component(self._start).indicator_var.fix(True)
