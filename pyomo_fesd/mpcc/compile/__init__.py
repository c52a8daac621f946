"""Compile a Pyomo model into functions: ``compile_mpcc(read_mpcc(model), timer)``.

Read in this order: ``read_mpcc`` (the model as pairs, decisions and hints), ``compile`` (the way through the NL file),
``parameters`` (symbols for values that may change), ``auxiliary_rows`` (rows for sides and terms), ``nl_file``, ``nl_index`` (where
the file has each of them), ``round_off`` (constants in which fixed values cancel), ``scaling``, ``sizes`` and ``natural_units``
(factors from the model's own numbers), ``assemble``, ``model_values`` (bounds and starts), ``mpcc_functions`` (the result),
``derivatives`` (chain rule for all NLPs), ``staleness`` (changes of the model after it was compiled).
"""

from pyomo_fesd.mpcc.compile.assemble import NATURAL_UNITS
from pyomo_fesd.mpcc.compile.compile import compile_mpcc
from pyomo_fesd.mpcc.compile.derivatives import Outer, automatic, composed
from pyomo_fesd.mpcc.compile.model_values import Contradiction, start_value
from pyomo_fesd.mpcc.compile.mpcc_functions import csr_pattern, take
from pyomo_fesd.mpcc.compile.parameters import parameter_data
from pyomo_fesd.mpcc.compile.read_mpcc import read_mpcc
from pyomo_fesd.mpcc.compile.staleness import Snapshot
