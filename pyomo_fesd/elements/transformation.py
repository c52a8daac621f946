"""``fesd.finite_elements``: collocation on elements whose boundaries find the switches."""

from pyomo.common.config import ConfigDict, ConfigValue, In, NonNegativeFloat, PositiveInt, document_class_CONFIG
from pyomo.common.gc_manager import PauseGC
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, Transformation, TransformationFactory
from pyomo.gdp import Disjunction
from pyomo.mpec.complementarity import ComplementarityData

from pyomo_fesd import marks, records
from pyomo_fesd.elements.continuity import check_told, inner_label, read_continuity
from pyomo_fesd.elements.controls import check_controls, fix_given, hold_controls
from pyomo_fesd.elements.cross import FORMS, add_cross_complementarity, set_grid, sources
from pyomo_fesd.elements.equilibration import MODES, add_equilibration
from pyomo_fesd.elements.exits import add_exits
from pyomo_fesd.elements.expansion import discretise
from pyomo_fesd.elements.explicit_time import warn_explicit_time
from pyomo_fesd.elements.families import (
    conditions_over_time,
    read_families,
    refuse_lists_of_times,
    warn_gauss_on_curved_surfaces,
)
from pyomo_fesd.elements.free_time import check_free_time, factors
from pyomo_fesd.elements.grid import check_resolution, read_grid, share_elements
from pyomo_fesd.elements.jumps import add_jumps, check_guards, read_jumps
from pyomo_fesd.elements.lengths import add_lengths, check_orders, multiply_derivatives
from pyomo_fesd.elements.memory import add_memory, read_modes
from pyomo_fesd.elements.mixed import split_mixed
from pyomo_fesd.elements.moves import add_moves
from pyomo_fesd.elements.quadrature import integrals, integrand, rebuild
from pyomo_fesd.elements.restore import restored_on_error
from pyomo_fesd.elements.right_limits import RightLimits
from pyomo_fesd.elements.space import refuse_waiting_space
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import TimeIndex, discretised, find_continuous_set


def _gamma(arg):
    """gamma, with 0 <= gamma < 1."""
    gamma = float(arg)
    if not 0 <= gamma < 1:
        raise ValueError(f"length_bounds (gamma) must lie in [0, 1), not {arg}")
    return gamma


def _numbers(arg):
    """A positive integer, or a list of them."""
    return [PositiveInt(n) for n in arg] if isinstance(arg, (list, tuple)) else PositiveInt(arg)


def _components(arg):
    return list(arg) if isinstance(arg, (list, tuple)) else [arg]


def _lengths(arg):
    """Vars in the order of the stages, from a list or an indexed Var."""
    return None if arg is None else list(arg.values() if hasattr(arg, 'values') else arg)


def _holder(block, wrt):
    """``block``, or the block of a time that stands above it (a flowsheet within a flowsheet): all over one time moves together."""
    parent = wrt.parent_block()
    while parent is not None and parent is not block:
        parent = parent.parent_block()
    return wrt.parent_block() if parent is None else block


def _active_disjunctions(block, wrt):
    times = TimeIndex(wrt)
    found = block.component_data_objects(Disjunction, active=True, descend_into=Block)
    return (d for d in found if times.time(d) is not None)


@TransformationFactory.register('fesd.finite_elements', doc="Finite elements with switch detection, on top of pyomo.dae")
@document_class_CONFIG(methods=['apply_to', 'create_using'])
class FiniteElements(Transformation):
    """Discretise by collocation with variable element lengths h_n that find the switches (theory, eq. 9-13).

    pyomo.dae discretises; then every discretisation equation gets the multiplier r_n = h_n/hbar_n, the complementarities over
    time are aggregated over each element (eq. 11), and step equilibration ties the lengths where nothing switches (eq. 13).
    Where the complementarities come from does not matter: ``fesd.dcs``, or the user's own ``Complementarity`` over time; one with
    two bounds on one side becomes two pairs.

    The points that the ContinuousSet has before are boundaries of control stages: they keep their physical time, and each
    stage gets the same number of elements, unless ``nfe`` lists others.  The final time, or the length of each stage, may be a
    variable.  On a model that is discretised already, the present grid is made movable.

    Raises
    ------
    FesdError
        naming the component, the cause and the fix; the model is then as it was.

    Source: paper, eq. (8)-(10); Baumrucker and Biegler (2009); Nurkanovic et al. (2024).
    """

    CONFIG = ConfigDict('fesd.finite_elements')
    CONFIG.declare('wrt', ConfigValue(description="the ContinuousSet of time; may be left out if there is only one"))
    CONFIG.declare(
        'nfe',
        ConfigValue(
            default=10,
            domain=_numbers,
            description="number of finite elements, all stages together; or a list with one number for each stage",
        ),
    )
    CONFIG.declare('ncp', ConfigValue(default=3, domain=PositiveInt, description="collocation points in each element (K)"))
    CONFIG.declare(
        'scheme',
        ConfigValue(
            default='LAGRANGE-RADAU',
            domain=In(['LAGRANGE-RADAU', 'LAGRANGE-LEGENDRE']),
            description="'LAGRANGE-RADAU' (order 2K-1, L-stable) or 'LAGRANGE-LEGENDRE' (order 2K)",
        ),
    )
    CONFIG.declare(
        'cross_complementarity',
        ConfigValue(default='element', domain=In(list(FORMS)), description="'element' (eq. 11a), 'stage' (11b) or 'full' (11c)"),
    )
    CONFIG.declare(
        'equilibration',
        ConfigValue(
            default='two_stage',
            domain=In(list(MODES)),
            description="'two_stage' (eq. 13), 'complementarity' (the paper's 10d), 'penalty' (lengths nearly equal) or 'none'",
        ),
    )
    CONFIG.declare(
        'rho',
        ConfigValue(
            default=1e-2,
            domain=NonNegativeFloat,
            description="weight of the length penalty sum (h_n/hbar_n - 1)**2 that guides the homotopy (eq. 13); "
            "small against the objective, never part of the reported one",
        ),
    )
    CONFIG.declare(
        'length_bounds',
        ConfigValue(
            default=0.9,
            domain=_gamma,
            description="gamma of eq. (10): |h_n - hbar_n| <= gamma hbar_n in the homotopy; a branch has shorter and longer ones",
        ),
    )
    CONFIG.declare(
        'piecewise_constant',
        ConfigValue(
            default=[],
            domain=_components,
            description="inputs (Vars or mutable Params over time) that are constant on each stage; the value at its end counts",
        ),
    )
    CONFIG.declare(
        'continuous',
        ConfigValue(
            default=[],
            domain=_components,
            description="algebraic Vars over time that are continuous although no equation says so; states need not be named",
        ),
    )
    CONFIG.declare(
        'final_time',
        ConfigValue(
            default=None,
            description="a Var: how long the horizon lasts, whatever its labels; the plant stays written in its own time",
        ),
    )
    CONFIG.declare(
        'stage_lengths',
        ConfigValue(default=None, domain=_lengths, description="the same for each control stage: one Var for each"),
    )
    CONFIG.declare(
        'stages',
        ConfigValue(
            default=None,
            domain=list,
            description="labels of inner control-stage boundaries, only for a model that is discretised already",
        ),
    )

    def _apply_to(self, instance, **kwds):
        config = self.CONFIG(kwds.pop('options', {}))
        config.set_value(kwds)
        wrt = find_continuous_set(instance, config.wrt, 'fesd.finite_elements')
        instance = _holder(instance, wrt)
        self._check(instance, wrt, config)
        with restored_on_error(instance, wrt), PauseGC():
            stages, times = self._discretise(instance, wrt, config), TimeIndex(wrt)
            grid = read_grid(wrt, stages)
            fix_given(config.piecewise_constant, grid, wrt)
            records.repeat(instance, wrt)
            check_orders(instance.model(), wrt)
            sigma = factors(config.final_time, config.stage_lengths, stages)
            block = self._block(instance, wrt)
            set_grid(block, grid)
            add_lengths(block, grid, config.length_bounds, sigma)
            integrands = [(i, integrand(i, wrt)) for i in integrals(instance.model(), wrt)]
            for integral, rule in integrands:
                # first of all: functions in pieces inside an integrand have conditions of their own
                rebuild(integral, rule, block, grid)
            warn_explicit_time(instance, wrt, grid, integrands)

            pairs, mixed = conditions_over_time(instance, times)
            modes, jumps = read_modes(instance.model(), wrt), read_jumps(instance.model(), wrt)
            check_guards(jumps, config.piecewise_constant)
            self._refuse_waiting(instance, wrt, pairs or mixed or modes or jumps)
            conditions = [*pairs.values(), *mixed.values(), *(m.conditions for m in modes), *(j.guards for j in jumps)]
            continuity = self._continuity(instance, times, conditions, grid, config)
            families = read_families(pairs | split_mixed(mixed, continuity, times), continuity, times)
            if not grid.right_is_stage:
                warn_gauss_on_curved_surfaces(families, continuity, times)

            hold_controls(block, config.piecewise_constant, grid, wrt)
            multiply_derivatives(instance.model(), wrt, block, grid)
            add_jumps(block, jumps, grid, wrt)
            limits = RightLimits(block, jumps, grid, times, continuity, [*config.piecewise_constant, *config.continuous])
            families = list(map(limits.family, families))
            add_memory(block, modes, limits, grid, wrt)
            add_cross_complementarity(block, families, grid, wrt, config.cross_complementarity)
            if families or modes or jumps:
                add_equilibration(block, families, modes, grid, config.equilibration, config.rho)
                if config.equilibration == 'two_stage':
                    add_exits(block, families, grid)
                add_moves(block, families, modes, jumps, grid)
            else:
                block.r.fix(1)

    @staticmethod
    def _check(instance, wrt, config):
        if wrt in records.records(instance).grids:
            raise FesdError(wrt, "its elements are movable already", "apply fesd.finite_elements once for each ContinuousSet")
        check_controls(config.piecewise_constant, wrt)
        check_told(config.continuous, config.piecewise_constant, wrt)
        check_free_time(config.final_time, config.stage_lengths, wrt)
        refuse_lists_of_times(instance, TimeIndex(wrt))
        refuse_waiting_space(instance.model(), wrt)
        if discretised(wrt):
            return
        if config.stages is not None:
            raise FesdError(
                wrt, "stages= was given for a set that is not discretised yet", "put the stage boundaries into the ContinuousSet"
            )
        check_resolution(wrt, share_elements(wrt, config.nfe), config.ncp)

    @staticmethod
    def _refuse_waiting(instance, wrt, conditions):
        """A Disjunction that nobody transformed would hold nothing; beside other conditions it may be there on purpose."""
        waiting = next(_active_disjunctions(instance, wrt), None)
        if waiting is not None and not conditions:
            raise FesdError(
                waiting, "an active Disjunction over time", "apply fesd.dcs first: its complementarity finds the switches"
            )

    @staticmethod
    def _continuity(instance, times, families, grid, config):
        """What is continuous where the families begin, by the equations there if they can matter."""
        labels = {inner_label(family, times.wrt) for family in families}
        found = (condition for family in families for condition in family.values())
        written = not all(isinstance(c, ComplementarityData) and marks.is_generated(c) for c in found)
        trace = written or (bool(families) and (len(grid.stages) > 1 or not grid.right_is_stage))
        return read_continuity(instance.model(), times, labels, config.piecewise_constant, config.continuous, trace)

    @staticmethod
    def _discretise(instance, wrt, config):
        """Lay the grid if there is none; return the stage boundaries."""
        if discretised(wrt):
            return sorted({wrt.first(), wrt.last(), *(config.stages or ())})
        stages, shares = list(wrt), share_elements(wrt, config.nfe)
        discretise(instance, wrt, shares, config.ncp, config.scheme, config.piecewise_constant)
        return stages

    @staticmethod
    def _block(instance, wrt):
        """A new block for everything that belongs to the grid, announced in the model's records."""
        block = Block()
        instance.add_component(unique_component_name(instance, marks.GENERATED + 'elements_' + wrt.local_name), block)
        records.records(instance).grids[wrt] = block
        return block

    def get_src_complementarity(self, pair):
        """The conditions over time that an aggregated pair of ``cross`` stands for."""
        return sources(pair.parent_block())[pair]

    def get_element_lengths(self, wrt):
        """The length multipliers r_n = h_n/hbar_n (an IndexedVar over 1..N) of a moving grid, both lengths in labels."""
        return records.records(wrt).grids[wrt].r
