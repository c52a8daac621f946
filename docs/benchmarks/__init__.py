"""Benchmark studies of pyomo_fesd, one folder each; run one from the root of the repository:

    python docs/benchmarks/STUDY/run.py

A folder holds ``run.py``, the modules that it needs, the measured rows (``rows.csv``, one row a run), the table and picture made of
them (``summary.csv``, ``summary.png``) and a page (``index.rst``).  ``common`` holds helpers of several studies.

Modules import one another by their full names, such as ``benchmarks.scale.cascade``.  A script first puts ``docs`` on the path;
importing this package puts the repository, its examples and the problems of its tests there.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / 'examples'), str(ROOT / 'tests')]
