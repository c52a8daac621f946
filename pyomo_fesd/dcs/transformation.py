"""``fesd.dcs``: replace Disjunctions and piecewise functions over time by a dynamic complementarity system."""

from pyomo.common.collections import ComponentMap, ComponentSet
from pyomo.common.config import ConfigDict, ConfigValue, In, document_class_CONFIG
from pyomo.core import Transformation, Var
from pyomo.core.util import target_list

from pyomo_fesd.core import (
    TRANSFORMATION,
    FesdError,
    Renamed,
    add_writer,
    find_continuous_set,
    read_keywords,
    restored_on_error,
    switched_systems,
)
from pyomo_fesd.dcs.piecewise import replacement_of
from pyomo_fesd.dcs.reading import enclosing_disjunct
from pyomo_fesd.dcs.source_maps import replaced_components, source_maps
from pyomo_fesd.dcs.writer import FORMS, DcsWriter

#: Keywords and values of version 0.1.
RENAMED = Renamed('fesd.dcs', keywords={'memory': 'hysteresis'}, values={'form': {'two_mode': 'heaviside'}})


def _as_list(given) -> list:
    return list(given) if isinstance(given, (list, tuple)) else [given]


def _refuse_other_than_vars(defines) -> None:
    for v in defines:
        if getattr(v, 'ctype', None) is not Var:
            name = getattr(v, 'name', repr(v))
            raise FesdError(name, "fesd.dcs: 'defines' must name Vars, one or a list of them", "give m.q, or [m.q, m.p]")


@document_class_CONFIG(methods=['apply_to', 'create_using'])
class DynamicComplementaritySystem(Transformation):
    """Replace every Disjunction over time by the Filippov multipliers of its modes (theory, eq. 2-7).

    For a Disjunction with modes i, regions R_i (its inequalities) and equations that define variables v (its equalities),

        v = sum_i nu_i f_i,   sum_i nu_i = 1,   nu_i >= 0,   nu_i = 0 outside the closure of R_i

    with the conditions on nu as complementarity in the smallest form that applies: eq. (3), or eq. (5) and (6).  An equation that
    all modes share is not blended; a mode that is deactivated leaves nothing; a single remaining mode is imposed as it is.  Nested
    Disjunctions are one system, whose modes are the paths down to an innermost disjunct.  LogicalConstraints over time between the
    indicators of modes deactivate modes, or become pairs that exclude combinations.

    Piecewise functions over time (``Piecewise``, ``PiecewiseLinearFunction``, ``Expr_if``) become complementarity too, by eq. (8)
    where they are continuous and by eq. (5) where they jump.

    Applies to a model before and after discretisation.  On a model that is not discretised yet, ``fesd.finite_elements`` continues
    with the times that it adds.

    Raises
    ------
    FesdError
        naming the component, the cause and the fix; the model is then unchanged.

    Source: paper, eq. (2)-(6); Stewart (1990); Nurkanovic and Diehl (2022).
    """

    CONFIG = ConfigDict('fesd.dcs')
    CONFIG.declare(
        'targets',
        ConfigValue(domain=target_list, description="Blocks or Disjunctions to transform; default: the whole model"),
    )
    CONFIG.declare('wrt', ConfigValue(description="the ContinuousSet of time; may be left out if there is only one"))
    CONFIG.declare(
        'form',
        ConfigValue(
            default='auto',
            domain=In(['auto', *FORMS]),
            description="'stewart' (eq. 3), 'heaviside' (eq. 5 and 6), or 'auto': the smallest that applies",
        ),
    )
    CONFIG.declare(
        'hysteresis',
        ConfigValue(
            default=[],
            domain=target_list,
            description="Disjunctions (or Blocks with Disjunctions) with hysteresis: where regions overlap the last mode goes on; "
            "fix the indicator of the mode that is active at the first time",
        ),
    )

    CONFIG.declare(
        'defines',
        ConfigValue(
            default=[],
            domain=_as_list,
            description="Vars that the modes define, where their equations could be solved for others too: q of q**2 == k*p",
        ),
    )

    def _apply_to(self, instance, **kwds):
        RENAMED.refuse(kwds)
        config = read_keywords(self.CONFIG, kwds, 'fesd.dcs')
        _refuse_other_than_vars(config.defines)
        wrt = find_continuous_set(instance, config.wrt, 'fesd.dcs')
        writer = DcsWriter(instance, wrt, config.targets, config.form, config.hysteresis, config.defines)
        with TRANSFORMATION, restored_on_error(instance):
            writer.write()
            add_writer(writer)

    # Pyomo's names for the reverse maps

    def get_src_disjunction(self, component):
        """Return the DisjunctionData that a generated constraint or complementarity came from."""
        return source_maps(component.parent_block()).disjunction[component]

    def get_src_disjunct(self, component):
        """Return the DisjunctData whose multiplier a generated complementarity holds.

        Raises
        ------
        KeyError
            for a step variable of the Heaviside form that is not the multiplier of a single mode
        """
        return source_maps(component.parent_block()).disjunct[component]

    def get_src_constraint(self, component) -> list:
        """Return the constraints of the disjuncts that a generated constraint blends, one or more for each mode.

        For a pair that excludes modes, the LogicalConstraint behind it; for a constraint that replaces a Piecewise or a constraint
        with piecewise functions, the replaced component.
        """
        sources = source_maps(component.parent_block()).sources[component]
        return [origin for source in sources for origin in replaced_components(source) or [source]]

    def get_transformed_constraints(self, constraint) -> list:
        """Return the generated constraints that replace a ``constraint`` of a disjunct, or one with piecewise functions."""
        replacement = replacement_of(constraint)
        inside = constraint if replacement is None else replacement
        disjunct = enclosing_disjunct(inside)
        if disjunct is None:
            return [] if replacement is None else [replacement]
        block = disjunct.transformation_block
        return [] if block is None else source_maps(block).replacements.get(inside, [])

    def get_multipliers(self, disjunction) -> ComponentMap:
        """Return the multipliers nu of a transformed DisjunctionData: DisjunctData -> expression."""
        blocks = ComponentSet(d.transformation_block for d in disjunction.disjuncts if d.transformation_block is not None)
        found = ComponentMap(item for block in blocks for item in switched_systems(block).multipliers.items())
        return ComponentMap((d, found[d]) for d in disjunction.disjuncts if d in found)
