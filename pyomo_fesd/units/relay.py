"""Switches with memory: relays, relief valves, pumps with level switches (eq. E1, E2).

    acts above:   on while signal >= low,    off while signal <= high       (relief valve, pump that empties)
    acts below:   on while signal <= high,   off while signal >= low        (heater, pump that fills)

Between low and high the last mode goes on.

Takes: the signal, the two thresholds, what is switched, and its value in each mode.
Leaves: two Disjuncts with their Disjunction ``switch``; its multiplier comes from ``fesd.dcs`` with ``memory=[the Block]``.
Does not apply: to thresholds that are equal; without a distance a relay chatters, or slides: write a Disjunction without memory.
"""

from pyomo.core import Constraint
from pyomo.dae import ContinuousSet
from pyomo.gdp import Disjunct, Disjunction

from pyomo_fesd.errors import FesdError
from pyomo_fesd.units.over_time import block_over, like, refuse_order, variable

#: acts -> (how the signal stands to low and high while on, while off)
UNTIL = {
    'above': (lambda signal, low, high: signal >= low, lambda signal, low, high: signal <= high),
    'below': (lambda signal, low, high: signal <= high, lambda signal, low, high: signal >= low),
}


def relay(*sets, signal, low, high, output, on, off=0, acts='above', start=None, names=('on', 'off')):
    """A switch with hysteresis.

    Name the Block in ``memory``: ``TransformationFactory('fesd.dcs').apply_to(m, memory=[m.relay])``.

    Parameters
    ----------
    sets : Set, ...
        index sets, the ContinuousSet among them
    signal : Var, Expression, expression or function (block, index, ...) -> expression
        what is measured
    low, high : number, Param, expression or function
        the thresholds
    output : Var over ``sets``
        what is switched, which nothing else defines
    on, off : number, Var, Expression, expression or function
        the output in each mode
    acts : 'above' or 'below'
        whether it goes on at ``high`` and off at ``low``, or on at ``low`` and off at ``high``
    start : one of ``names``, optional
        the mode at the first time; default: free, where both are possible
    names : (str, str)
        of the two Disjuncts

    Returns
    -------
    Block over ``sets``, to be added to the model

    Raises
    ------
    FesdError
        for thresholds in the wrong order, an unknown ``acts`` or ``start``, sets without a ContinuousSet; when the Block is added,
        for an output that is no variable
    """
    if acts not in UNTIL:
        raise FesdError('relay', f"acts={acts!r} is neither of {list(UNTIL)}", "say where it is on")
    if start is not None and start not in names:
        raise FesdError('relay', f"start={start!r} is neither of {list(names)}", "name a mode, or leave it away")
    times = [s for s in sets if getattr(s, 'ctype', None) is ContinuousSet]
    if len(times) != 1:
        raise FesdError('relay', "what remembers needs a time", "give one ContinuousSet among the sets, e.g. m.t")
    refuse_order('relay', low, high, ('low', 'high'))
    begin = _Begin(times[0], sets.index(times[0]), start)
    given = dict(signal=signal, low=low, high=high, output=output, on=on, off=off)
    return block_over(sets, _Build(acts, names, begin), **given)


class _Begin:
    """The mode at the first time."""

    def __init__(self, time, position, start):
        self._time, self._position, self._start = time, position, start

    def fix(self, block):
        """Fix the indicator of the first mode, if there is one and this is the first time."""
        index = block.index() if isinstance(block.index(), tuple) else (block.index(),)
        if self._start is not None and index[self._position] == self._time.first():
            block.component(self._start).indicator_var.fix(True)


class _Build:
    """How to fill one block."""

    def __init__(self, acts, names, begin):
        self._acts, self._names, self._begin = acts, names, begin

    def __call__(self, block, signal, low, high, output, on, off):
        output = variable(output, block, 'output')
        low, high = like(low, signal), like(high, signal)
        for name, until, is_on in zip(self._names, UNTIL[self._acts], (on, off)):
            mode = Disjunct()
            block.add_component(name, mode)
            mode.until = Constraint(expr=until(signal, low, high))
            mode.output = Constraint(expr=output == like(is_on, output))
        block.switch = Disjunction(expr=[block.component(name) for name in self._names])
        self._begin.fix(block)
