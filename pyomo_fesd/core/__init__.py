"""Concepts that all rooms share: errors, time in an index, grids, complementarity, expression keys, and the three records.

Read first ``errors``, ``time_index``, ``grid`` and ``complementarity``, then the records: ``switched_systems`` (which components
switch; written before discretisation), ``moving_grid`` with ``boundary_laws`` and ``instants`` (elements of variable length;
written by ``fesd.finite_elements``; ``held_controls`` reads from it) and ``homotopy_hints``, with ``changes`` and ``parts`` (for
the solver; no time in it).
``private_data`` keeps them on blocks, ``generated`` recognises generated blocks, ``keywords`` refuses values outside of their
domains, ``renamed`` words of earlier versions, ``rollback`` undoes what was left half done, ``interruption`` lets Ctrl-C wait
where something would be, ``withheld_messages`` keeps back the messages of one thread, ``turns`` lets threads wait for one another.
``evaluation``, ``fresh_data``, ``gradient``, ``gradients``, ``insertion``, ``interpolation``, ``positive_part``, ``step``,
``smallest``, ``sums``, ``units_of_measure``, ``expression_key``, ``stamp``, ``structural_key``, ``node_search``, ``own_data`` and
``phase`` are tools.
This room imports from no other.
"""

from pyomo_fesd.core.boundary_laws import Hysteresis, Impacts, StateJumps
from pyomo_fesd.core.changes import Arrival, Change, Coincidence, Option, Place, Toggle
from pyomo_fesd.core.complementarity import Mixed, Pair, distance_to_bound, read_complementarity, read_side
from pyomo_fesd.core.errors import FesdError
from pyomo_fesd.core.evaluation import (
    kept_values,
    known_sign,
    mutable_parameters,
    number_of,
    numbers_of,
    value_or_nan,
    value_or_zero,
    variables_that_count,
)
from pyomo_fesd.core.expression_key import component_key, exchanged, expression_key
from pyomo_fesd.core.fresh_data import make_data
from pyomo_fesd.core.generated import GENERATED, is_generated, public_name, source_name
from pyomo_fesd.core.gradient import gradient
from pyomo_fesd.core.gradients import gradients
from pyomo_fesd.core.grid import (
    ONE_ELEMENT_SCHEMES,
    Element,
    Grid,
    finest_resolution,
    label_decimals,
    numbers_of_elements,
    read_grid,
    share_elements,
    with_points,
)
from pyomo_fesd.core.held_controls import held_controls
from pyomo_fesd.core.homotopy_hints import (
    BranchConstraint,
    DriftSides,
    Filling,
    Follower,
    HomotopyHints,
    ImpactSides,
    NeighbourBranch,
    Penalty,
    StickingSides,
    all_hints,
    homotopy_hints,
)
from pyomo_fesd.core.insertion import VariableMaker, add_copies, insert
from pyomo_fesd.core.instants import Instant
from pyomo_fesd.core.interpolation import interpolation_weights
from pyomo_fesd.core.interruption import DeferredInterrupt, interrupt_handled, interruptible
from pyomo_fesd.core.keywords import check_keywords, read_keywords
from pyomo_fesd.core.moving_grid import MovingGrid, Split, add_moving_grid, moving_grids
from pyomo_fesd.core.node_search import contains_node, leaves_of
from pyomo_fesd.core.own_data import (
    count_of,
    data_of,
    declared,
    entries_of,
    own_blocks,
    own_components,
    own_data,
    variables_below,
)
from pyomo_fesd.core.parts import Part
from pyomo_fesd.core.paused_collection import paused_collection
from pyomo_fesd.core.phase import phase
from pyomo_fesd.core.positive_part import add_part_of_number, add_positive_part, declare_positive_part
from pyomo_fesd.core.private_data import records_below, remember_records
from pyomo_fesd.core.renamed import Renamed
from pyomo_fesd.core.rollback import restored, restored_on_error
from pyomo_fesd.core.smallest import add_smallest, declare_smallest, start_smallest
from pyomo_fesd.core.stamp import Stamp
from pyomo_fesd.core.step import add_step, declare_step, start_step
from pyomo_fesd.core.structural_key import StructuralKey, any_number, exactly, nine_digits, variables_of
from pyomo_fesd.core.sums import product_of, sum_of, weighted_sum
from pyomo_fesd.core.switched_systems import (
    Contact,
    Dependents,
    HysteresisMode,
    Reset,
    Step,
    Surface,
    SwitchedSystems,
    TimeWriter,
    add_writer,
    all_switched_systems,
    integrand_rewriter,
    signal_breakpoints,
    signals,
    switched_systems,
    write_at_further_times,
)
from pyomo_fesd.core.time_index import (
    TimeIndex,
    ancestry,
    continuous_sets,
    derivatives,
    discretised,
    find_continuous_set,
    index_sets,
    index_tuple,
    is_discretisation_equation,
    is_indexed_by,
    refuse_foreign,
    refuse_no_model,
    stored_index,
    strip_time,
)
from pyomo_fesd.core.turns import REDIRECTION, TRANSFORMATION
from pyomo_fesd.core.units_of_measure import divided_by, in_unit_of, time_unit, unit_of, without_unit
from pyomo_fesd.core.version import __version__
from pyomo_fesd.core.withheld_messages import withheld_messages
