"""Moves of a switch that no small step makes.

Stage boundaries keep their physical time and elements their least length, so to carry a switch from one stage into the next an
element has to appear on one side and to vanish on the other.  No small step does that, and a solution whose switch stands on a
stage boundary can be a local minimum of the discretised problem only.  Nor can a switch pass an element that has its least
length.  At each inner boundary there are two moves: the element after it takes over the active set of the one before it, or the
other way round; inside a stage only where that element has its least length.

Takes: the pairs of ``cross``, ``memory`` and ``jumps``.
Leaves: ``move`` (the length of the element that changes) with the mark MOVE, by which ``mpec_hybrid`` looks at these branches too.
Does not apply: to a single element.
"""

from collections import defaultdict

from pyomo.core import Expression

from pyomo_fesd import marks


def add_moves(block, families, modes, jumps, grid):
    """Add the two moves of every inner boundary."""
    # an Expression bears the mark: with a Block for each move every walk over the model would take longer
    block.move = Expression(range(1, len(grid.elements)), [-1, 1])
    places = {names: _by_number(block, names) for names in (*ELEMENTS, *BOUNDARIES)}
    by_number = {e.n: e for e in grid.elements}
    for b in range(1, len(grid.elements)):
        for step in (-1, 1):
            # the element beside the boundary that changes; the switch itself goes from b to b + step
            changed = by_number[b + 1 if step > 0 else b]
            block.move[b, step] = block.r[changed.n]
            short = _start_short(block, grid, changed) if by_number[b + 1].opens_stage else [(block.r[changed.n], True)]
            marks.mark(block, marks.MOVE, block.move[b, step], (*short, *_pairs(places, changed.n, b, step)))


def _start_short(block, grid, changed):
    """The element that takes over starts with its least length; the others of its stage share the rest."""
    stage = grid.stages[changed.stage]
    if len(stage) == 1:
        return []
    least = block.r[changed.n].lb
    share = (stage[-1].right - stage[0].left - changed.length * least) / (len(stage) - 1)
    return [(block.r[e.n], least if e is changed else share / e.length) for e in stage]


#: Pairs of elements and pairs of boundaries, by the block below that of the grid that holds them.
ELEMENTS = ((None, 'cross'), ('memory', 'binary'))
BOUNDARIES = (('memory', 'parts'), ('memory', 'region'), ('memory', 'leaving'), ('jumps', 'happens'), ('jumps', 'binary'))


def _by_number(block, names):
    """The pairs of a component by their second index, then by the rest of it."""
    home, found = block.component(names[0]) if names[0] else block, defaultdict(dict)
    pairs = home.component(names[1]) if home is not None else None
    for index, pair in pairs.items() if pairs is not None else ():
        found[index[1]][(index[0], *index[2:])] = pair
    return found


def _pairs(places, changed, boundary, step):
    """``(pair, pair whose zero side it takes over)`` of one move; None where nothing happens at the end of the horizon."""
    for names in ELEMENTS:
        yield from _like(places[names], changed, changed - step)
    for names in BOUNDARIES:
        yield from _like(places[names], boundary + step, boundary)
        yield from _like(places[names], boundary, boundary - step)


def _like(pairs, number, other):
    """Pairs of one number, beside those of another that agree with them in everything else, or None."""
    return ((pair, pairs[other].get(rest)) for rest, pair in pairs[number].items())
