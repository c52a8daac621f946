"""Write the pairs between multipliers that a LogicalConstraint leaves, beside it."""

from pyomo.core import Block, Set
from pyomo.mpec import Complementarity, complements

from pyomo_fesd.core import index_tuple, switched_systems
from pyomo_fesd.dcs.source_maps import source_maps


def write_exclusions(parent, proposition, exclusions, weights) -> None:
    """Add the pairs of one LogicalConstraint to the block ``parent`` and deactivate the LogicalConstraint.

    Parameters
    ----------
    exclusions : list of Exclusion
        those of all propositions
    weights : dict DisjunctionTree -> callable
        the sum of the multipliers of some modes of a system, by their numbers
    """
    constraint = proposition.constraint
    own = [exclusion for exclusion in exclusions if exclusion.proposition is proposition]
    for number, exclusion in enumerate(own, start=1):
        block = _exclusion_block(parent, constraint.parent_component())
        block.numbers.add(number)
        G, H = (weights[tree](modes) for tree, modes in exclusion.sides)
        pair = block.exclusion.add((*index_tuple(constraint.index()), number), complements(G >= 0, H >= 0))
        source_maps(block).connect(pair, [constraint])
    switched_systems(parent).excluded.add(constraint)
    constraint.deactivate()


def _exclusion_block(parent, component):
    """The block for all times of one LogicalConstraint; made at its first time."""
    block = parent.component(component.local_name)
    if block is None:
        block = Block()
        parent.add_component(component.local_name, block)
        block.numbers = Set(dimen=1)
        block.exclusion = Complementarity(*((component.index_set(),) if component.is_indexed() else ()), block.numbers)
    return block
