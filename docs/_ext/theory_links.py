"""Docstrings cite the theory page by equation number, "(theory, eq. 11)": each citation becomes a link to that equation."""

import re

#: A citation; "paper, eq. (8)" means the paper's own numbers and stays as it is.
CITATION = re.compile(r"(?<!paper, )eq\. \(?(\d+[abc]?'?)\)?")


def target(number):
    """Label of an equation on the theory page."""
    return 'eq-' + number.replace("'", '-prime')


def link_citations(app, what, name, obj, options, lines):
    """Handler of ``autodoc-process-docstring``."""
    lines[:] = [CITATION.sub(lambda found: f':ref:`{found[0]} <{target(found[1])}>`', line) for line in lines]


def setup(app):
    """Register with Sphinx."""
    app.connect('autodoc-process-docstring', link_citations)
    return {'parallel_read_safe': True}
