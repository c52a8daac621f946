"""``fesd.finite_elements``: collocation on elements whose boundaries find the switches."""

from contextlib import contextmanager
from dataclasses import dataclass

from pyomo.common.collections import ComponentSet
from pyomo.common.config import document_class_CONFIG
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, Transformation, Var
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec.complementarity import ComplementarityData

from pyomo_fesd.core import (
    GENERATED,
    TRANSFORMATION,
    FesdError,
    MovingGrid,
    TimeIndex,
    add_moving_grid,
    count_of,
    derivatives,
    discretised,
    find_continuous_set,
    homotopy_hints,
    is_generated,
    label_decimals,
    moving_grids,
    own_components,
    paused_collection,
    read_grid,
    read_keywords,
    restored_on_error,
    share_elements,
    signals,
    write_at_further_times,
)
from pyomo_fesd.finite_elements.arrivals import add_arrivals
from pyomo_fesd.finite_elements.chain_of_elements import add_chain
from pyomo_fesd.finite_elements.changes import changes_at_boundaries, switching_together
from pyomo_fesd.finite_elements.coincidences import add_coincidences
from pyomo_fesd.finite_elements.contacts import read_contacts, with_departures, without_left_slip
from pyomo_fesd.finite_elements.continuity import check_continuous, inner_label, read_continuity
from pyomo_fesd.finite_elements.controls import check_controls, fix_given, hold_controls
from pyomo_fesd.finite_elements.cross_complementarity import add_cross_complementarity
from pyomo_fesd.finite_elements.equilibration import add_equilibration
from pyomo_fesd.finite_elements.expansion import discretise
from pyomo_fesd.finite_elements.explicit_time import expressions_over_time, warn_explicit_time
from pyomo_fesd.finite_elements.fixed_points import add_fixed_points, check_fixed_points
from pyomo_fesd.finite_elements.free_time import check_free_time, factors
from pyomo_fesd.finite_elements.friction_impulses import add_friction_impulses
from pyomo_fesd.finite_elements.given_inputs import complete_params
from pyomo_fesd.finite_elements.hysteresis import add_hysteresis, read_hysteresis
from pyomo_fesd.finite_elements.lengths import add_lengths, check_orders, multiply_derivatives
from pyomo_fesd.finite_elements.mixed_complementarity import split_mixed
from pyomo_fesd.finite_elements.mode_limits import with_mode_limits
from pyomo_fesd.finite_elements.neighbour_branches import add_neighbour_branches
from pyomo_fesd.finite_elements.options import RENAMED, declare_options
from pyomo_fesd.finite_elements.quadrature import integrands, rebuild
from pyomo_fesd.finite_elements.recollocation import warn_of_order_one
from pyomo_fesd.finite_elements.right_limits import RightLimits
from pyomo_fesd.finite_elements.sliding_exit import add_sliding_exits
from pyomo_fesd.finite_elements.spatial_sets import refuse_waiting_space
from pyomo_fesd.finite_elements.state_jumps import add_state_jumps, check_guards, read_jumps
from pyomo_fesd.finite_elements.time_complementarities import (
    conditions_over_time,
    read_time_complementarities,
    refuse_lists_of_times,
    warn_gauss_on_curved_surfaces,
    warn_unknown,
)
from pyomo_fesd.finite_elements.untaken_kinks import warn_untaken_kinks

#: Types of blocks that may contain variables.
PLACES = (Block, Disjunct)


@dataclass
class _Switching:
    """All that switches: pairs, mixed conditions and sides of pairs (name -> {time: ...}), laws of modes, jumps and contacts."""

    pairs: dict
    mixed: dict
    sides: dict
    modes: list
    jumps: list
    contacts: list

    def __bool__(self):
        return bool(self.pairs or self.mixed or self.modes or self.jumps)

    def by_time(self):
        """Everything that is a condition, each as {time: condition}."""
        yield from (*self.pairs.values(), *self.mixed.values())
        yield from (mode.conditions for mode in self.modes)
        yield from (law.guards for law in self.jumps)

    def laws(self):
        """What holds at element boundaries: ``(name, {time: expressions})``."""
        yield from ((mode.system, mode.conditions) for mode in self.modes)
        for law in self.jumps:
            yield law.name, {t: (law.guards[t], *(after for _, after in resets)) for t, resets in law.resets.items()}


@document_class_CONFIG(methods=['apply_to', 'create_using'])
class FiniteElements(Transformation):
    """Discretise by collocation with variable element lengths h_n that find the switches (theory, eq. 9-13).

    pyomo.dae discretises; then every discretisation equation gets the multiplier r_n = h_n/hbar_n, the complementarities over
    time are aggregated over each element (eq. 11), and step equilibration ties the lengths where nothing switches (eq. 13).
    Where the complementarities come from does not matter: ``fesd.dcs``, or the user's own ``Complementarity`` over time; one with
    two bounds on one side becomes two pairs.

    The points that the ContinuousSet has before are boundaries of control stages: they keep their physical time, and each
    control stage gets the same number of elements, unless ``nfe`` lists others.  So do ``fixed_points``, at which inputs do not
    change.  The final time, or the length of each control
    stage, may be a variable.  On a model that is discretised already, the present grid is made movable.

    Raises
    ------
    FesdError
        naming the component, the cause and the fix; the model is then unchanged.

    Source: paper, eq. (8)-(10); Baumrucker and Biegler (2009); Nurkanovic et al. (2024).
    """

    CONFIG = declare_options()

    def _apply_to(self, instance, **kwds):
        RENAMED.refuse(kwds)
        with _laid(instance, read_keywords(self.CONFIG, kwds, 'fesd.finite_elements')) as (moving, switching, config):
            if switching:
                _relate_lengths(moving, config)
                _describe_boundaries(moving)
            _relate_variables(moving, switching)

    def get_src_complementarity(self, pair):
        """Return the conditions over time that an aggregated pair sums up."""
        return next(moving.sources[pair] for moving in moving_grids(pair).values() if pair in moving.sources)

    def get_element_lengths(self, wrt):
        """Return the length multipliers r_n = h_n/hbar_n (an IndexedVar over 1..N) of a moving grid, both lengths in labels."""
        return moving_grids(wrt)[wrt].r


def lay_elements(instance: Block, **options) -> None:
    """Lay elements to be solved one by one: ``fesd.finite_elements`` without all that relates elements to one another."""
    with _laid(instance, FiniteElements.CONFIG(options)):
        pass


@contextmanager
def _laid(instance, config):
    """Lay the elements with their equations and conditions; ``(moving, switching, config)``, to which the body adds relations."""
    wrt = find_continuous_set(instance, config.wrt, 'fesd.finite_elements')
    instance = _common_block(instance, wrt)
    _check_keywords(instance, wrt, config)
    with TRANSFORMATION, restored_on_error(instance, wrt), paused_collection():
        present = discretised(wrt)
        moving = _add_grid(instance, wrt, config)
        integrals = _rebuild_integrals(instance, moving)
        held = _held(config, wrt)
        switching = _read_switching(instance, wrt, held)
        if present and switching:
            warn_of_order_one(moving)
        _warn(expressions_over_time(instance, moving, integrals, switching.laws()), moving)
        continuity = _read_continuity(instance, moving, switching, config, held)
        complementarities = _read_complementarities(moving, switching, continuity)
        hold_controls(moving, config.piecewise_constant)
        multiply_derivatives(moving)
        _add_switching(moving, switching, complementarities, continuity, config, held)
        if not switching:
            moving.r.fix(1)
        yield moving, switching, config


def _common_block(block, wrt):
    """``block``, or the block of ``wrt`` if that lies above it (a flowsheet in a flowsheet): one grid for all over one time."""
    parent = wrt.parent_block()
    while parent is not None and parent is not block:
        parent = parent.parent_block()
    return wrt.parent_block() if parent is None else block


def _check_keywords(instance, wrt, config):
    """Refuse models and options before anything is changed."""
    if wrt in moving_grids(instance):
        raise FesdError(wrt, "its elements are movable already", "apply fesd.finite_elements once for each ContinuousSet")
    check_controls(config.piecewise_constant, wrt)
    check_continuous(config.continuous, config.piecewise_constant, wrt)
    check_free_time(config.final_time, config.stage_lengths, wrt, signals(wrt))
    refuse_lists_of_times(instance, TimeIndex(wrt))
    refuse_waiting_space(instance.model(), wrt)
    if discretised(wrt):
        return
    if config.stages is not None:
        raise FesdError(
            wrt,
            "stages= was given for a set that is not discretised yet",
            "put these boundaries into the ContinuousSet",
        )
    check_fixed_points(config.fixed_points, wrt)
    label_decimals(wrt, share_elements(wrt, config.nfe, config.fixed_points), config.ncp, config.fixed_points)


def _add_grid(instance, wrt, config):
    """Discretise, continue ``fesd.dcs`` at the new times, and return the record of the grid with its lengths."""
    stages = _discretise(instance, wrt, config)
    grid, model = read_grid(wrt, stages, config.fixed_points), instance.model()
    fix_given(config.piecewise_constant, grid, wrt)
    write_at_further_times(model, wrt)
    check_orders(model, wrt)
    block = Block()
    instance.add_component(unique_component_name(instance, GENERATED + 'elements_' + wrt.local_name), block)
    moving = MovingGrid(wrt, block, grid)
    add_moving_grid(moving)
    add_lengths(moving, config.length_bounds, factors(config.final_time, config.stage_lengths, stages))
    return moving


def _discretise(instance, wrt, config):
    """Lay the grid if there is none; return the control-stage boundaries."""
    if discretised(wrt):
        return sorted({wrt.first(), wrt.last(), *(config.stages or ())})
    stages = list(wrt)
    given = [*config.piecewise_constant, *signals(wrt)]
    shares = share_elements(wrt, config.nfe, config.fixed_points)
    add_fixed_points(config.fixed_points, wrt)
    discretise(instance, wrt, shares, config.ncp, config.scheme, given)
    complete_params(instance, wrt, given)
    return stages


def _rebuild_integrals(instance, moving):
    """Before conditions are read: piecewise functions inside an integrand have conditions of their own."""
    found = list(integrands(instance.model(), moving.wrt))
    for integrand in found:
        rebuild(moving, integrand)
    return found


def _read_switching(instance, wrt, held):
    conditions, model = conditions_over_time(instance, TimeIndex(wrt)), instance.model()
    switching = _Switching(*conditions, read_hysteresis(model, wrt), read_jumps(model, wrt), read_contacts(model, wrt))
    check_guards(switching.jumps, held)
    if not switching:
        _refuse_disjunctions(instance, TimeIndex(wrt))
    return switching


def _warn(expressions, moving):
    """Warn of what elements that move do not see."""
    warn_explicit_time(moving, expressions)
    warn_untaken_kinks(expressions)


def _held(config, wrt):
    """Inputs that are constant between two boundaries that keep their time."""
    states = ComponentSet(d.get_state_var() for d in derivatives(wrt.model(), wrt))
    return [*config.piecewise_constant, *(v for v in signals(wrt) if v not in states)]


def _refuse_disjunctions(instance, times):
    """A Disjunction that nobody transformed would impose nothing; beside other conditions it may be there on purpose."""
    for disjunction in instance.component_data_objects(Disjunction, active=True, descend_into=Block):
        if times.time(disjunction) is not None:
            raise FesdError(
                disjunction, "an active Disjunction over time", "apply fesd.dcs first: its complementarity finds the switches"
            )


def _read_continuity(instance, moving, switching, config, held):
    """Continuity at the inner labels of the conditions; by the equations there if they can matter."""
    conditions, grid = list(switching.by_time()), moving.grid
    labels = {inner_label(by_time, moving.wrt) for by_time in conditions}
    written = not all(map(_is_generated_pair, conditions))
    trace = written or (bool(conditions) and (len(grid.control_stages) > 1 or not grid.right_is_collocated))
    times = TimeIndex(moving.wrt)
    return read_continuity(instance.model(), times, labels, held, config.continuous, trace)


def _is_generated_pair(by_time):
    """Whether a condition over time is a generated Complementarity; its data are in general those of one component."""
    if not all(isinstance(c, ComplementarityData) for c in by_time.values()):
        return False
    return all(map(is_generated, {id(c.parent_component()): c for c in by_time.values()}.values()))


def _read_complementarities(moving, switching, continuity):
    pairs = switching.pairs | split_mixed(moving, switching.mixed, continuity)
    found = read_time_complementarities(moving, pairs, switching.sides, continuity)
    if not moving.grid.right_is_collocated:
        warn_gauss_on_curved_surfaces(moving, found, continuity)
    return found


def _add_switching(moving, switching, complementarities, continuity, config, held):
    """Write the pairs of all that switches."""
    add_state_jumps(moving, switching.jumps, switching.contacts)
    limits = RightLimits(moving, continuity, [*held, *config.continuous])
    complementarities = list(map(limits.with_starts, complementarities))
    add_hysteresis(moving, switching.modes, limits)
    complementarities = with_mode_limits(moving, complementarities, continuity, config.piecewise_constant)
    warn_unknown(moving, complementarities)
    add_friction_impulses(moving, complementarities)
    complementarities = without_left_slip(moving, with_departures(moving, complementarities))
    add_cross_complementarity(moving, complementarities, config.cross_complementarity)


def _relate_lengths(moving, config):
    """Write the conditions on the lengths."""
    add_equilibration(moving, config.equilibration, config.rho)
    if config.equilibration == 'two_stage':
        add_sliding_exits(moving)


def _describe_boundaries(moving):
    """Tell the solver what may change at the boundaries."""
    families = switching_together(moving)
    changes = changes_at_boundaries(moving, families)
    add_neighbour_branches(moving, changes)
    add_coincidences(moving, changes, families)
    add_arrivals(moving, families)


def _relate_variables(moving, switching):
    """Tell the solver which variables are one quantity over time, and have one size, and which belong to one element."""
    families = list(_variables_over_time(moving.block.model(), TimeIndex(moving.wrt)).values())
    homotopy_hints(moving.block).alike += [tuple(family.values()) for family in families]
    if switching:
        add_chain(moving, families)


def _variables_over_time(model, times):
    """All variables over time, by name; of most disjuncts, which are many, it is the binary of the indicator only."""
    families = times.families_in(own_components(model, Var, PLACES, enter=_has_more_than_indicator))
    for name, disjuncts in times.families_in(own_components(model, Disjunct, PLACES)).items():
        binaries = {t: disjunct.binary_indicator_var for t, disjunct in disjuncts.items()}
        families.setdefault(f'{name}.binary_indicator_var', {}).update(binaries)
    return families


def _has_more_than_indicator(place):
    """Whether a block is not a disjunct, or has variables beside the binary of its indicator."""
    types = place._ctypes
    return place.ctype is not Disjunct or count_of(place, Var) > 1 or Block in types or Disjunct in types
