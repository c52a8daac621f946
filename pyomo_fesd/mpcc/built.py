"""What is built once for a compiled MPCC and serves every run on it: sorted sides and NLP solvers."""

from pyomo_fesd.mpcc.sides import sort_sides

#: Options that are built into the NLP solvers.
BUILT_IN = (
    'nlp_solver',
    'nlp_options',
    'relaxation_tol',
    'relaxation_iterations',
    'branch_tol',
    'branch_iterations',
)


class Built:
    """Sides and NLP solvers of one compiled MPCC.

    Parameters
    ----------
    compiled : Compiled

    Attributes
    ----------
    sides : Sides
    nlps : dict
        relaxations by form, ``'branch'`` and ``'feasibility'``
    """

    def __init__(self, compiled):
        self._c, self._options = compiled, None
        self.sides, self.nlps = None, {}

    def prepare(self, options):
        """Sort the sides for the present bounds and parameters; what was built for others, or with other options, is dropped.

        It comes before a run, and once before many starts: they share the bounds, and so the sides.
        """
        sides, wishes = sort_sides(self._c), {name: options.get(name).value() for name in BUILT_IN}
        if self.sides is None or wishes != self._options or not sides.same_rows(self.sides):
            self.sides, self._options = sides, wishes
            self.nlps.clear()
