"""Keep the values of a round, and give them to the model again after the same discretisation."""

from collections.abc import Iterator

from pyomo.core import Block, Var
from pyomo.core.base.var import VarData
from pyomo.gdp import Disjunct


def read_values(model: Block) -> list[tuple]:
    """Return value and stale flag of every variable, in the order of the model."""
    return [(v.value, v.stale) for v in _variables(model)]


def write_values(model: Block, kept: list[tuple]) -> None:
    """Write what ``read_values`` has returned from a model with the same components."""
    for v, (number, stale) in zip(_variables(model), kept, strict=True):
        v.set_value(number, skip_validation=True)
        v.stale = stale


def _variables(model) -> Iterator[VarData]:
    return model.component_data_objects(Var, descend_into=(Block, Disjunct))
