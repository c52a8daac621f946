"""Parts of a model that follow one another, between which one more can be inserted.

Takes: nothing; a transformation writes chains of parts among the ``HomotopyHints`` of a block.
Leaves: ``Part``.
"""

from dataclasses import dataclass

from pyomo.core.base.var import VarData


@dataclass(frozen=True, eq=False)
class Part:
    """One of a chain of parts of a model, each of which begins with the values with which the one before ends.

    All rows that contain variables of a part, and besides them at most the last values of the part before, belong to the part.  Of
    an objective or another row it has a share that is 0 where its extent is.

    Attributes
    ----------
    extent : VarData
    own : tuple of VarData
        the variables of the part, in the same order in all parts of a chain; without those that parts have in common
    gate : tuple of VarData
        those among them that only say how it begins
    ends : tuple of (VarData, VarData)
        the same quantity at its beginning, a variable of the part before, and at its end
    copies : bool
        whether a copy of it can be inserted; not where other conditions between two parts depend on more than that
    """

    extent: VarData
    own: tuple[VarData, ...]
    gate: tuple[VarData, ...]
    ends: tuple[tuple[VarData, VarData], ...]
    copies: bool = True
