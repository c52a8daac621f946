"""Sphinx configuration: ``sphinx-build docs docs/_build``."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / '_ext'), str(HERE.parent), str(HERE.parent / 'examples')]

import pyomo_fesd  # noqa: E402

project = 'pyomo_fesd'
version = release = pyomo_fesd.__version__
copyright = 'The pyomo_fesd authors, BSD-3-Clause'
html_title = f'{project} {version}'
html_theme = 'furo'
exclude_patterns = ['_build']
extensions = [
    'sphinx.ext.autodoc',
    'sphinx.ext.mathjax',
    'sphinx.ext.napoleon',
    'docstrings',
    'if_exists',
    'options_table',
    'run_python',
]
autodoc_member_order = 'bysource'
