"""``.. run::``: Python code that is executed when the page is built, followed by its output.

The blocks of a page share one namespace. The value of a last expression is shown as an interpreter shows it, a matplotlib Figure
as a picture. Warnings of the package are shown too. With ``:raises:`` the block must end in an exception, whose message is shown;
any other exception fails the build. Long lines of messages are wrapped to the width of the page.
"""

import ast
import base64
import io
import logging
import textwrap
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

import pandas as pd
from docutils import nodes
from docutils.parsers.rst import directives
from matplotlib.figure import Figure
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

import pyomo_fesd

PACKAGE = Path(pyomo_fesd.__file__).parent
WIDTH = 88  # characters in a code block
pd.set_option('display.width', WIDTH)


class Run(SphinxDirective):
    """The directive."""

    has_content = True
    option_spec = {'raises': directives.flag}

    def run(self):
        """Return the code, its output and its picture."""
        for path in PACKAGE.rglob('*.py'):
            self.env.note_dependency(str(path))
        code = '\n'.join(self.content)
        printed, value = self._execute(code)
        if value is not None and not isinstance(value, Figure):
            printed += f'{value!r}\n'
        shown = [nodes.literal_block(code, code, language='python')]
        if printed:
            printed = _wrapped(printed.rstrip())
            shown.append(nodes.literal_block(printed, printed, language='none', classes=['output']))
        if isinstance(value, Figure):
            shown.append(_picture(value))
        return shown

    def _execute(self, code):
        namespace = self.env.temp_data.setdefault('run', {})
        where = f'{self.env.docname}, line {self.lineno}'
        with _captured() as stream:
            try:
                value = _interpret(code, where, namespace)
            except Exception as error:
                if 'raises' not in self.options:
                    raise ExtensionError(f'{where}: {error}') from error
                return f'{stream.getvalue()}{type(error).__name__}: {error}\n', None
        if 'raises' in self.options:
            raise ExtensionError(f'{where}: nothing was raised')
        return stream.getvalue(), value


def _wrapped(text):
    """Wrap lines of prose that are too long; lines with runs of blanks are rows of a table and stay as they are."""
    return '\n'.join(_wrapped_line(line) for line in text.split('\n'))


def _wrapped_line(line):
    words = line.lstrip()
    if len(line) <= WIDTH or '  ' in words:
        return line
    indent = line[: len(line) - len(words)]
    return textwrap.fill(words, WIDTH, initial_indent=indent, subsequent_indent=indent + '    ', break_on_hyphens=False)


def _interpret(code, where, namespace):
    """Execute all statements; returns the value of the last one if it is an expression."""
    statements = ast.parse(code, where).body
    last = statements.pop() if isinstance(statements[-1], ast.Expr) else None
    exec(compile(ast.Module(statements, []), where, 'exec'), namespace)
    return None if last is None else eval(compile(ast.Expression(last.value), where, 'eval'), namespace)


@contextmanager
def _captured():
    """Yield a stream that collects printed output and the warnings of the package."""
    stream = io.StringIO()
    handler, logger = logging.StreamHandler(stream), logging.getLogger('pyomo_fesd')
    handler.setFormatter(logging.Formatter('WARNING: %(message)s'))
    handler.setLevel(logging.WARNING)
    logger.addHandler(handler)
    logger.propagate = False
    try:
        with redirect_stdout(stream):
            yield stream
    finally:
        logger.removeHandler(handler)
        logger.propagate = True


def _picture(figure):
    file = io.BytesIO()
    figure.savefig(file, format='svg')
    data = base64.b64encode(file.getvalue()).decode()
    return nodes.raw('', f'<p><img alt="plot" src="data:image/svg+xml;base64,{data}"></p>', format='html')


def setup(app):
    """Register with Sphinx."""
    app.add_directive('run', Run)
    return {'parallel_read_safe': True}
