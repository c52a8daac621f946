"""Sorted sides and NLP solvers of a compiled MPCC, built once for all runs on it."""

from pyomo_fesd.mpcc.subproblems.side_constraints import sort_sides

#: Options that NLP solvers cannot change after they were built.
BUILT_IN = (
    'nlp_solver',
    'nlp_options',
    'relaxation_tol',
    'relaxation_iterations',
    'branch_tol',
    'branch_iterations',
)


class SolverCache:
    """Sides and NLP solvers of one compiled MPCC.

    Parameters
    ----------
    compiled : MpccFunctions

    Attributes
    ----------
    sides : Sides
    nlps : dict
        relaxations by form, ``'branch'`` and ``'restoration'``
    """

    def __init__(self, compiled):
        self._c, self._options = compiled, None
        self.sides, self.nlps = None, {}

    def prepare(self, options):
        """Sort the sides for the present bounds and parameters; drop NLP solvers built for other rows or with other options.

        To be called before a run, and once before many starts: they share the bounds, and so the sides.
        """
        sides, built_in = sort_sides(self._c), {name: options.get(name).value() for name in BUILT_IN}
        if self.sides is None or built_in != self._options or not sides.same_rows(self.sides):
            self.sides, self._options = sides, built_in
            self.nlps.clear()
        else:
            self.sides.take_bounds(sides)
