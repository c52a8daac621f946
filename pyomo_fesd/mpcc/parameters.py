"""Parameters that may change between solves: symbols in the compiled functions, not numbers.

A parameter is a fixed variable, which is free while the NL file is written, or a mutable Param, which a variable stands in for in
every constraint, objective and side that contains it.  Bounds of variables need no symbol: they are read again for every solve.
"""

from contextlib import contextmanager

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, Constraint, ConstraintList, Objective, VarList, value
from pyomo.core.expr.visitor import identify_mutable_parameters, replace_expressions

from pyomo_fesd.errors import FesdError


def parameter_data(components):
    """The scalar parameters among ``components`` (indexed or not).

    Raises
    ------
    FesdError
        for what is neither a fixed variable nor a mutable Param
    """
    datas = [d for c in components for d in (c.values() if c.is_indexed() else (c,))]
    for data in datas:
        fixed = data.is_variable_type() and data.fixed if hasattr(data, 'is_variable_type') else False
        if not fixed and not (hasattr(data, 'is_parameter_type') and data.is_parameter_type()):
            raise FesdError(data, "not a parameter: neither a fixed variable nor a mutable Param", "fix it, or leave it out")
    return datas


class Handles:
    """What stands for the parameters while a model is compiled."""

    def __init__(self, parameters):
        self._parameters, self._stand_in, self._source = list(parameters), {}, ComponentMap()
        self.variables = [p for p in self._parameters if p.is_variable_type()]

    def values(self):
        """The parameters' present values, in the order of ``variables``."""
        return parameter_values(self._parameters)

    def in_terms(self, expr):
        """``expr`` with the stand-ins of its Params."""
        if not self._stand_in or not hasattr(expr, 'is_expression_type'):
            return expr
        return replace_expressions(expr, self._stand_in)

    def source(self, constraint):
        """The model's constraint behind one in the NL file."""
        return self._source.get(constraint, constraint)

    def replace(self, model, block):
        """Let variables of ``block`` stand in for the Params; returns the components to wake afterwards."""
        block.stand_in, block.row = VarList(), ConstraintList()
        for p in self._parameters:
            if not p.is_variable_type():
                v = block.stand_in.add()
                v.value = value(p)
                self._stand_in[id(p)] = v
        # in the order of the parameters, as values() gives them
        self.variables = [self._stand_in.get(id(p), p) for p in self._parameters]
        asleep = []
        if not self._stand_in:
            return asleep
        for data in list(model.component_data_objects((Constraint, Objective), active=True, descend_into=Block)):
            if data.parent_block() is block or not any(id(p) in self._stand_in for p in identify_mutable_parameters(data.expr)):
                continue
            if data.ctype is Objective:
                block.objective = Objective(expr=self.in_terms(data.expr), sense=data.sense)
            else:
                self._source[block.row.add(self.in_terms(data.expr))] = data
            data.deactivate()
            asleep.append(data)
        return asleep


def parameter_values(parameters):
    """Present values of ``parameters`` as an array."""
    return np.array([value(p) for p in parameters], dtype=float)


@contextmanager
def symbols(model, parameters):
    """Handles for ``parameters``; the model is as it was afterwards."""
    handles = Handles(parameters)
    fixed = list(handles.variables)
    if not parameters:
        yield handles
        return
    block = Block()
    model.add_component(unique_component_name(model, '_pyomo_fesd_parameters'), block)
    asleep = []
    try:
        for v in fixed:
            v.unfix()
        asleep = handles.replace(model, block)
        yield handles
    finally:
        for data in asleep:
            data.activate()
        for v in fixed:
            v.fix()
        model.del_component(block)
