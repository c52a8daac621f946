"""Walkers that read and replace patterns, one expression after the other."""

import pyomo.environ as pyo
import pytest
from pyomo.core.expr.compare import compare_expressions

from pyomo_fesd.smoothing.rewriting import PatternReader, PatternReplacer


@pytest.fixture
def m():
    m = pyo.ConcreteModel()
    m.x, m.y = pyo.Var(initialize=1), pyo.Var(initialize=2)
    m.e = pyo.Expression(expr=abs(m.x))
    return m


def expressions(m):
    """Without a pattern, with a guarded one, with one in another, with a named Expression."""
    return [m.x, 3.0, m.x * m.y, pyo.log(abs(m.x) + 1), abs(m.x + abs(m.y)), m.y / m.e, abs(m.y) * m.e + pyo.sqrt(m.x**2 + 1e-4)]


def yes(match, guarded):
    return True


def refuses(match, guarded):
    raise RuntimeError


def in_words(found):
    matches, named = found
    return [(str(match.z), match.eps, guarded) for match, guarded in matches], [(e.name, guarded) for e, guarded in named]


def test_a_reader_forgets_the_expressions_before(m):
    reader = PatternReader()
    assert [in_words(reader.read(e, yes)) for e in expressions(m)] == [
        in_words(PatternReader().read(e, yes)) for e in expressions(m)
    ]
    assert in_words(reader.read(expressions(m)[3], yes)) == ([('x', 0.0, True)], [])


def test_an_error_leaves_nothing_to_the_next_expression(m):
    reader, replacer = PatternReader(), PatternReplacer()
    guarded = pyo.log(1 + abs(m.x))
    for walk in (lambda: reader.read(guarded, refuses), lambda: replacer.replace(guarded, refuses, abs)):
        with pytest.raises(RuntimeError):
            walk()
    assert in_words(reader.read(abs(m.y), yes)) == ([('y', 0.0, False)], [])
    assert str(replacer.replace(abs(m.y), lambda match, guarded: not guarded, lambda z: z)) == 'y'


def test_an_expression_without_a_pattern_stays_itself(m):
    replacer = PatternReplacer()
    for e in expressions(m)[:3]:
        assert replacer.replace(e, yes, lambda z: z) is e
    assert compare_expressions(replacer.replace(abs(m.x + abs(m.y)), yes, lambda z: z), m.x + m.y)
