"""Model sizes of signum and tank, beside the naive form: Stewart multipliers for two modes and full cross complementarity.

    python docs/benchmarks/model_size/run.py

Writes rows.csv beside this file.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import benchmarks  # noqa: F401  puts the examples on the path
import gas_liquid_tank
import pandas as pd
import pyomo.environ as pyo
import signum

import pyomo_fesd

HERE = Path(__file__).parent
CASES = (('signum', signum.build, 10, 2), ('tank', gas_liquid_tank.build, 100, 3))
#: form -> options of fesd.dcs, options of fesd.finite_elements
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
    table.to_csv(HERE / 'rows.csv', index=False)
    print(table.to_string(index=False))


if __name__ == '__main__':
    main()
