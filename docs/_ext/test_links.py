"""``:test:`text <test_name.py>```: a link to a file in any folder of ``tests/``, found by its name or by a part of its path."""

from pathlib import Path

from sphinx import addnodes
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxRole
from sphinx.util.nodes import split_explicit_title

TESTS = Path(__file__).parents[2] / 'tests'


class TestRole(SphinxRole):
    """The role."""

    def run(self):
        """Return a download link to the test file; an unknown or ambiguous name is an error."""
        _, text, name = split_explicit_title(self.text)
        found = [TESTS / name] if (TESTS / name).exists() else list(TESTS.rglob(name))
        if len(found) != 1:
            raise ExtensionError(f'{self.env.docname}, line {self.lineno}: {len(found)} files in tests/ are called {name}')
        target = f'/../{found[0].relative_to(TESTS.parent)}'
        link = addnodes.download_reference(self.rawtext, text, refdoc=self.env.docname, reftarget=target, reftype='download')
        return [link], []


def setup(app):
    """Register with Sphinx."""
    app.add_role('test', TestRole())
    return {'parallel_read_safe': True}
