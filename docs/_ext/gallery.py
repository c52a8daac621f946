"""The gallery: pages with code, output and picture, which sphinx-gallery makes from ``examples/``.

An example draws with matplotlib's ``Figure`` and writes a PNG file into the working folder. ``PngScraper`` collects that file.
The IDAES examples need idaes-pse and more than a minute together, so the build does not run them: their pages and thumbnails show
the pictures in ``docs/_static/examples``. To make these pictures again: ``cd docs/_static/examples`` and run the examples there.
"""

import shutil
from pathlib import Path

from sphinx_gallery.scrapers import figure_rst

NEEDS_IDAES = 'idaes_'
ORDER = (
    'signum',
    'gas_liquid_tank',
    'thermostat',
    'bouncing_ball',
    'saturating_valve',
    'flash',
    'pump_curve',
    'batch_reactor',
    'gene_network',
    'oscillator',
    'gearbox_car',
    'mpc_tank',
    'mpc_heater',
    'projected_ellipse',
    'toy_mpec',
    'valve_schedule',
    'two_stage_tank',
    'idaes_overflow',
    'idaes_two_tanks',
    'idaes_level',
    'idaes_relief',
    'idaes_boiling',
    'idaes_startup',
    'idaes_mpc',
)
NOT_RUN = """.. image:: /_static/examples/{name}.png
   :alt: picture drawn by {name}.py
   :class: sphx-glr-single-img

*The docs build does not run this example, since it needs* ``idaes-pse``\\ *; the tests do. The picture is from an earlier run of
about {seconds} seconds.*

"""
#: Run time of the examples that the build does not run, with all imports, on a busy machine with two cores.
SECONDS = {
    'idaes_overflow': 16,
    'idaes_two_tanks': 18,
    'idaes_level': 33,
    'idaes_relief': 16,
    'idaes_boiling': 14,
    'idaes_startup': 36,
    'idaes_mpc': 100,
}
CODE = '.. code-block:: Python\n'


class Order:
    """Sort key: simple examples first, IDAES last; an example that ``ORDER`` does not name comes at the end."""

    def __init__(self, source_folder):
        """``source_folder`` is what sphinx-gallery passes to every sort key."""

    def __call__(self, filename):
        """Position of an example file in the gallery."""
        name = Path(filename).stem
        return (ORDER.index(name) if name in ORDER else len(ORDER), name)


class PngScraper:
    """Image scraper of sphinx-gallery: the PNG file of the example's own name that the example has written beside itself."""

    def __repr__(self):
        """Sphinx compares configurations by their text."""
        return 'PngScraper'

    def __call__(self, block, block_vars, gallery_conf):
        """Move the picture into the gallery; returns the reStructuredText that shows it."""
        written = Path(block_vars['src_file']).with_suffix('.png')
        if not written.exists():
            return ''
        shown = next(block_vars['image_path_iterator'])
        shutil.move(written, shown)
        return figure_rst([shown], gallery_conf['src_dir'])


def provide_thumbnails(app):
    """Copy the committed pictures to where sphinx-gallery looks for the first picture of an example to make its thumbnail."""
    source, images = Path(app.srcdir) / '_static' / 'examples', Path(app.srcdir) / 'gallery' / 'images'
    images.mkdir(parents=True, exist_ok=True)
    for picture in source.glob(f'{NEEDS_IDAES}*.png'):
        shutil.copy(picture, images / f'sphx_glr_{picture.stem}_001.png')


def show_committed_picture(app, docname, source):
    """Insert the committed picture before the code of an example that the build does not run."""
    folder, _, name = docname.partition('/')
    if folder == 'gallery' and name.startswith(NEEDS_IDAES):
        source[0] = source[0].replace(CODE, NOT_RUN.format(name=name, seconds=SECONDS[name]) + CODE, 1)


def setup(app):
    """Register with Sphinx."""
    app.connect('builder-inited', provide_thumbnails, priority=400)  # before sphinx-gallery
    app.connect('source-read', show_committed_picture)
    return {'parallel_read_safe': True}
