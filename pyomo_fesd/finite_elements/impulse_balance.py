"""The balances of momentum in which contact forces act, read from the equations at one boundary (theory, eq. 20).

    M(q) dv = f(q, v, u) + J(q)^T lam        gives        M(q) (v+ - v-) = J(q)^T Lambda

M and J are the coefficients of the derivatives and of the forces; the derivatives of the positions q give the normal velocity

    gamma(v) = d gap/dt = grad gap(q)^T dq

Takes: active equations at the boundary.
Leaves: coefficients, as expressions; the model is not touched.
Does not apply: to equations that are nonlinear in a derivative or in a force, and to gaps of algebraic variables.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.core import Block, Constraint
from pyomo.core.expr.calculus.derivatives import Modes, differentiate
from pyomo.core.expr.calculus.diff_with_pyomo import DifferentiationException
from pyomo.core.expr.visitor import identify_variables, replace_expressions

from pyomo_fesd.core import FesdError, TimeIndex, derivatives, is_discretisation_equation


@dataclass(frozen=True)
class Momentum:
    """Balances of momentum that masses couple.

    Attributes
    ----------
    states : list of VarData
        the velocities v
    masses : list of list of expression
        M, one row for each balance
    forces : list of ComponentMap VarData -> expression
        for each balance -J^T by contact force
    """

    states: list
    masses: list
    forces: list

    def with_directions(self, swap: dict) -> 'Momentum':
        """Return the balances with other multipliers of friction: id of a variable -> the one in its place."""
        if not swap:
            return self
        forces = [ComponentMap((f, replace_expressions(slope, swap)) for f, slope in row.items()) for row in self.forces]
        return replace(self, forces=forces)

    def coefficients(self) -> Iterator:
        """Yield masses and directions."""
        for row, forces in zip(self.masses, self.forces):
            yield from (*row, *forces.values())


class BoundaryEquations:
    """The equations at some labels, by the variables in them.

    Parameters
    ----------
    model : Block
    times : TimeIndex
    labels : set of float
    """

    def __init__(self, model: Block, times: TimeIndex, labels: set):
        self._states, self._derivatives = ComponentMap(), ComponentMap()
        for derivative in derivatives(model, times.wrt):
            for index, xdot in derivative.items():
                state = derivative.get_state_var()[index]
                self._states[xdot], self._derivatives[state] = state, xdot
        self._times, self._by_variable = times, defaultdict(list)
        for c in model.component_data_objects(Constraint, active=True, descend_into=Block):
            if c.equality and not is_discretisation_equation(c) and times.time(c) in labels:
                for v in ComponentSet(identify_variables(c.body, include_fixed=True)):
                    self._by_variable[id(v)].append(c)

    def momentum(self, forces: Iterable) -> list[Momentum]:
        """Return the balances in which contact ``forces`` of one label act, in groups that masses couple.

        Raises
        ------
        FesdError
            for a force in no balance, or in an equation that is none
        """
        forces, groups, seen = ComponentSet(forces), [], ComponentSet()
        for force in forces:
            balances = self._by_variable[id(force)]
            if not balances:
                raise FesdError(
                    force,
                    "contact: no equation contains this force, so nothing keeps the bodies apart",
                    "add it to the balances of momentum, e.g. mass*m.dv[t] == -mass*g + m.floor[t].normal",
                )
            for balance in balances:
                if balance not in seen:
                    groups.append(self._coupled(balance, forces))
                    seen.update(groups[-1])
        return [self._read(group, forces) for group in groups]

    def _coupled(self, balance, forces):
        """The equations that share derivatives with ``balance``."""
        found, waiting = ComponentSet([balance]), [balance]
        while waiting:
            for xdot in self._rates(waiting.pop(), forces):
                new = [c for c in self._by_variable[id(xdot)] if c not in found]
                found.update(new)
                waiting += new
        return found

    def _rates(self, balance, forces):
        """The derivatives in a balance."""
        variables = ComponentSet(identify_variables(balance.body, include_fixed=True))
        rates = [v for v in variables if v in self._states]
        if not rates and any(v in forces for v in variables):
            force = next(v for v in variables if v in forces)
            raise FesdError(
                balance,
                f"contact: it contains the force '{force.name}' but no derivative, so an impulse has no balance",
                "write the force in the balance of momentum itself, or use an Expression in place of this equation",
            )
        return rates

    def _read(self, group, forces):
        rates = list(ComponentSet(v for balance in group for v in self._rates(balance, forces)))
        if len(rates) != len(group):
            names = ', '.join(v.name for v in rates)
            raise FesdError(
                next(iter(group)),
                f"contact: {len(group)} equations for {len(rates)} derivatives ({names})",
                "write one balance of momentum for each velocity on which a contact force acts",
            )
        masses = [[self._coefficient(balance, v, rates, forces) for v in rates] for balance in group]
        found = [
            ComponentMap((f, self._coefficient(balance, f, rates, forces)) for f in _contained(balance.body, forces))
            for balance in group
        ]
        return Momentum([self._states[v] for v in rates], masses, found)

    def _coefficient(self, balance, v, rates, forces):
        """The coefficient of a derivative or force."""
        found = _slope(balance, balance.body, v)
        impulsive = ComponentSet([*rates, *forces])
        other = next((u for u in _variables(found) if u in impulsive), None)
        if other is not None:
            raise FesdError(
                balance,
                f"contact: it is not linear in '{v.name}' and '{other.name}', so impulses have no balance",
                "write masses and directions as functions of positions",
            )
        return found

    def multipliers(self, groups: Iterable[Momentum]) -> ComponentSet:
        """Return the variables in masses and directions that are neither states nor constant in time."""
        found = (v for group in groups for slope in group.coefficients() for v in _variables(slope))
        return ComponentSet(v for v in found if not self._is_known(v))

    def between(self, variables) -> ComponentSet:
        """Return the equations that contain these variables only."""
        found = (c for v in variables for c in self._by_variable[id(v)])
        return ComponentSet(c for c in found if all(v in variables for v in _variables(c.body)))

    def normal_velocity(self, gap, where, velocities: ComponentSet):
        """Return gamma, the rate of a ``gap``, as a function of states.

        Parameters
        ----------
        where : component that errors name
        velocities : ComponentSet of VarData
            the states that jump at impacts

        Raises
        ------
        FesdError
            for gaps that depend on algebraic variables or on velocities, and positions whose rate is not given by one equation
        """
        rate = 0
        for x in ComponentSet(identify_variables(gap)):
            if self._times.time(x) is not None:
                if x not in self._derivatives or x in velocities:
                    kind = 'algebraic' if x not in self._derivatives else 'a velocity on which its force acts'
                    raise FesdError(
                        where,
                        f"contact: its gap contains '{x.name}', which is {kind}",
                        "write the gap in positions: differential states that do not jump, with an Expression for what follows "
                        "from them",
                    )
                rate += _slope(where, gap, x) * self._rate(self._derivatives[x], x)
        return rate

    def gradient(self, gap) -> list[tuple]:
        """Return the derivatives of the positions in a ``gap``, each with the slope of the gap in its position."""
        return [(self._derivatives[x], _slope(x, gap, x)) for x in self.positions(gap)]

    def positions(self, gap) -> list:
        """Return the differential states in a ``gap``."""
        return [x for x in ComponentSet(identify_variables(gap)) if x in self._derivatives]

    def _rate(self, xdot, x):
        """The derivative of a position as a function of states."""
        equations = self._by_variable[id(xdot)]
        if len(equations) == 1:
            equation = equations[0]
            slope = _slope(equation, equation.body, xdot)
            rest = replace_expressions(equation.body, {id(xdot): 0}) - equation.upper
            if all(self._is_known(v) for expr in (slope, rest) for v in _variables(expr)):
                return -rest / slope
        raise FesdError(
            xdot,
            f"contact: the gap depends on '{x.name}', and {len(equations)} equation(s) that are not linear in this derivative, or "
            "contain other variables than states, determine it",
            "write one equation for it in states, e.g. m.dq[t] == m.v[t]",
        )

    def _is_known(self, v):
        return v in self._derivatives or self._times.time(v) is None or v.fixed


def _contained(expr, among):
    return [v for v in ComponentSet(identify_variables(expr, include_fixed=True)) if v in among]


def _variables(expr):
    return list(identify_variables(expr, include_fixed=True)) if hasattr(expr, 'is_expression_type') else []


def _slope(where, expr, v):
    try:
        return differentiate(expr, wrt=v, mode=Modes.reverse_symbolic)
    except DifferentiationException as error:
        raise FesdError(where, f"contact: it cannot be differentiated in '{v.name}'", "write it in smooth functions") from error
