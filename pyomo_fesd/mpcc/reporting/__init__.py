"""Reports of a run: to Pyomo, to a log, to a callback and to a file.

Read in this order: ``pyomo_results`` (Pyomo's results and the loader of values), ``log_table`` (the log of ``tee=True``),
``progress`` (for a callback), ``run_record`` (the JSON file), ``output_files`` (files that cannot be written).
"""

from pyomo_fesd.mpcc.reporting.log_table import LogTable, StartsTable, log_streams
from pyomo_fesd.mpcc.reporting.progress import reporter
from pyomo_fesd.mpcc.reporting.pyomo_results import Loader, fill_results
from pyomo_fesd.mpcc.reporting.run_record import RunRecord
