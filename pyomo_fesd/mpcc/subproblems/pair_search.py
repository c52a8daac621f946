"""Search for a branch beside a point that descends: depth first over its bi-active pairs, each node settled by weak duality.

A node fixes the zero side of some pairs and leaves both sides of the others free, which only adds directions.  Multipliers that
show that nothing in it descends settle it, whoever gave them (``Descent``), and with it every node that has the sides that they
use: the search jumps over these.  So HiGHS is never believed.  A node that it cannot solve is divided; one in which nothing is left
to divide stays open, where HiGHS' own branch and bound calls it infeasible.

Takes: the ``PairProgram`` of an LPEC.
Leaves: a branch that descends; or that there is none; or neither.
"""

from dataclasses import replace

import numpy as np

from pyomo_fesd.mpcc.subproblems.active_set import FREE, G_ZERO, H_ZERO
from pyomo_fesd.mpcc.subproblems.repeated_program import RepeatedProgram

#: With the smaller side of every pair below this, in rows that reach 1, the branch of these sides may have the direction.
DECIDED = 1e-6
#: Smaller sizes are zero.
SMALLEST = 1e-200
#: Nodes that HiGHS does not solve before the search is given up.
FAILURES = 10
#: From so many pairs on that a proof needs, those are looked for that may have either side; where this finds none, again with so
#: many times as many proofs.
SEVERAL, AGAIN = 3, 2


class PairSearch:
    """The search of one program.

    Parameters
    ----------
    program : PairProgram
    descent : Descent
        of its program
    enough : float
        a relative descent of at most this does not count
    matters : callable (value) -> bool
        whether a value calls for a look at its branch, although its descent does not count
    branch : callable (sides, Answer) -> LpecResult
        of the best direction with one side of each pair zero
    options : dict
        HiGHS options of the user
    deadline : Deadline

    Attributes
    ----------
    others : list
        results of branches that do not descend
    is_open : bool
        whether a node was left open
    """

    def __init__(self, program, descent, enough, matters, branch, options, deadline):
        self._p, self._pairs, self._branch = program, program.pairs, branch
        self._descent, self._enough, self._matters = descent, enough, matters
        self._repeated, self._deadline = RepeatedProgram(program.program, options, deadline), deadline
        self._proofs, self._is_known, self._failures, self._next_trial = [], {}, 0, 0
        self.others, self.is_open = [], False
        self._sides, self._low = program.program.A[program.last], program.program.low[program.last]
        self._size = np.maximum(abs(self._sides) @ program.program.reach, SMALLEST)

    def run(self):
        """The first branch found that descends, or None."""
        waiting, is_first = [np.full(self._pairs, FREE)], True
        while waiting and not self._gives_up():
            sides = self._with_forced(waiting.pop())
            answer = None if sides is None else self._solve(sides)
            if answer is None:
                continue
            low, likely = self._smaller_sides(answer)
            is_free = sides == FREE
            if is_first or np.all(low[is_free] <= DECIDED):
                found = self._look_at(np.where(is_free, likely, sides))
                if found is not None:
                    return found
            self.is_open |= not self._is_known.get(sides.tobytes(), True)
            if is_free.any():
                waiting += _divided(sides, self._next_pair(is_free, low), likely)
            is_first = False
        self.is_open |= bool(waiting)
        return None

    def _look_at(self, sides):
        """The best direction with these sides if it descends, else None; looked at once, unless it is settled."""
        key = sides.tobytes()
        if key in self._is_known or self._with_forced(sides) is None:
            return None
        answer = self._repeated.optimum(self._p.upper_bounds(sides))
        self._is_known[key] = answer is not None
        if answer is None:
            return None
        result = self._branch(sides, answer)
        if result.descent > self._enough:
            return result
        self.others.append(result)
        self._settle(sides, answer.y)
        return None

    def _gives_up(self):
        return self._failures > FAILURES or self._deadline.expired()

    def _with_forced(self, sides):
        """The sides of a node with those that proofs of others leave no choice; None if these settle it."""
        sides, proofs = sides.copy(), np.array(self._proofs, dtype=int).reshape(len(self._proofs), self._pairs)
        while True:
            # those of which no needed side is another one
            holding = proofs[np.all((proofs == FREE) | (sides == FREE) | (proofs == sides), axis=1)]
            missing = (holding != FREE) & (sides == FREE)
            number = missing.sum(axis=1)
            if np.any(number == 0):
                return None
            if not np.any(number == 1):
                return sides
            last = int(np.argmax(number == 1))
            i = int(np.argmax(missing[last]))
            sides[i] = 1 - holding[last, i]

    def _next_pair(self, is_free, low):
        """The pair to divide at: of those with two positive sides the one that most proofs need."""
        needed = np.sum([proof != FREE for proof in self._proofs], axis=0) if self._proofs else np.zeros(self._pairs)
        matters = is_free & (low > DECIDED)
        return int(np.lexsort((low, np.where(matters, needed, 0), matters, is_free))[-1])

    def _solve(self, sides):
        """The direction of a node, None if it is settled."""
        answer = self._repeated.solve(self._p.upper_bounds(sides))
        if answer is None:
            self._failures += 1
            return np.zeros(len(self._p.program.cost))
        return None if self._settle(sides, answer.y) else answer.d

    def _settle(self, sides, y):
        """Keep what multipliers prove; return whether they settle a node."""
        is_settled = self._settles(sides, y)
        if is_settled:
            self._proofs.append(self._without_either(self._needed(sides, y), y))
        return is_settled

    def _settles(self, sides, y):
        """Whether multipliers show that nothing in a node counts."""
        node = self._descent.of(self._p.with_sides(sides))
        least = node.least(y)
        # the last question takes by far the longest to answer
        return not self._matters(least) and (self._descent.negligible(least) or node.proved(y) <= self._enough)

    def _without_either(self, needed, y):
        """The sides that a proof needs, without those that may be either one.

        Where what pairs decide is independent, the multipliers of a node are sums: what each pair with its other side changes, it
        changes whatever the others are.  So a program for each pair settles what would be one for each combination of them.
        """
        pairs = np.flatnonzero(needed != FREE)
        if len(pairs) < SEVERAL or len(self._proofs) < self._next_trial:
            return needed
        steps, basis = {}, self._repeated.basis
        for i in pairs:
            other = needed.copy()
            other[i] = 1 - needed[i]
            self._repeated.restart(basis)
            answer = self._repeated.solve(self._p.upper_bounds(other))
            if answer is not None and self._settles(other, answer.y):
                self._proofs.append(self._needed(other, answer.y))
                if self._settle_together(needed, y, steps | {i: answer.y - y}):
                    steps[i] = answer.y - y
        self._next_trial = 0 if steps else AGAIN * len(self._proofs)
        fewer = needed.copy()
        fewer[list(steps)] = FREE
        return fewer

    def _settle_together(self, needed, y, steps):
        """Whether multipliers ``y`` plus any of the ``steps``, by pair, settle the nodes with the other side of these pairs."""
        first, last = len(y) - 2 * self._pairs, len(y) - self._pairs
        either = needed.copy()
        either[list(steps)] = FREE
        high, clipped = self._p.upper_bounds(either), np.zeros(len(y))
        for i in steps:
            sides = first + i, last + i
            high[list(sides)] = 0.0
            here, there = sides if needed[i] == G_ZERO else sides[::-1]
            for row, own in ((here, steps[i][here]), (there, 0.0)):
                least = y[row] + own + sum(min(step[row], 0.0) for j, step in steps.items() if j != i)
                clipped[row] = max(-least, 0.0)
        descent, least = self._descent.of(replace(self._p.program, high=high)).proved_of_sums(y, list(steps.values()), clipped)
        return descent <= self._enough and not self._matters(least)

    def _needed(self, sides, y):
        """The sides without which multipliers would not settle a node."""
        of_G, of_H = np.minimum(y[self._p.last] * self._size, 0.0).reshape(2, -1)
        part = np.where(sides == G_ZERO, of_G, of_H)
        needed = np.where(part < 0, sides, FREE)
        for i in sorted(np.flatnonzero(needed != FREE), key=lambda i: -part[i]):
            fewer = needed.copy()
            fewer[i] = FREE
            if self._settles(fewer, y):
                needed = fewer
        return needed

    def _smaller_sides(self, d):
        """The smaller side of each pair after a step, relative to what its row can reach, and which one it is."""
        G, H = ((self._sides @ d - self._low) / self._size).reshape(2, -1)
        return np.minimum(G, H), np.where(G <= H, G_ZERO, H_ZERO)


def _divided(sides, i, likely):
    """The two nodes with a zero side of pair ``i``; the likely one is looked at first."""
    nodes = []
    for side in (1 - likely[i], likely[i]):
        node = sides.copy()
        node[i] = side
        nodes.append(node)
    return nodes
