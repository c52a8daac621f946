"""The solver on random MPCCs: what it says against what is known.

    PYTHONPATH=.:tests python -m problems.fuzz FROM TO [option=value ...]

prints a table of outcomes and the seeds that fail.
"""

import sys
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from problems.branch_check import INF, faults, truth
from problems.random_mpcc import as_model, generate
from pyomo.contrib.solver.common.factory import SolverFactory

import pyomo_fesd  # noqa: F401

#: Agreement of an objective with the best branch.
SAME = 1e-5
#: What a run may end in, and the word for it here.
CERTIFIED, SOLVED, UNCERTIFIED, INFEASIBLE, UNBOUNDED = 'certified', 'solved', 'uncertified', 'infeasible', 'unbounded'
OUTCOMES = {
    "B-stationary point found and certified": CERTIFIED,
    "exactly complementary solution found; there is no objective to minimise": SOLVED,
    "feasible, exactly complementary point found, not certified": UNCERTIFIED,
    "no feasible point found: the problem is locally infeasible": INFEASIBLE,
    "the objective falls without bound along feasible points": UNBOUNDED,
    "iteration limit reached": 'limit',
}


@dataclass
class Record:
    """What became of one seed.

    Attributes
    ----------
    outcome : str
        one of the words in ``OUTCOMES``, or 'crash'
    wrong : list of str
        contradictions between what the solver says and what is known: each is a defect
    missed : str
        where an ideal solver would do better: 'called infeasible', 'uncertified', 'limit', 'not global', or ''
    """

    seed: int
    marks: list
    outcome: str = 'crash'
    objective: float = None
    best: float = None
    known: str = 'unknown'
    wrong: list = field(default_factory=list)
    missed: str = ''
    seconds: float = 0.0

    def __str__(self):
        told = '; '.join(self.wrong + [self.missed] * bool(self.missed))
        return f'{self.seed:6d} {self.outcome:11} f {self.objective} best {self.best} {self.known} {self.marks}: {told}'


def run(seed, **options):
    """Generate, solve and judge one seed."""
    p = generate(seed)
    record = Record(seed, p.marks)
    started = time.perf_counter()
    try:
        m = as_model(p)
        results = SolverFactory('mpec_hybrid').solve(m, raise_exception_on_nonoptimal_result=False, **options)
    except Exception:
        record.wrong.append(traceback.format_exc(limit=-2).replace('\n', ' | '))
        return record
    record.seconds = time.perf_counter() - started
    judge(p, record, results.extra_info, results.incumbent_objective, [v.value for v in m.w.values()])
    return record


def judge(p, record, info, objective, values):
    """Fill in what the solver said and whether it is right."""
    if info.outcome not in OUTCOMES:
        record.wrong.append(f'undocumented outcome: {info.outcome}')
        return
    record.outcome = OUTCOMES[info.outcome]
    claims = record.outcome in (CERTIFIED, SOLVED)
    if claims != (info.stationarity == 'B'):
        record.wrong.append(f'stationarity {info.stationarity}')
    if claims:
        w = np.array([np.nan if v is None else v for v in values], dtype=float)
        w[p.idle] = np.clip(0.0, p.lb, p.ub)[p.idle]
        record.wrong += faults(p, w)
        if p.f is not None:
            record.objective = p.f(w)
            told = -objective if p.maximise else objective
            if abs(told - record.objective) > 1e-6 * max(1, abs(told)):
                record.wrong.append(f'objective reported as {told}')
    feasible = p.known is not None
    if p.convex:
        statuses, record.best = truth(p)
        if not statuses['unknown']:
            feasible = statuses['Optimal'] + statuses['Unbounded'] > 0
            record.known = 'infeasible' if not feasible else 'unbounded' if record.best == -INF else 'optimal'
            if claims and not feasible:
                record.wrong.append('certified, though every branch is infeasible')
            if claims and feasible and not statuses['Optimal']:
                record.wrong.append('certified, though every feasible branch is unbounded')
            if record.outcome == UNBOUNDED and not statuses['Unbounded']:
                record.wrong.append('called unbounded, though every branch is bounded')
    if feasible and record.outcome == INFEASIBLE:
        record.missed = 'called infeasible'
    elif record.outcome in (UNCERTIFIED, 'limit'):
        record.missed = record.outcome
    elif record.outcome == CERTIFIED and record.known == 'optimal':
        if record.objective < record.best - SAME * max(1, abs(record.best)):
            record.wrong.append(f'{record.objective} is better than the best branch, {record.best}')
        elif record.objective > record.best + SAME * max(1, abs(record.best)):
            record.missed = 'not global'


def main(first, last, **options):
    records = [run(seed, **options) for seed in range(first, last)]
    table = Counter((r.known, r.outcome) for r in records)
    print('known       outcome      number')
    for (known, outcome), number in sorted(table.items()):
        print(f'{known:11} {outcome:11} {number:7d}')
    for missed, number in Counter(r.missed for r in records if r.missed).items():
        print(f'{missed}: {number}: {[r.seed for r in records if r.missed == missed]}')
    seconds = [r.seconds for r in records]
    for outcome in sorted({r.outcome for r in records}):
        spent = [r.seconds for r in records if r.outcome == outcome]
        print(f'{outcome:11} median {np.median(spent):.3f} s, all {sum(spent):.1f} s')
    print(f'seconds: {sum(seconds):.1f} in the solver, median {np.median(seconds):.3f}, longest {max(seconds):.2f}')
    print('defects:', [r.seed for r in records if r.wrong] or 'none')
    for r in records:
        if r.wrong or r.missed not in ('', 'not global'):
            print(r)


if __name__ == '__main__':
    main(int(sys.argv[1]), int(sys.argv[2]), **dict(a.split('=') for a in sys.argv[3:]))
