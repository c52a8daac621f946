"""``fesd.finite_elements``: collocation on elements whose boundaries find the switches."""

from pyomo.common.config import ConfigDict, ConfigValue, In, NonNegativeFloat, PositiveInt, document_class_CONFIG
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, Transformation, TransformationFactory
from pyomo.gdp import Disjunction

from pyomo_fesd import marks, records
from pyomo_fesd.elements.controls import check_controls, hold_controls
from pyomo_fesd.elements.cross import (
    FORMS,
    add_cross_complementarity,
    read_families,
    set_grid,
    sources,
    warn_gauss_on_curved_surfaces,
)
from pyomo_fesd.elements.equilibration import MODES, add_equilibration
from pyomo_fesd.elements.expansion import discretise
from pyomo_fesd.elements.explicit_time import warn_explicit_time
from pyomo_fesd.elements.grid import check_resolution, read_grid
from pyomo_fesd.elements.jumps import add_jumps, check_guards, read_jumps
from pyomo_fesd.elements.lengths import add_lengths, check_orders, multiply_derivatives
from pyomo_fesd.elements.memory import add_memory, read_modes
from pyomo_fesd.elements.moves import add_moves
from pyomo_fesd.elements.quadrature import integrals, integrand, rebuild
from pyomo_fesd.elements.restore import restored_on_error
from pyomo_fesd.elements.right_limits import RightLimits
from pyomo_fesd.errors import FesdError
from pyomo_fesd.timeindex import TimeIndex, discretised, find_continuous_set


def _gamma(arg):
    """gamma, with 0 <= gamma < 1."""
    gamma = float(arg)
    if not 0 <= gamma < 1:
        raise ValueError(f"length_bounds (gamma) must lie in [0, 1), not {arg}")
    return gamma


def _components(arg):
    return list(arg) if isinstance(arg, (list, tuple)) else [arg]


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
    Where the complementarities come from does not matter: ``fesd.dcs``, or the user's own ``Complementarity`` over time.

    The points that the ContinuousSet has before are boundaries of control stages: they keep their physical time, and each
    stage gets the same number of elements.  On a model that is discretised already, the present grid is made movable.

    Raises
    ------
    FesdError
        naming the component, the cause and the fix; the model is then as it was.

    Source: paper, eq. (8)-(10); Baumrucker and Biegler (2009); Nurkanovic et al. (2024).
    """

    CONFIG = ConfigDict('fesd.finite_elements')
    CONFIG.declare('wrt', ConfigValue(description="the ContinuousSet of time; may be left out if there is only one"))
    CONFIG.declare('nfe', ConfigValue(default=10, domain=PositiveInt, description="number of finite elements, all stages together"))
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
            description="gamma of eq. (10): |h_n - hbar_n| <= gamma hbar_n in the homotopy; the branch keeps the lower bound only",
        ),
    )
    CONFIG.declare(
        'piecewise_constant',
        ConfigValue(default=[], domain=_components, description="controls (Vars over time) held constant on each stage"),
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
        self._check(instance, wrt, config)
        with restored_on_error(instance, wrt):
            stages = self._discretise(instance, wrt, config)
            grid = read_grid(wrt, stages)
            check_orders(instance.model(), wrt)
            families = read_families(instance, wrt, config.piecewise_constant, config.continuous)
            modes, jumps = read_modes(instance.model(), wrt), read_jumps(instance.model(), wrt)
            check_guards(jumps, config.piecewise_constant)
            waiting = next(_active_disjunctions(instance, wrt), None)
            if waiting is not None and not (families or modes or jumps):
                raise FesdError(
                    waiting, "an active Disjunction over time", "apply fesd.dcs first: its complementarity finds the switches"
                )
            integrands = [(i, integrand(i)) for i in integrals(instance.model(), wrt)]
            warn_explicit_time(instance, wrt, grid, integrands)
            if not grid.right_is_stage:
                warn_gauss_on_curved_surfaces(families)

            block = self._block(instance, wrt)
            set_grid(block, grid)
            add_lengths(block, grid, config.length_bounds)
            for integral, rule in integrands:
                rebuild(integral, rule, block, grid)
            hold_controls(block, config.piecewise_constant, grid, wrt)
            multiply_derivatives(instance.model(), wrt, block, grid)
            add_jumps(block, jumps, grid, wrt)
            limits = RightLimits(block, jumps, grid, wrt, config.piecewise_constant, config.continuous)
            families = list(map(limits.family, families))
            add_memory(block, modes, limits, grid, wrt)
            add_cross_complementarity(block, families, grid, wrt, config.cross_complementarity)
            if families or modes or jumps:
                add_equilibration(block, families, modes, grid, config.equilibration, config.rho)
                add_moves(block, families, modes, jumps, grid)
            else:
                block.r.fix(1)

    @staticmethod
    def _check(instance, wrt, config):
        if wrt in records.records(instance).grids:
            raise FesdError(wrt, "its elements are movable already", "apply fesd.finite_elements once for each ContinuousSet")
        check_controls(config.piecewise_constant, wrt)
        if discretised(wrt):
            return
        if config.stages is not None:
            raise FesdError(
                wrt, "stages= was given for a set that is not discretised yet", "put the stage boundaries into the ContinuousSet"
            )
        stages = len(wrt) - 1
        if config.nfe % stages:
            raise FesdError(
                wrt,
                f"nfe={config.nfe} elements cannot be shared equally among {stages} control stages",
                f"take a multiple of {stages}",
            )
        check_resolution(wrt, config.nfe, config.ncp)

    @staticmethod
    def _discretise(instance, wrt, config):
        """Lay the grid if there is none, finish what waited for it; return the stage boundaries."""
        if discretised(wrt):
            stages = sorted({wrt.first(), wrt.last(), *(config.stages or ())})
        else:
            stages = list(wrt)
            discretise(instance, wrt, config.nfe, config.ncp, config.scheme)
        records.repeat(instance, wrt)
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
        """The length multipliers r_n = h_n/hbar_n (an IndexedVar over 1..N) of a moving grid."""
        return records.records(wrt).grids[wrt].r
