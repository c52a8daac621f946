"""The record of sources: from which component of the user each generated component came, and the way back.

Written by ``blending.py``, ``reading/logic.py`` and ``piecewise/`` on the block that holds the generated components; read by the
reverse maps of ``fesd.dcs``.  Like all private data it is copied with its block and deleted with it.
"""

from pyomo.common.autoslots import AutoSlots
from pyomo.common.collections import ComponentMap
from pyomo.core import Block

_SCOPE = 'pyomo_fesd.dcs'


class SourceMaps(AutoSlots.Mixin):
    """Sources of the generated components of one block.

    Attributes
    ----------
    disjunction : ComponentMap
        generated constraint or complementarity -> DisjunctionData
    disjunct : ComponentMap
        generated complementarity -> DisjunctData whose multiplier it holds
    sources : ComponentMap
        generated component -> list of the components that it replaces
    replacements : ComponentMap
        replaced component -> list of the generated ones
    defined : ComponentMap
        of the model: VarData -> the DisjunctionData that defines it
    key : hashable or None
        of the block of a piecewise function: its triangulation, by which functions share the block
    """

    __slots__ = ('disjunction', 'disjunct', 'sources', 'replacements', 'defined', 'key')

    def __init__(self):
        self.disjunction, self.disjunct = ComponentMap(), ComponentMap()
        self.sources, self.replacements = ComponentMap(), ComponentMap()
        self.defined, self.key = ComponentMap(), None

    def connect(self, replacement, sources: list) -> None:
        """Enter that ``replacement`` replaces ``sources``, alone or with other components."""
        self.sources[replacement] = sources
        for source in sources:
            # ``setdefault`` raises and catches an error where there is none
            if source in self.replacements:
                self.replacements[source].append(replacement)
            else:
                self.replacements[source] = [replacement]


Block.register_private_data_initializer(SourceMaps, scope=_SCOPE)


def source_maps(block) -> SourceMaps:
    """Return the record of ``block``, for writing."""
    return block.private_data(_SCOPE)


def replaced_components(replacement) -> list | None:
    """Return the components that ``replacement`` replaces; None for a component of the user."""
    data = replacement.parent_block()._private_data
    return data[_SCOPE].sources.get(replacement) if data and _SCOPE in data else None


def defined_variables(block) -> ComponentMap:
    """Return the variables that Disjunctions of the model define: VarData -> DisjunctionData."""
    return source_maps(block.model()).defined
