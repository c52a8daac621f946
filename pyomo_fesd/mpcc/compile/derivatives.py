"""Exact derivatives of all NLPs of one MPCC from one differentiation of the model.

Relaxations and branches have the model's rows g and rows T(z, s) of the inner functions z = (G, H, decisions' equations) and
perhaps slacks s; their objective is f + weight penalty + C(z, s).  The model's Jacobian and Hessian are found once, T and C are
separable and cheap, and the chain rule gives the rest:

    J = [J_g 0; T_z J_z  T_s],    hess L = hess_model(lam_f, lam_f weight, lam_g, L_z) + J_z' L_zz J_z  (and the parts in s)

with L = lam_f C + lam_T T.
"""

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Derivatives:
    """Gradient of f, Jacobian of g, and Hessian of ``lam_f f + lam_g g`` (upper triangle) of an NLP, all SX."""

    gradient: object
    jacobian: object
    hessian: object
    lam_f: object
    lam_g: object


@dataclass(frozen=True)
class Outer:
    """Functions of inner functions z and slacks s (SX symbols): ``cost`` C and ``rows`` T."""

    z: object
    s: object
    cost: object
    rows: object


@dataclass(frozen=True)
class Nlp:
    """``min f(w; p)`` with rows g(w; p), all SX, and their derivatives."""

    x: object
    f: object
    g: object
    derivatives: Derivatives


def automatic(x: ca.SX, f: ca.SX, g: ca.SX) -> Derivatives:
    """Derivatives that casadi finds for one NLP by itself."""
    lam_f, lam_g = ca.SX.sym('lam_f'), ca.SX.sym('lam_g', g.numel())
    hessian = ca.hessian(lam_f * f + _dot(lam_g, g), x)[0]
    return Derivatives(ca.gradient(f, x), ca.jacobian(g, x), ca.triu(hessian), lam_f, lam_g)


class ModelDerivatives:
    """First and second derivatives of a compiled MPCC's functions.

    Attributes
    ----------
    f, penalty : SX (n), gradients
    g, z : SX, Jacobians; z = (G, H, equal)
    """

    def __init__(self, c):
        self._c = c
        self.f, self.penalty = ca.gradient(c.f, c.x), ca.gradient(c.penalty, c.x)
        self.parts = [ca.jacobian(e, c.x) for e in (c.g, c.G, c.H, c.equal)]
        self.g, self.z = self.parts[0], ca.vertcat(*self.parts[1:])
        self._hessian = None

    def hessian(self, of_f, of_penalty, of_g, of_z):
        """Hessian of the model's functions with these factors."""
        if self._hessian is None:
            c = self._c
            symbols = [ca.SX.sym('s'), ca.SX.sym('t'), ca.SX.sym('y', c.g.numel()), ca.SX.sym('z', self.z.shape[0])]
            inner = ca.vertcat(c.G, c.H, c.equal)
            lagrangian = symbols[0] * c.f + symbols[1] * c.penalty + _dot(symbols[2], c.g) + _dot(symbols[3], inner)
            self._hessian = ca.Function('hessian', [c.x, c.p, *symbols], [ca.hessian(lagrangian, c.x)[0]])
        return self._hessian(self._c.x, self._c.p, of_f, of_penalty, of_g, of_z)


def composed(c, weight, outer: Outer) -> Nlp:
    """Compose the ``Nlp`` of a compiled MPCC with the functions ``outer`` of its pairs and slacks by the chain rule.

    Parameters
    ----------
    c : MpccFunctions
    weight : SX or number, of the penalty
    outer : Outer
    """
    d, inner = c.derivatives, ca.vertcat(c.G, c.H, c.equal)
    m, s = c.g.numel(), outer.s
    lam_f, lam_g = ca.SX.sym('lam_f'), ca.SX.sym('lam_g', m + outer.rows.numel())
    both = ca.vertcat(outer.z, s)
    lagrangian = lam_f * outer.cost + _dot(lam_g[m:], outer.rows)
    pieces = {
        'cost': outer.cost,
        'rows': outer.rows,
        'cost_gradient': ca.gradient(outer.cost, both),
        'rows_jacobian': ca.jacobian(outer.rows, both),
        'factors': ca.gradient(lagrangian, outer.z),
        'hessian': ca.hessian(lagrangian, both)[0],
    }
    at = dict(zip(pieces, ca.substitute(list(pieces.values()), [outer.z], [inner])))
    chain = ca.diagcat(d.z, ca.SX.eye(s.numel()))
    gradient = ca.vertcat(d.f + weight * d.penalty, ca.SX(s.numel(), 1)) + chain.T @ at['cost_gradient']
    jacobian = ca.vertcat(ca.horzcat(d.g, ca.SX(m, s.numel())), at['rows_jacobian'] @ chain)
    model = d.hessian(lam_f, lam_f * weight, lam_g[:m], at['factors'])
    hessian = ca.diagcat(model, ca.SX(s.numel(), s.numel())) + chain.T @ at['hessian'] @ chain
    return Nlp(
        ca.vertcat(c.x, s),
        c.f + weight * c.penalty + at['cost'],
        ca.vertcat(c.g, at['rows']),
        Derivatives(gradient, jacobian, ca.triu(hessian), lam_f, lam_g),
    )


def _dot(factors, rows):
    """Scalar product, 0 for no rows: casadi has several kinds of empty matrices."""
    return ca.dot(factors, rows) if rows.numel() else ca.SX(0)
