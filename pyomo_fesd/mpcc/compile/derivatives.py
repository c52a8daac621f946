"""Exact derivatives of all NLPs of one MPCC from one differentiation of the model.

Relaxations and branches have the model's rows g and rows T(z, s) of the inner functions z = (G, H, decisions' equations) and
perhaps slacks s; their objective is f + weight penalty + C(z, s).  The model's Jacobian and Hessian are found once, T and C are
separable and cheap, and the chain rule gives the rest:

    J = [J_g 0; T_z J_z  T_s],    hess L = hess_model(lam_f, lam_f weight, lam_g, L_z) + J_z' L_zz J_z  (and the parts in s)

with L = lam_f C + lam_T T.  Of a short model, casadi derives each NLP as a whole instead: that takes less time than to set this up.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from pyomo_fesd.mpcc.compile.casadi_matrices import between


@dataclass(frozen=True)
class Derivatives:
    """Gradient of f, Jacobian of g, and Hessian of ``lam_f f + lam_g g`` (upper triangle) of an NLP."""

    gradient: object
    jacobian: object
    hessian: object
    lam_f: object
    lam_g: object


@dataclass(frozen=True)
class Outer:
    """Functions of inner functions z, slacks s and a parameter (SX): ``cost`` C, ``rows`` T and ``weight`` of the penalty."""

    z: object
    s: object
    parameter: object
    cost: object
    rows: object
    weight: object = 1.0

    def at(self, z, s, parameter, lam_f, lam) -> dict:
        """Return values and derivatives by (z, s) at expressions."""
        both, of_f, of_rows = ca.vertcat(self.z, self.s), ca.SX.sym('lam_f'), ca.SX.sym('lam', self.rows.numel())
        cost = ca.SX(self.cost)
        lagrangian = of_f * cost + _dot(of_rows, self.rows)
        pieces = {
            'weight': ca.SX(self.weight),
            'cost': cost,
            'rows': self.rows,
            'cost_gradient': ca.jacobian(cost, both).T,
            'rows_jacobian': ca.jacobian(self.rows, both),
        }
        with_multipliers = {'factors': ca.gradient(lagrangian, self.z), 'hessian': ca.hessian(lagrangian, both)[0]}
        inputs, values = [self.z, self.s, self.parameter], [z, s, parameter]
        found = {name: _at(piece, inputs, values) for name, piece in pieces.items()}
        inputs, values = [*inputs, of_f, of_rows], [*values, lam_f, lam]
        return found | {name: _at(piece, inputs, values) for name, piece in with_multipliers.items()}

    def inserted(self, z) -> list:
        """Return ``weight``, ``cost``, ``rows`` and their Jacobian by (z, s) at expressions (SX) of the inner functions."""
        pieces = [ca.SX(self.weight), ca.SX(self.cost), self.rows, ca.jacobian(self.rows, ca.vertcat(self.z, self.s))]
        return ca.substitute(pieces, [self.z], [z]) if z.numel() else pieces


@dataclass(frozen=True)
class Nlp:
    """``min f(x; p)`` with rows g(x; p), and their derivatives."""

    x: object
    p: object
    f: object
    g: object
    derivatives: Derivatives


def automatic(x: ca.SX, f: ca.SX, g: ca.SX, jacobian: ca.SX = None) -> Derivatives:
    """Derivatives that casadi finds for one NLP by itself, if not even the ``jacobian`` of g is known."""
    lam_f, lam_g = ca.SX.sym('lam_f'), ca.SX.sym('lam_g', g.numel())
    hessian = ca.hessian(lam_f * f + _dot(lam_g, g), x)[0]
    return Derivatives(ca.gradient(f, x), ca.jacobian(g, x) if jacobian is None else jacobian, ca.triu(hessian), lam_f, lam_g)


class ModelDerivatives:
    """A compiled MPCC's functions and derivatives, found once and called by every NLP.

    Parameters
    ----------
    functions : ScaledFunctions
    n, parameters, m, inner : int
        numbers of variables, parameters, rows and inner functions (G, H, equal)
    """

    def __init__(self, functions, n, parameters, m, inner):
        sizes = ('w', n), ('p', parameters), ('of_cost', 2), ('of_g', m), ('of_z', inner)
        self._parts, self._symbols = (functions.cost, functions.rows, functions.sides), [functions.kind.sym(*one) for one in sizes]

    # a function for each part: a gradient needs no row, a Hessian no part that is linear, and a certificate no Hessian

    @cached_property
    def _values(self):
        at = self._symbols[:2]
        return [ca.Function('values', at, [rows.values(*at)]) for rows in self._parts]

    @cached_property
    def _slopes(self):
        at = self._symbols[:2]
        return [ca.Function('slopes', at, [rows.jacobian(*at)]) for rows in self._parts]

    @cached_property
    def _curvatures(self):
        """The Hessians of the parts that are not linear, None for the others."""
        (w, p), factors = self._symbols[:2], self._symbols[2:]
        functions = (
            None if rows.functions.is_linear else ca.Function('curvatures', [w, p, some], [rows.hessian(w, p, some)])
            for rows, some in zip(self._parts, factors)
        )
        return list(functions)

    def values(self, w, p) -> list:
        """Return (f, penalty), g and (G, H, equal) at expressions."""
        return [function.call([w, p])[0] for function in self._values]

    def slopes(self, w, p) -> list:
        """Return their Jacobians by w."""
        return [function.call([w, p])[0] for function in self._slopes]

    def hessian(self, w, p, of_cost, of_g, of_z):
        """Return the upper triangle of the Hessian by w of the functions with these factors."""
        both = zip(self._curvatures, (of_cost, of_g, of_z))
        nothing = type(w)(w.numel(), w.numel())
        return sum((function.call([w, p, factors])[0] for function, factors in both if function is not None), nothing)


def composed(c, outer: Outer) -> Nlp:
    """Compose the ``Nlp`` of a compiled MPCC with the functions ``outer`` of its pairs and slacks.

    Parameters
    ----------
    c : MpccFunctions
    outer : Outer
    """
    return _inserted(c, outer) if c.short else _by_chain_rule(c, outer)


def _inserted(c, outer):
    """The ``Nlp`` of a short model: casadi derives its expressions in less time than the chain rule's matrices take to make.

    The Jacobian alone is made of the model's: casadi needs a pass for every column of a row that contains all of them, or for every
    row of such a column, as that of a slack.
    """
    weight, cost, rows, slopes = outer.inserted(ca.vertcat(c.G, c.H, c.equal))
    x, f, g = ca.vertcat(c.x, outer.s), c.f + weight * c.penalty + cost, ca.vertcat(c.g, rows)
    m, ns, J = len(c.lbg), outer.s.numel(), c.jacobian
    chain = ca.diagcat(J[m:, :], ca.SX.eye(ns))
    jacobian = ca.vertcat(ca.horzcat(J[:m, :], ca.SX(m, ns)), ca.mtimes(slopes, chain))
    return Nlp(x, ca.vertcat(outer.parameter, c.p), f, g, automatic(x, f, g, jacobian))


def _by_chain_rule(c, outer):
    kind, n, m, own, d = c.kind, len(c.x0), len(c.lbg), outer.parameter.numel(), c.derivatives
    ns, rows = outer.s.numel(), outer.rows.numel()
    x, p = kind.sym('x', n + ns), kind.sym('p', own + len(c.parameters))
    lam_f, lam_g = kind.sym('lam_f'), kind.sym('lam_g', m + rows)
    model = between(x, 0, n), between(p, own, p.numel())
    (cost, g, z), (J_cost, J_g, J_z) = d.values(*model), d.slopes(*model)
    at = outer.at(z, between(x, n, n + ns), between(p, 0, own), lam_f, between(lam_g, m, m + rows))
    chain, weight = ca.diagcat(J_z, kind.eye(ns)), at['weight']
    slopes = J_cost[0, :].T + weight * J_cost[1, :].T
    of_z, of_s = between(at['cost_gradient'], 0, c.inner), between(at['cost_gradient'], c.inner, c.inner + ns)
    gradient = ca.vertcat(slopes + J_z.T @ of_z, of_s)
    jacobian = ca.vertcat(ca.horzcat(J_g, kind(m, ns)), at['rows_jacobian'] @ chain)
    of_model = d.hessian(*model, ca.vertcat(lam_f, lam_f * weight), between(lam_g, 0, m), at['factors'])
    hessian = ca.diagcat(of_model, kind(ns, ns)) + ca.triu(chain.T @ at['hessian'] @ chain)
    derivatives = Derivatives(gradient, jacobian, hessian, lam_f, lam_g)
    return Nlp(x, p, cost[0] + weight * cost[1] + at['cost'], ca.vertcat(g, at['rows']), derivatives)


def plain_nlp(c) -> Nlp:
    """Return the ``Nlp`` of a compiled model without pairs."""
    nothing = ca.SX(0, 1)
    return composed(c, Outer(ca.SX.sym('z', c.inner), nothing, nothing, ca.SX(0), nothing, 0.0))


def with_parts(nlp: Nlp, up, down) -> Nlp:
    """Return the least sum of parts that are added to the rows ``up`` and subtracted from the rows ``down`` of an ``Nlp``."""
    n, m, kind = nlp.x.numel(), nlp.g.numel(), type(nlp.x)
    rows, signs = [*up.tolist(), *down.tolist()], [1.0] * len(up) + [-1.0] * len(down)
    E = ca.DM.triplet(rows, list(range(len(rows))), signs, m, len(rows))
    x, d = kind.sym('x', n + len(rows)), nlp.derivatives
    lam_f, lam_g = kind.sym('lam_f'), kind.sym('lam_g', m)
    inner = ca.Function('inner', [nlp.x, nlp.p, d.lam_f, d.lam_g], [nlp.g, d.jacobian, d.hessian])
    g, jacobian, hessian = inner.call([between(x, 0, n), nlp.p, kind(0), lam_g], kind is ca.MX, False)
    gradient = ca.vertcat(kind(n, 1), kind.ones(len(rows), 1))
    derivatives = Derivatives(
        gradient, ca.horzcat(jacobian, kind(E)), ca.diagcat(hessian, kind(len(rows), len(rows))), lam_f, lam_g
    )
    parts = between(x, n, x.numel())
    return Nlp(x, nlp.p, ca.sum1(parts), g + ca.mtimes(E, parts), derivatives)


def _at(expression, inputs, values):
    """An SX expression at ``values``, of which the first ones, inner functions, are only evaluated if it depends on them."""
    if expression.is_constant():
        return type(values[0])(ca.evalf(expression))
    first = 0 if inputs[0].numel() and ca.depends_on(expression, inputs[0]) else 1
    return ca.Function('piece', inputs[first:], [expression]).call(values[first:])[0]


def _dot(factors, rows):
    """Scalar product, 0 for no rows: casadi has several kinds of empty matrices."""
    return ca.dot(factors, rows) if rows.numel() else ca.SX(0)
