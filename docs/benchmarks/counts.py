"""Model sizes of signum and tank, beside the naive form: Stewart multipliers for two modes and full cross complementarity.

    python docs/benchmarks/counts.py

writes counts.csv beside this file.
"""

import sys
from pathlib import Path

import pandas as pd
import pyomo.environ as pyo

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / 'examples'))

import gas_liquid_tank  # noqa: E402
import signum  # noqa: E402

import pyomo_fesd  # noqa: E402

CASES = (('signum', signum.build, 10, 2), ('tank', gas_liquid_tank.build, 100, 3))
FORMS = {
    'minimal': ({}, {}),
    'naive': ({'form': 'stewart'}, {'cross_complementarity': 'full'}),
}


def sizes(build, nfe, ncp, dcs, elements):
    """Counts of one model."""
    m = build()
    pyo.TransformationFactory('fesd.dcs').apply_to(m, **dcs)
    pyo.TransformationFactory('fesd.finite_elements').apply_to(m, nfe=nfe, ncp=ncp, **elements)
    return pyomo_fesd.report(m)


def main():
    """Count and write the table."""
    rows = []
    for name, build, nfe, ncp in CASES:
        for form, (dcs, elements) in FORMS.items():
            rows.append({'problem': name, 'nfe': nfe, 'ncp': ncp, 'form': form} | sizes(build, nfe, ncp, dcs, elements))
    table = pd.DataFrame(rows)
    table.to_csv(HERE / 'counts.csv', index=False)
    print(table.to_string(index=False))


if __name__ == '__main__':
    main()
