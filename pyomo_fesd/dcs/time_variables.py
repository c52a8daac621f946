"""Distinguish differential states and their derivatives from algebraic variables."""

from pyomo.common.collections import ComponentSet

from pyomo_fesd.core import derivatives


class TimeVariables:
    """The derivatives of a model with respect to the ContinuousSet ``wrt``, and their states.

    Parameters
    ----------
    model : Block
    wrt : ContinuousSet
    defined : list of Var or VarData
        those that modes define, by the user's word
    """

    def __init__(self, model, wrt, defined=()):
        self._named = ComponentSet(v for var in defined for v in (var, *(var.values() if var.is_reference() else ())))
        self._derivatives = ComponentSet(derivatives(model, wrt))
        self._kinds = {}
        self._states = ComponentSet(d.get_state_var() for d in self._derivatives)

    def is_named(self, v) -> bool:
        """Whether the user says that modes define ``v``."""
        return v in self._named or v.parent_component() in self._named

    def kind(self, v) -> tuple:
        """Whether ``v`` is data of a derivative, and of a state, and the name of its unit; each component is looked up once."""
        component = v.parent_component()
        # by id: the model keeps its components
        found = self._kinds.get(id(component))
        if found is None:
            found = self._kinds[id(component)] = (self.is_derivative(v), self.is_state(v), str(v.get_units()))
        return found

    def is_derivative(self, v) -> bool:
        """Whether ``v`` is data of a derivative with respect to time."""
        return v.parent_component() in self._derivatives

    def is_state(self, v) -> bool:
        """Whether ``v`` is data of a differential state."""
        return v.parent_component() in self._states
