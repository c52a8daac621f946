"""``.. if-exists:: file``: the content, if the file (beside the page) is there; so pages can wait for measurements."""

from pathlib import Path

from docutils import nodes
from sphinx.util.docutils import SphinxDirective


class IfExists(SphinxDirective):
    """The directive."""

    required_arguments = 1
    has_content = True

    def run(self):
        """The parsed content, or a sentence that says what is missing."""
        name = self.arguments[0]
        if (Path(self.env.doc2path(self.env.docname)).parent / name).exists():
            return self.parse_content_to_nodes()
        said = f'{name} has not been produced on this machine yet.'
        return [nodes.paragraph('', '', nodes.emphasis(said, said))]


def setup(app):
    """Register with Sphinx."""
    app.add_directive('if-exists', IfExists)
    return {'parallel_read_safe': True}
