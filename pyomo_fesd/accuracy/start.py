"""Start values on a finer grid, from the solution on a coarser one.

Every piece of the old solution gets elements of equal length, at least one, so that its switches stand on element boundaries again
and the values name the branch in which the old solution lies.  Between the boundaries the values are those of the collocation
polynomials.

Takes: a model on its new grid, and the ``Solution``.
Leaves: values of all variables over time, of the element lengths, and of variables without time.
Does not apply: to what stands at element boundaries only (modes with memory, jumps); there a simulation with the old controls is
the start, if it comes to its end.
"""

import numpy as np
from pyomo.core import Block, Var

from pyomo_fesd.elements.cross import grid_of
from pyomo_fesd.errors import FesdError
from pyomo_fesd.march.simulate import simulate
from pyomo_fesd.records import records
from pyomo_fesd.timeindex import TimeIndex


def start_from(model, wrt, solution):
    """Set the values of ``model`` to those of ``solution``."""
    block, times = records(model).grids[wrt], TimeIndex(wrt)
    grid = grid_of(block)
    for v, was in solution.constants.items():
        _set(v, was)
    families = times.families(v for v in model.component_data_objects(Var, descend_into=Block) if not v.fixed)
    families = {name: family for name, family in families.items() if name in solution.values}
    for name, family in families.items():
        if wrt.first() in family:
            _set(family[wrt.first()], solution.values[name][wrt.first()])
    for element, piece, begin, end in _placed(grid, solution):
        total = sum(p.length for p in solution.pieces if p.stage == element.stage)
        nominal = sum(e.length for e in grid.stages[element.stage])
        if not block.r[element.n].fixed:
            block.r[element.n].set_value((end - begin) / total * nominal / element.length, skip_validation=True)
        labels = list(dict.fromkeys((*element.points, element.right)))
        at = begin + (end - begin) * np.array([*grid.tau, 1.0][: len(labels)])
        for name, family in families.items():
            for label, found in zip(labels, solution.inside(name, piece, at)):
                if label in family:
                    _set(family[label], found)
    if block.component('memory') is not None or block.component('jumps') is not None:
        _simulate(model, wrt)


def _simulate(model, wrt):
    try:
        simulate(model, wrt)
    except FesdError:
        # the values up to there are a start too
        return


def _set(v, found):
    """A value within the bounds; none where there is none."""
    if found is not None and not np.isnan(found):
        v.set_value(float(np.clip(found, v.lb, v.ub)) if v.has_lb() or v.has_ub() else float(found), skip_validation=True)


def _placed(grid, solution):
    """``(element, piece, begin, end)`` of all elements of the new grid, on physical time."""
    for stage, elements in grid.stages.items():
        pieces, waiting = [p for p in solution.pieces if p.stage == stage], iter(elements)
        for piece, number in zip(pieces, _shares([p.length for p in pieces], len(elements))):
            nodes = np.linspace(piece.nodes[0], piece.nodes[-1], number + 1)
            for begin, end in zip(nodes, nodes[1:]):
                yield next(waiting), piece, begin, end


def _shares(lengths, number):
    """Numbers of elements with the sum ``number``, at least one each, that make the longest element as short as can be."""
    found = [1] * len(lengths)
    for _ in range(number - len(lengths)):
        found[int(np.argmax(np.divide(lengths, found)))] += 1
    return found
