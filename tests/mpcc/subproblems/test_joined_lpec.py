"""The LPEC with copies of parts, against the model that has more parts."""

import numpy as np
import pytest
from problems import inserted
from scipy import sparse

from pyomo_fesd.mpcc.subproblems.active_set import ActiveSets
from pyomo_fesd.mpcc.subproblems.inserted_copy import Insertion
from pyomo_fesd.mpcc.subproblems.joined_lpec import JoinedLpec
from pyomo_fesd.mpcc.subproblems.lpec import Lpec

STEP = 1e-6


def joined(short, copies):
    """Matrix and cost of the joined LPEC at a random point, also in the ``copies``: each a part, and whether ahead of it."""
    c, parts, w = short.c, short.parts, short.w
    sides = np.random.default_rng(1).integers(0, 2, c.pairs)
    sets, equal = ActiveSets(sides, np.zeros(c.pairs, dtype=bool)), np.zeros(c.equal.numel(), dtype=bool)
    insertions = tuple(Insertion(k, ahead, sides, sides, (k,)) for k, ahead in copies)
    following = following_part(copies)
    lpec = JoinedLpec(c, short.sides, parts, insertions, following, sets, equal)
    _, _, base = Lpec(c, short.sides, {}).linearised(w, sets, 1.0, equal)
    values, points, random = [], [w], np.random.default_rng(2)
    ended = w[parts.all[following].first]
    for k, _ in copies:
        part, there = parts.all[k], w.copy()
        own = random.uniform(0.2, 0.9, len(part.own))
        own[part.own == part.extent] = 0.0
        there[part.own] = own
        there[part.first] = ended
        ended = there[part.last]
        values.append(own)
        points.append(there)
    beside = w.copy()
    beside[parts.all[following].first] = ended
    points.insert(1, beside)
    empty = [[np.zeros(len(copy.rows))] * 2 + [np.zeros(len(copy.own))] * 3 for copy in lpec.copies]
    none = [[] for _ in copies]
    program = lpec.linearised(base, lpec.gradients(points), [0.0] * len(copies), empty, none).program
    # rows of decisions have no bounds in the copies
    of_model = program.A.shape[0] - sum(len(copy.rows) for copy in lpec.copies)
    bounded = [np.ones(of_model, dtype=bool), *(copy.rows < len(c.lbg) + 2 * c.pairs for copy in lpec.copies)]
    return program.A[np.concatenate(bounded)], program.cost, values


def following_part(copies):
    """The part after the copies."""
    k, ahead = copies[-1]
    return k if ahead else k + 1


def of_longer(short, longer, copies, values):
    """Its matrix by finite differences and its cost, in the columns of the joined LPEC."""
    at, number = following_part(copies), len(copies)
    n, w, columns = len(short.w), longer.c.x0.copy(), np.full(len(longer.c.x0), -1)
    firsts = n + np.concatenate([[0], np.cumsum([len(own) for own in values])])
    for j, part in enumerate(longer.parts.all):
        if at <= j < at + number:
            w[part.own], columns[part.own] = values[j - at], firsts[j - at] + np.arange(len(part.own))
        else:
            source = short.parts.all[j - number * (j >= at)].own
            w[part.own], columns[part.own] = short.w[source], source
    for j in np.flatnonzero(columns < 0):
        columns[j] = short.names.index(longer.names[j])
        w[j] = short.w[columns[j]]

    def rows(w):
        found = longer.c.evaluate(w)
        return np.concatenate([found.g, found.G, found.H]), found.f

    J, cost = np.zeros((len(rows(w)[0]), firsts[-1])), np.zeros(firsts[-1])
    for j, column in enumerate(columns):
        step = STEP * np.eye(len(w))[j]
        (up, f_up), (down, f_down) = rows(w + step), rows(w - step)
        J[:, column], cost[column] = (up - down) / (2 * STEP), (f_up - f_down) / (2 * STEP)
    return J, cost


def sorted_rows(A):
    A = np.round(A.toarray() if sparse.issparse(A) else A, 5) + 0.0
    return A[np.lexsort(A.T)]


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
@pytest.mark.parametrize(
    'copies',
    [
        [(1, True)],
        [(2, True)],
        [(1, False)],
        [(2, False)],
        [(1, True), (1, True)],
        [(1, False), (1, False)],
        [(1, False), (2, True)],
        [(1, False), (1, False), (2, True)],
    ],
    ids=str,
)
def test_the_rows_are_those_of_the_model_with_more_parts(form, copies):
    short, longer = inserted.compiled(4, form), inserted.compiled(4 + len(copies), form)
    A, cost, values = joined(short, copies)
    expected, of_objective = of_longer(short, longer, copies, values)
    assert A.shape == expected.shape
    assert np.allclose(sorted_rows(A), sorted_rows(expected), atol=2e-5)
    assert cost == pytest.approx(of_objective, abs=1e-6)
