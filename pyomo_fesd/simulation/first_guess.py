"""Simulate before ``mpec_hybrid`` solves, where nothing is free: the values are then the solution, or a start."""

from pyomo.common.timing import HierarchicalTimer
from pyomo.core import Block, Objective

from pyomo_fesd.core import TimeIndex, kept_values, moving_grids, phase
from pyomo_fesd.mpcc import Deadline
from pyomo_fesd.simulation.passes import Simulation
from pyomo_fesd.simulation.simulate import states_fixed_later
from pyomo_fesd.simulation.static_equations import solve_static_equations
from pyomo_fesd.simulation.timeless_equations import timeless_equations
from pyomo_fesd.solvers import register_simulation


def simulate_first(model: Block, demanded: bool, quick: bool, timer: HierarchicalTimer, seconds: float | None) -> bool:
    """Write the values of a simulation into the model; returns False where it does not apply.

    It applies to models on one moving grid with lengths that vary, whose states are not fixed later, and which have no objective:
    an objective may also choose among solutions that are not unique.  Held controls keep their values.  With ``demanded`` only the
    grid counts.  With ``quick`` it ends where a step is not found at once.

    Raises
    ------
    FesdError
        where the simulation fails
    """
    grids = list(moving_grids(model).values())
    if len(grids) != 1 or all(r.fixed for r in grids[0].r.values()):
        return False
    wrt = grids[0].wrt
    if not demanded and not _is_a_simulation(model, wrt):
        return False
    with phase(timer, 'simulate'), kept_values(states_fixed_later(model, wrt)):
        times = TimeIndex(wrt)
        solve_static_equations(timeless_equations(model, times), times)
        Simulation(model, times, [], {}, timer, Deadline.after(seconds), quick).run()
    return True


def _is_a_simulation(model, wrt):
    """Whether nothing is free, or something is but no objective chooses it."""
    objective = any(True for _ in model.component_data_objects(Objective, active=True, descend_into=Block))
    return not objective and not any(True for _ in states_fixed_later(model, wrt))


register_simulation(simulate_first)
