"""Sphinx configuration: ``sphinx-build docs docs/_build``.

Nothing is loaded from a network: MathJax comes from the package sphinx-mathjax-offline and is copied into the pages.
"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
EXAMPLES = HERE.parent / 'examples'
sys.path[:0] = [str(HERE / '_ext'), str(HERE.parent), str(EXAMPLES)]

from gallery import NEEDS_IDAES, PngScraper  # noqa: E402

import pyomo_fesd  # noqa: E402

project = 'pyomo_fesd'
version = release = pyomo_fesd.__version__
copyright = 'The pyomo_fesd authors, BSD-3-Clause'
html_title = f'{project} {version}'
html_theme = 'furo'
html_static_path = ['_static']
html_css_files = ['custom.css']
exclude_patterns = ['_build', 'gallery/GALLERY_HEADER.rst', 'sg_execution_times.rst']
extensions = [
    'sphinx.ext.autodoc',
    'sphinx.ext.mathjax',
    'sphinx-mathjax-offline',
    'sphinx.ext.napoleon',
    'sphinx_gallery.gen_gallery',
    'docstrings',
    'gallery',
    'options_table',
    'run_python',
    'test_links',
]
autodoc_member_order = 'bysource'
sphinx_gallery_conf = {
    'examples_dirs': str(EXAMPLES),
    'gallery_dirs': 'gallery',  # generated, in .gitignore
    'backreferences_dir': 'gallery/backreferences',
    'doc_module': ('pyomo_fesd',),
    'filename_pattern': rf'examples/(?!{NEEDS_IDAES})',
    'ignore_pattern': r'__init__',
    'within_subsection_order': 'gallery.Order',
    'image_scrapers': (PngScraper(),),
    'abort_on_example_error': True,
    'notebook_extensions': set(),
    'download_all_examples': False,
    'write_computation_times': False,
    'reset_modules': (),
    'inspect_global_variables': False,
    'show_signature': False,
    'remove_config_comments': True,
}
