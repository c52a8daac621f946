"""Convert docstrings for the reference page.

* "(theory, eq. 11)" becomes a link to that equation; "paper, eq. (8)" means the paper's own numbers and stays as it is.
* ``|d|`` stays an absolute value, which reStructuredText would read as a substitution.
* "Source: ..." at the end is moved before the sections; napoleon would read it as a part of the last section.
* The options that Pyomo writes into docstrings are removed: they have a page of their own.
"""

import re

CITATION = re.compile(r"(?<!paper, )eq\. \(?(\d+[abc]?'?)\)?")
OPTIONS = ('**Class configuration**', 'Keyword Arguments')


def target(number):
    """Return the label of an equation on the theory page."""
    return 'eq-' + number.replace("'", '-prime')


def process(app, what, name, obj, options, lines):
    """Handle ``autodoc-process-docstring``; runs before napoleon."""
    end = next((i for i, line in enumerate(lines) if line in OPTIONS), len(lines))
    lines[:] = [_escaped(_linked(line)) for line in _source_first(lines[:end])] + ['']


def _source_first(lines):
    """Return the lines with the paragraph "Source: ..." before the first underlined heading."""
    heading = next((i for i, line in enumerate(lines[1:]) if line.startswith('---')), len(lines))
    start = next((i for i, line in enumerate(lines) if line.startswith('Source:')), len(lines))
    if start < heading:
        return lines
    return [*lines[:heading], *lines[start:], '', *lines[heading:start]]


def _linked(line):
    return CITATION.sub(lambda found: f':ref:`{found[0]} <{target(found[1])}>`', line)


def _escaped(line):
    """Escape bars outside literals."""
    return '``'.join(part if i % 2 else part.replace('|', r'\|') for i, part in enumerate(line.split('``')))


def setup(app):
    """Register with Sphinx."""
    app.connect('autodoc-process-docstring', process, priority=400)
    return {'parallel_read_safe': True}
