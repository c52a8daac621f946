"""Compile a Pyomo model into functions: ``compile_mpcc(read_mpcc(model), timer)``.

Read in this order: ``read_mpcc`` (the model as pairs, decisions and hints), ``compile`` (the way through this room),
``parameters`` (symbols for values that may change), ``row_reader`` (expressions as rows) with ``unreadable`` (its errors),
``entries`` (sides, decisions, terms as rows), ``nonlinear_parts`` (their canonical form), ``round_off`` (constants in which fixed
values cancel), ``model_rows`` (all of it), ``grouped_rows`` (classes of equal form), ``row_classes`` with ``elementwise`` and
``row_functions`` (values and derivatives), ``scaling``, ``sizes`` and ``natural_units`` (factors from the model's own numbers),
``assemble``, ``hint_indices`` with ``arrival_indices`` (hints by positions), ``scaled_functions``, ``model_values`` (bounds and
starts), ``mpcc_data`` and ``mpcc_functions`` (the result) with ``numeric_function``, ``stacked_jacobian`` and ``sparse_entries``
(evaluated quickly), ``derivatives`` (chain rule for all NLPs), ``staleness`` (changes of the model after compiling), ``nl_file``
(a file to keep).
"""

from pyomo_fesd.mpcc.compile.assemble import NATURAL_UNITS
from pyomo_fesd.mpcc.compile.casadi_matrices import csr_pattern, take
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.derivatives import Derivatives, Outer, automatic, composed, plain_nlp, with_parts
from pyomo_fesd.mpcc.compile.last_points import LastPoints
from pyomo_fesd.mpcc.compile.model_values import Contradiction, start_value
from pyomo_fesd.mpcc.compile.parameters import parameter_data
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.compile.scaling import side_factors
from pyomo_fesd.mpcc.compile.sizes import beside, certain_constants, row_factors, variable_factors, without_small
from pyomo_fesd.mpcc.compile.sparse_entries import largest_entries, major_index, with_entries
from pyomo_fesd.mpcc.compile.staleness import Snapshot
