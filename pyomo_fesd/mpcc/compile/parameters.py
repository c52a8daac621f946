"""Parameters that may change between solves: symbols in the compiled functions, not numbers.

A parameter is a fixed variable, which is free while the NL file is written, or a mutable Param, which a variable replaces in
every constraint, objective and side that contains it.  Bounds of variables need no symbol: each solve reads them again.
"""

from contextlib import contextmanager

import numpy as np
from pyomo.common.collections import ComponentMap
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, Constraint, ConstraintList, Objective, VarList, value
from pyomo.core.expr import RangedExpression
from pyomo.core.expr.visitor import identify_mutable_parameters, replace_expressions

from pyomo_fesd.core import FesdError


def parameter_data(components) -> list:
    """The scalar parameters among ``components`` (indexed or not), each once.

    Raises
    ------
    FesdError
        for a component that is neither a fixed variable nor a mutable Param
    """
    found = {}
    for component in components:
        indexed = getattr(component, 'is_indexed', bool)()
        for data in component.values() if indexed else (component,):
            if not may_change(data):
                raise FesdError(
                    component if indexed else data,
                    "not a parameter: neither a fixed variable nor a mutable Param",
                    "fix the variable, declare the Param with mutable=True, or leave it out of 'parameters'",
                )
            found[id(data)] = data
    return list(found.values())


def may_change(data) -> bool:
    """Whether ``data`` is a fixed variable or a mutable Param."""
    if not hasattr(data, 'is_variable_type'):
        return False
    return data.fixed if data.is_variable_type() else data.is_parameter_type() and data.parent_component().mutable


def parameter_values(parameters) -> np.ndarray:
    """Present values of ``parameters``.

    Raises
    ------
    FesdError
        for one without a value
    """
    for p in parameters:
        if value(p, exception=False) is None:
            raise FesdError(p, "this parameter has no value", "give it one before solving")
    return np.array([value(p) for p in parameters], dtype=float)


class ParameterSymbols:
    """Variables for the parameters while a model is compiled.

    Parameters
    ----------
    parameters : list of VarData and ParamData
    block : Block, optional
        for the variables that replace Params, and for the constraints and objective that contain them

    Attributes
    ----------
    parameters : list of VarData and ParamData
    variables : list of VarData
        one for each parameter, in their order
    replaced : list
        the model's inactive constraints and objective that rows of ``block`` replace
    """

    def __init__(self, parameters, block=None):
        self.parameters = parameters
        self._symbol, self._original, self.replaced = {}, ComponentMap(), []
        if block is not None:
            block.symbol, block.row = VarList(), ConstraintList()
        for p, now in zip(parameters, parameter_values(parameters)):
            if not p.is_variable_type():
                self._symbol[id(p)] = v = block.symbol.add()
                v.value = now
        self.variables = [self._symbol.get(id(p), p) for p in parameters]

    def substitute(self, expr):
        """``expr`` in terms of the variables that replace its Params."""
        return replace_expressions(expr, self._symbol) if self._concerns(expr) else expr

    def original(self, constraint):
        """The model's constraint behind one in the NL file."""
        return self._original.get(constraint, constraint)

    def replace_rows(self, model, block):
        """Replace the model's constraints and objective with Params by rows of ``block`` in terms of the variables."""
        for data in list(model.component_data_objects((Constraint, Objective), active=True, descend_into=Block)):
            split = _has_variable_bounds(data.expr)
            if not split and not self._concerns(data.expr):
                continue
            if data.ctype is Objective:
                block.objective = Objective(expr=self.substitute(data.expr), sense=data.sense)
            else:
                for row in self._halves(data.expr) if split else (self.substitute(data.expr),):
                    self._original[block.row.add(row)] = data
            data.deactivate()
            self.replaced.append(data)

    def _concerns(self, expr):
        if not self._symbol or not hasattr(expr, 'is_expression_type'):
            return False
        return any(id(p) in self._symbol for p in identify_mutable_parameters(expr))

    def _halves(self, expr):
        """A range whose bounds are variables, which Pyomo does not accept, as two rows."""
        low, body, high = map(self.substitute, expr.args)
        return low <= body, body <= high


def _has_variable_bounds(expr):
    """Whether ``expr`` is a range with a bound that is a symbol while it is compiled."""
    return isinstance(expr, RangedExpression) and any(hasattr(b, 'is_constant') and not b.is_constant() for b in expr.args[::2])


@contextmanager
def parameter_symbols(model, parameters):
    """The ``ParameterSymbols`` of ``parameters``; afterwards the model is as it was."""
    if not parameters:
        yield ParameterSymbols([])
        return
    block = Block()
    model.add_component(unique_component_name(model, '_pyomo_fesd_parameters'), block)
    fixed = [p for p in parameters if p.is_variable_type()]
    symbols = ParameterSymbols([])
    try:
        symbols = ParameterSymbols(parameters, block)
        for v in fixed:
            v.unfix()
        symbols.replace_rows(model, block)
        yield symbols
    finally:
        for data in symbols.replaced:
            data.activate()
        for v in fixed:
            v.fix()
        model.del_component(block)
