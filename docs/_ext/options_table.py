"""``.. options-table:: package.module.Class``: a table of name, default and meaning of the options in the class's ``CONFIG``.

The table is made when the page is built, so it agrees with the code. Options that a base class declares are left out.
"""

from importlib import import_module
from inspect import getfile

from docstrings import CITATION, target
from docutils import nodes
from pyomo.common.config import ConfigDict
from sphinx.addnodes import pending_xref
from sphinx.util.docutils import SphinxDirective

WIDTHS = {'option': 27, 'default': 17, 'meaning': 56}


class OptionsTable(SphinxDirective):
    """The directive; its argument is the dotted path of a class with a Pyomo ConfigDict ``CONFIG``."""

    required_arguments = 1

    def run(self):
        """Return the table."""
        module, _, name = self.arguments[0].rpartition('.')
        cls = getattr(import_module(module), name)
        self.env.note_dependency(getfile(cls))
        inherited = {option for base in cls.__mro__[1:] for option in getattr(base, 'CONFIG', ())}
        table = nodes.table(classes=['colwidths-given'])
        group = nodes.tgroup(cols=len(WIDTHS))
        table += group
        group.extend(nodes.colspec(colwidth=width) for width in WIDTHS.values())
        group += nodes.thead('', _row(*(nodes.paragraph(title, title) for title in WIDTHS)))
        group += nodes.tbody('', *(self._option(cls.CONFIG.get(n)) for n in cls.CONFIG if n not in inherited))
        return [table]

    def _option(self, entry):
        default = '{}' if isinstance(entry, ConfigDict) else repr(entry._default)
        meaning = nodes.paragraph('', '', *self._linked(entry._description or ''))
        return _row(_code(entry.name()), _code(default), meaning)

    def _linked(self, text):
        """Yield nodes of ``text`` with citations of equations as links."""
        end = 0
        for found in CITATION.finditer(text):
            yield nodes.Text(text[end : found.start()])
            yield pending_xref(
                '',
                nodes.inline(found[0], found[0]),
                refdoc=self.env.docname,
                refdomain='std',
                reftype='ref',
                reftarget=target(found[1]),
                refexplicit=True,
                refwarn=True,
            )
            end = found.end()
        yield nodes.Text(text[end:])


def _code(text):
    return nodes.paragraph('', '', nodes.literal(text, text))


def _row(*cells):
    return nodes.row('', *(nodes.entry('', cell) for cell in cells))


def setup(app):
    """Register with Sphinx."""
    app.add_directive('options-table', OptionsTable)
    return {'parallel_read_safe': True}
