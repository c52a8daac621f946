"""Sums of the multipliers of one Disjunction at one time; each is an expression that is made once."""

from collections.abc import Iterable


class Weights:
    """The sum of the multipliers of some modes, given by their numbers: ``weights([0, 2])``.

    Parameters
    ----------
    block : BlockData
        of the form
    index : tuple
        of the Disjunction
    system : System
    form : module of ``forms``, or None where one mode is left
    known : dict tuple of mode numbers -> expression
        those that are made already
    """

    __slots__ = ('_block', '_index', '_system', '_form', '_known')

    def __init__(self, block, index, system, form, known=()):
        self._block, self._index, self._system, self._form = block, index, system, form
        self._known = dict(known)

    def __call__(self, modes: Iterable[int]):
        """Return the sum; 1.0 of all modes."""
        modes = tuple(modes)
        if modes not in self._known:
            everything = len(modes) == len(self._system.modes)
            self._known[modes] = 1.0 if everything else self._form.weight(self._block, self._index, self._system, modes)
        return self._known[modes]
