"""Many scenarios of one model, rows in and rows out: ``sweep``.

Read in this order: ``sweep`` (what a user calls), ``scenario`` (one row, here or in another process), ``results_file`` (rows on
disk, by which a sweep that was killed goes on) and ``progress_bar``.
"""

from pyomo_fesd.scenarios.sweep import sweep
