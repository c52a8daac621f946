"""Moves of a switch that no small step makes.

Stage boundaries keep their physical time and elements their least length, so to carry a switch from one stage into the next an
element has to appear on one side and to vanish on the other.  No small step does that, and a solution whose switch stands on a
stage boundary can be a local minimum of the discretised problem only.  Nor can a switch pass an element that has its least
length.  At each inner boundary there are two moves: the element after it takes over the active set of the one before it, or the
other way round; inside a stage only where that element has its least length.

Takes: the pairs of ``cross``, ``memory`` and ``jumps``.
Leaves: ``move`` (a Block for each move) with the mark MOVE, by which ``mpec_hybrid`` looks at these branches too.
Does not apply: to a single element.
"""

from collections import defaultdict

from pyomo.core import Block

from pyomo_fesd import marks


def add_moves(block, families, modes, jumps, grid):
    """Add the two moves of every inner boundary."""
    block.move = Block(range(1, len(grid.elements)), [-1, 1])
    places = {names: _by_number(block, names) for names in (*ELEMENTS, *BOUNDARIES)}
    opens = {e.n for e in grid.elements if e.opens_stage}
    for b in range(1, len(grid.elements)):
        for step in (-1, 1):
            # the element beside the boundary that changes; the switch itself goes from b to b + step
            changed = b + 1 if step > 0 else b
            home = block.move[b, step]
            if b + 1 not in opens:
                marks.mark(home, marks.MOVE, block.r[changed])
            else:
                _start_short(home, block, grid, changed)
            for target, source in _pairs(places, changed, b, step):
                marks.mark(home, marks.MOVE, target, source)


def _start_short(home, block, grid, changed):
    """The element that takes over starts with its least length; the others of its stage share the rest."""
    stage = next(elements for elements in grid.stages.values() if any(e.n == changed for e in elements))
    total = stage[-1].right - stage[0].left
    for e in stage if len(stage) > 1 else ():
        least = block.r[e.n].lb if e.n == changed else None
        rest = next(f.length * block.r[f.n].lb for f in stage if f.n == changed)
        marks.mark(home, marks.MOVE, block.r[e.n], least if least is not None else (total - rest) / (len(stage) - 1) / e.length)


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
