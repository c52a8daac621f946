"""Elements as parts of a chain: which variables belong to each, so that one more can be inserted between two.

Where switches coincide, an element of length zero between them belongs to the same solution.  To look whether it can grow, a copy
of the equations of an element is inserted there; the element that it copies keeps its own variables.

Takes: the moving grid with all that was put on it.
Leaves: a chain of ``Part`` in the block's ``HomotopyHints``; where there are modes with hysteresis or laws of state jumps, whose
conditions at a boundary depend on both its sides, nothing can be inserted.
"""

from collections import defaultdict
from collections.abc import Iterator

from pyomo.common.collections import ComponentSet
from pyomo.core import Var
from pyomo.core.expr.visitor import identify_variables

from pyomo_fesd.core import MovingGrid, Part, TimeIndex, homotopy_hints, index_sets

#: Index sets of generated variables: name -> how much later their element is than the number in the index.
ELEMENT, BOUNDARIES = 'element', ('left', 'boundary')
LATER = {ELEMENT: 0} | dict.fromkeys(BOUNDARIES, 1)


def add_chain(moving: MovingGrid, families: list[dict]) -> None:
    """Add the chain of the elements; ``families`` are all variables over time, each as {label: data}."""
    depends_on_both = moving.hysteresis is not None or (moving.state_jumps is not None and bool(moving.state_jumps.laws))
    generated, gates = _generated(moving)
    if generated is None:
        return
    families = _varying_inside_stages(families, moving)
    homotopy_hints(moving.block).chains.append(
        tuple(
            Part(
                extent=moving.r[e.n],
                own=(*(f[t] for f in families for t in e.own_labels if t in f), *generated[e.n], moving.r[e.n]),
                gate=tuple(gates[e.n]),
                ends=tuple((f[e.left], f[e.right]) for f in families if e.left in f and e.right in f),
                copies=not depends_on_both,
            )
            for e in moving.grid.elements
        )
    )


def _varying_inside_stages(families, moving) -> list[dict]:
    """Without controls that are constant on a control stage: elements share these."""
    if moving.held is None:
        return families
    held = ComponentSet(v for c in moving.held.values() for v in identify_variables(c.body))
    if not held:
        return families
    return [family for family in families if not any(v in held for v in family.values())]


def _generated(moving):
    """Generated variables by element, and those of the boundary on its left; (None, None) if one belongs to neither."""
    own, gates, times = defaultdict(list), defaultdict(list), TimeIndex(moving.wrt)
    for component in moving.block.component_objects(Var, descend_into=True):
        if component is moving.r or not len(component) or times.time(next(iter(component.values()))) is not None:
            continue
        place = _place(component)
        if place is None:
            return None, None
        position, name = place
        for index, v in _data(component):
            n = index[position] + LATER[name]
            own[n].append(v)
            if name in BOUNDARIES:
                gates[n].append(v)
    return own, gates


def _place(component):
    """Position and name of the set of elements or boundaries in the index of a generated Var."""
    for position, subset in enumerate(index_sets(component)):
        if subset.local_name in LATER:
            return position, subset.local_name
    return None


def _data(component) -> Iterator[tuple]:
    for index, v in component.items():
        yield (index if isinstance(index, tuple) else (index,)), v
