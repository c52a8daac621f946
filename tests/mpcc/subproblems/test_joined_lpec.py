"""The LPEC with a copy of a part, against the model that has one more part."""

import numpy as np
import pytest
from problems import inserted
from scipy import sparse

from pyomo_fesd.mpcc.subproblems.active_set import ActiveSets
from pyomo_fesd.mpcc.subproblems.inserted_copy import Insertion
from pyomo_fesd.mpcc.subproblems.joined_lpec import JoinedLpec
from pyomo_fesd.mpcc.subproblems.lpec import Lpec

STEP = 1e-6


def joined(short, k, ahead):
    """Matrix and cost of the joined LPEC at a random point; the copy has random values of its own."""
    c, parts, w = short.c, short.parts, short.w
    sides = np.random.default_rng(1).integers(0, 2, c.pairs)
    sets, equal = ActiveSets(sides, np.zeros(c.pairs, dtype=bool)), np.zeros(c.equal.numel(), dtype=bool)
    insertion = Insertion(k, ahead, sides, sides, (k,))
    following = k if ahead else k + 1
    lpec = JoinedLpec(c, short.sides, parts, insertion, following, sets, equal)
    _, _, base = Lpec(c, short.sides, {}).linearised(w, sets, 1.0, equal)
    part = parts.all[k]
    values = np.random.default_rng(2).uniform(0.2, 0.9, len(part.own))
    values[part.own == part.extent] = 0.0
    place, there, beside = {j: i for i, j in enumerate(part.own)}, w.copy(), w.copy()
    there[part.own] = values
    ended = values[[place[j] for j in part.last]]
    if ahead:
        beside[part.first] = ended
    else:
        there[part.first] = w[part.last]
        beside[parts.all[following].first] = ended
    points = [(c.gradients(at)[0], c.stacked_jacobian(at)) for at in (w, beside, there)]
    empty = [np.zeros(len(lpec.rows))] * 2 + [np.zeros(len(part.own))] * 3
    program = lpec.linearised(base, points, 0.0, empty, []).program
    # rows of decisions have no bounds in the copy
    bounded = np.append(np.ones(program.A.shape[0] - len(lpec.rows), dtype=bool), lpec.rows < len(c.lbg) + 2 * c.pairs)
    return program.A[bounded], program.cost, values


def of_longer(short, longer, k, ahead, values):
    """Its matrix by finite differences and its cost, in the columns of the joined LPEC."""
    at = k if ahead else k + 1
    n, w, columns = len(short.w), longer.c.x0.copy(), np.full(len(longer.c.x0), -1)
    for j, part in enumerate(longer.parts.all):
        if j == at:
            w[part.own], columns[part.own] = values, n + np.arange(len(part.own))
        else:
            source = short.parts.all[j - (j > at)].own
            w[part.own], columns[part.own] = short.w[source], source
    for j in np.flatnonzero(columns < 0):
        columns[j] = short.names.index(longer.names[j])
        w[j] = short.w[columns[j]]

    def rows(w):
        found = longer.c.evaluate(w)
        return np.concatenate([found.g, found.G, found.H]), found.f

    J, cost = np.zeros((len(rows(w)[0]), n + len(values))), np.zeros(n + len(values))
    for j, column in enumerate(columns):
        step = STEP * np.eye(len(w))[j]
        (up, f_up), (down, f_down) = rows(w + step), rows(w - step)
        J[:, column], cost[column] = (up - down) / (2 * STEP), (f_up - f_down) / (2 * STEP)
    return J, cost


def sorted_rows(A):
    A = np.round(A.toarray() if sparse.issparse(A) else A, 5) + 0.0
    return A[np.lexsort(A.T)]


@pytest.mark.parametrize('form', ['heaviside', 'stewart'])
@pytest.mark.parametrize('k, ahead', [(1, True), (2, True), (1, False), (2, False)])
def test_the_rows_are_those_of_the_model_with_one_more_part(form, k, ahead):
    short, longer = inserted.compiled(4, form), inserted.compiled(5, form)
    A, cost, values = joined(short, k, ahead)
    expected, of_objective = of_longer(short, longer, k, ahead, values)
    assert A.shape == expected.shape
    assert np.allclose(sorted_rows(A), sorted_rows(expected), atol=2e-5)
    assert cost == pytest.approx(of_objective, abs=1e-6)
