"""One model of the study."""

from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Case:
    """A dynamic model of idaes-pse with one switch added.

    Attributes
    ----------
    script : str
        where it was published
    build : callable (number of elements) -> model
        runs the script as published, and its initialisation
    switch : callable (model)
        the lines that are added
    wrt : callable model -> ContinuousSet
    grids : tuple of int
        numbers of elements
    exact : callable (model), or None
        the switch as Disjunctions for the reference, where ``switch`` writes it otherwise
    inputs : callable (model), or None
        a line for inputs, before anything else
    stages : tuple of float
        times at which inputs change, points of the grid
    mode : callable (model, label) -> hashable, or None
        the mode of a switch that :func:`pyomo_fesd.switches` does not list, as exact limits
    freed : callable (model), or None
        lines between the simulation and the solve
    shot : callable model -> (variable, name of a state at the end, its value), or None
        what the reference finds by shooting where ``freed`` has made it free
    reference : dict
        options of the reference
    """

    script: str
    build: Callable
    switch: Callable
    wrt: Callable
    grids: tuple
    exact: Callable | None = None
    inputs: Callable | None = None
    stages: tuple = ()
    mode: Callable | None = None
    freed: Callable | None = None
    shot: Callable | None = None
    reference: dict = field(default_factory=dict)


def flowsheet_time(m):
    """The time of a flowsheet ``m.fs``."""
    return m.fs.time
