"""A shift of Ipopt's Hessian, with which one factorization is enough for most of its iterations.

Takes: a casadi Function of the Hessian, and what Ipopt has added to it in each iteration.
Leaves: a Function of the Hessian with a part of that added, which changes from one iteration to the next.
Does not apply: to other solvers, which do not show what they add.

Where the Hessian W of the Lagrangian has negative curvature, Ipopt factorizes with W, then with W + delta I, where delta is a third
of the last one, then with ever larger ones (algorithm IC of Waechter, Biegler, Math. Program. 106 (2006) 25).  As long as the
curvature stays, the first trial is in vain: relaxations of a hopper had 2.4 factorizations an iteration, and have 1.4 with a shift.
"""

import casadi as ca

#: The shift is this part of the whole that was added in the last iteration, as long as that is not below the second number.
PART, LEAST = 0.5, 1e-8


class HessianShift(ca.Callback):
    """The multiple of I that is added to a Hessian, as a casadi Function of a number that it does not use."""

    def __init__(self):
        super().__init__()
        self._size = 0.0
        self.construct('shift', {})

    def begin(self):
        """Begin a solve, without a shift."""
        self._size = 0.0

    def follow(self, added):
        """Take over a part of the last shift and of what Ipopt has ``added`` to it."""
        size = PART * (self._size + added)
        self._size = size if size >= LEAST else 0.0

    def shifted(self, hessian):
        """The casadi Function ``hessian``, the upper triangle of a matrix, with the shift."""
        names = hessian.name_in()
        arguments = [ca.MX.sym(name, hessian.sparsity_in(i)) for i, name in enumerate(names)]
        # casadi would evaluate a function without arguments only once
        shift = self(arguments[names.index('lam_f')])
        return ca.Function(
            hessian.name(), arguments, [hessian(*arguments) + shift * ca.MX.eye(hessian.size1_out(0))], names, hessian.name_out()
        )

    def get_n_in(self):
        return 1

    def get_n_out(self):
        return 1

    def eval(self, arguments):
        return [self._size]
