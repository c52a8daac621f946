"""One change after the other: what a setting of the solver or the grid does to the discs and the hopper.

    .venv/bin/python docs/benchmarks/hard_ocp/changes.py [--only discs] [--forms contact] [--changes 'base;scholtes'] [--limit 60]

Each row is a run from the model's own initial values at the defaults but for one change; 'base' has none.  A run ends at its time
limit.  Writes changes.csv, one row a run; runs that have a row are skipped.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.common.rows import Rows
from benchmarks.hard_ocp import run

HERE = Path(__file__).parent
PROBLEMS, FORMS = ('discs', 'hopper'), ('contact', 'time_freezing')
KEY = ('problem', 'form', 'change')
COLUMNS = (
    *KEY,
    'limit',
    'status',
    'certified',
    'objective',
    'residual',
    'replayed',
    'missed',
    'excess',
    'impacts',
    'iterations',
    'nlps',
    'cpu',
    'seconds',
)

#: change -> options; those of a form or problem that does not have them are left out by ``FITS``.
CHANGES = {
    'base': {},
    'scholtes': {'relaxation': 'scholtes'},
    'scholtes, eps_init 10': {'relaxation': 'scholtes', 'eps_init': 10.0},
    'elastic': {'relaxation': 'elastic'},
    'elastic, eps_init 10': {'relaxation': 'elastic', 'eps_init': 10.0},
    'eps_init 10': {'eps_init': 10.0},
    'eps_factor 0.2': {'eps_factor': 0.2},
    'eps_factor 0.3': {'eps_factor': 0.3},
    'eps_factor 0.5': {'eps_factor': 0.5},
    'relaxation alone, scholtes': {'mode': 'relaxation', 'relaxation': 'scholtes'},
    'equilibration penalty': {'equilibration': 'penalty'},
    'equilibration complementarity': {'equilibration': 'complementarity'},
    'equilibration none': {'equilibration': 'none'},
    'pairs of points': {'cross_complementarity': 'point'},
    'all pairs': {'cross_complementarity': 'full'},
    'sums of pairs': {'cross_complementarity': 'element'},
    'one collocation point': {'ncp': 1},
    'two collocation points': {'ncp': 2},
    'three collocation points': {'ncp': 3},
    'two elements a stage': {'elements': 2},
    'three elements a stage': {'elements': 3},
    'uneven initial lengths': {'lengths': 'uneven'},
    'length_bounds 0.5': {'length_bounds': 0.5},
    'rho 1': {'rho': 1.0},
    'rho 0': {'rho': 0.0},
    'relaxation_iterations 100': {'relaxation_iterations': 100},
    'relaxation_iterations 2000': {'relaxation_iterations': 2000},
    'relaxation_tol 1e-2': {'relaxation_tol': 1e-2},
    'relaxation_tol 1e-6': {'relaxation_tol': 1e-6},
    'relaxation_tol 1e-8': {'relaxation_tol': 1e-8},
    'mu_strategy adaptive': {'nlp_options.mu_strategy': 'adaptive'},
    'mu_strategy monotone': {'nlp_options.mu_strategy': 'monotone'},
    'mu_oracle quality-function': {'nlp_options.mu_strategy': 'adaptive', 'nlp_options.mu_oracle': 'quality-function'},
    'mumps_pivtol 1e-4': {'nlp_options.mumps_pivtol': 1e-4},
    'no scaling by Ipopt': {'nlp_options.nlp_scaling_method': 'none'},
    'natural_units user': {'natural_units': 'user'},
    'lpec reduced': {'lpec': 'reduced'},
    'lengths of stages in place of the speed of time': {'clock': 'lengths'},
    'guess along the reference': {'guess': 'reference'},
    'the foot may slip': {'no_slip': False},
}
#: Options that not every form of every problem has: (problem, form) -> whether it has it.
FITS = {
    'clock': lambda problem, form: form == 'time_freezing',
    'guess': lambda problem, form: problem == 'hopper',
    'no_slip': lambda problem, form: (problem, form) == ('hopper', 'contact'),
}


def fits(problem, form, options):
    """Whether the form has these options, and they change something."""
    p = run.cases.module(problem)
    # contacts that must not slip have all pairs by default
    cross = 'full' if (problem, form) == ('hopper', 'contact') else 'element'
    same = options in ({'ncp': p.NCP}, {'elements': p.ELEMENTS}, {'cross_complementarity': cross})
    return not same and all(FITS[name](problem, form) for name in options if name in FITS)


def study(problems, forms, changes, limit, fresh):
    """Measure the missing rows."""
    rows = Rows(HERE / 'changes.csv', KEY, COLUMNS, fresh=fresh)
    for change in changes:
        for problem in problems:
            for form in forms:
                if fits(problem, form, CHANGES[change]) and (problem, form, change) not in rows:
                    found = run.in_process(problem, form, 0, CHANGES[change], limit)
                    row = {name: found[name] for name in COLUMNS if name in found} | {'form': form, 'change': change}
                    rows.add(row)
                    run.show(row)


def main():
    """Measure the missing rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', type=run.names, default=PROBLEMS, help="problems, by name")
    parser.add_argument('--forms', type=run.names, default=FORMS, help="contact, time_freezing")
    parser.add_argument('--changes', type=lambda text: text.split(';'), default=list(CHANGES), help="by name, ';' between")
    parser.add_argument('--fresh', action='store_true', help="delete the existing rows first")
    parser.add_argument('--limit', type=float, default=60, help="seconds for each run")
    chosen = parser.parse_args()
    study(chosen.only, chosen.forms, chosen.changes, chosen.limit, chosen.fresh)


if __name__ == '__main__':
    main()
