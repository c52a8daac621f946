"""The record of a physical time inside a control stage: shares of its elements that pass before it.

Written by ``at``; ``simulate`` and ``start_from`` set the shares after the lengths.
"""

from dataclasses import dataclass

from pyomo.core import value


@dataclass(frozen=True)
class Instant:
    """A physical time.

    Attributes
    ----------
    begin : float
        label of the left boundary of the first element that may contain it
    shares : dict
        number of each element that may contain it, in their order -> share, a variable, or an expression where there is only one
    durations : list
        of these elements
    passed : expression or float
        time since ``begin``
    """

    begin: float
    shares: dict
    durations: list
    passed: object

    def place(self) -> None:
        """Set the shares that are variables to their values at the present lengths."""
        left = value(self.passed)
        for s, duration in zip(self.shares.values(), self.durations):
            length = value(duration)
            if s.is_variable_type():
                s.set_value(min(max(left / length, 0.0), 1.0))
            left -= length
