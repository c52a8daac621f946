"""Detect model changes that require another compilation.

Takes: a model as it was compiled.
Leaves: a check that visits the model's components once, and no expressions.
Does not detect: a change of ``scaling_factor``, which changes no answer.
"""

from pyomo.common.collections import ComponentMap
from pyomo.common.numeric_types import native_numeric_types
from pyomo.core import Block, Constraint, Expression, Objective, value
from pyomo.core.expr.visitor import identify_mutable_parameters, identify_variables
from pyomo.mpec import Complementarity

from pyomo_fesd.core import FesdError

#: Components whose expressions are compiled.
COMPILED = (Constraint, Objective, Complementarity, Expression)
AGAIN = "call set_instance again"
LIST = "list it in 'parameters' of set_instance, or call set_instance again"


class Snapshot:
    """A model as it was compiled.

    Parameters
    ----------
    problem : Mpcc
    parameters : list of VarData and ParamData
        which may have other values later
    """

    def __init__(self, problem, parameters):
        self._model, self._parameters = problem.model, parameters
        self._contents = _contents(problem.model)
        listed = {id(p) for p in parameters}
        self._constants = ComponentMap((c, value(c, exception=False)) for c in _constants(problem) if id(c) not in listed)
        self._sides = ComponentMap((v, _stated_bounds(v)) for v in _bare_sides(problem))

    def check(self) -> None:
        """Compare with the present model.

        Raises
        ------
        FesdError
            naming a component whose change the compiled functions do not contain
        """
        self._check_contents()
        self._check_values()
        for v, before in self._sides.items():
            if _stated_bounds(v) != before:
                raise FesdError(v, "the bounds of this variable, which make it a side of a complementarity, have changed", AGAIN)

    def _check_contents(self):
        now = _contents(self._model)
        for key, (data, content) in now.items():
            if key not in self._contents:
                raise FesdError(data, "this was added or activated after the model was compiled", AGAIN)
            if any(a is not b for a, b in zip(content, self._contents[key][1])):
                raise FesdError(data, "this was changed after the model was compiled", AGAIN)
        for key, (data, _) in self._contents.items():
            if key not in now:
                raise FesdError(data, "this was deactivated or deleted after the model was compiled", f"activate it, or {AGAIN}")

    def _check_values(self):
        for p in self._parameters:
            if p.is_variable_type() and not p.fixed:
                raise FesdError(p, "this parameter is not fixed any more", f"fix it, or {AGAIN}")
        for c, before in self._constants.items():
            if c.is_variable_type() and not c.fixed:
                raise FesdError(c, "this variable was fixed when the model was compiled and is not any more", AGAIN)
            now = value(c, exception=False)
            if now != before:
                raise FesdError(c, f"the value is {now}, but {before} was compiled into the model", LIST)


def _contents(model):
    """Everything that is compiled, by id: the component and the objects that make up its content."""
    found = model.component_data_objects(COMPILED, active=True, descend_into=Block)
    return {id(data): (data, _content(data)) for data in found}


def _content(data):
    if data.ctype is Complementarity:
        return (data._args,)
    return (data.expr, data.sense) if data.ctype is Objective else (data.expr,)


def _compared_expressions(problem):
    """All expressions that are compiled."""
    for data in problem.model.component_data_objects((Constraint, Objective), active=True, descend_into=Block):
        yield data.expr
    for c in problem.conditions:
        yield from (c.G, c.H)
    for _, mixed in problem.mixed:
        yield from mixed
    for d in problem.decisions:
        yield from (d.eta, d.constraint.expr)
    yield from (term.expression.expr for term in problem.hints.penalties)


def _constants(problem):
    """Fixed variables and mutable Params in the compiled expressions."""
    seen = {}
    for expr in _compared_expressions(problem):
        if hasattr(expr, 'is_expression_type'):
            yield from [v for v in identify_variables(expr, named_expression_cache=seen) if v.fixed]
            yield from identify_mutable_parameters(expr)


def _bare_sides(problem):
    """Variables that are arguments of a condition, with the bounds that they were declared with."""
    for source in problem.sources:
        yield from (a for a in source._args if hasattr(a, 'is_variable_type') and a.is_variable_type())


def _stated_bounds(v):
    """Bounds of a variable; an expression of Params, which is compiled as such, counts as one."""
    return tuple(b if b is None or b.__class__ in native_numeric_types else 'expression' for b in (v.lower, v.upper))
