"""The blocks that ``fesd.dcs`` makes for the forms of Disjunctions."""

from pyomo.core import Block


def form_block(m):
    """The name of the form of the only Disjunction of ``m`` that was transformed, '' for the smallest one, and its block."""
    (block,) = m.component('_pyomo_fesd_dcs').component_map(Block).values()
    forms = {name: form for name, form in block.component_map(Block).items() if name.startswith('_pyomo_fesd_')}
    ((name, form),) = forms.items() or {'': block}.items()
    return name.removeprefix('_pyomo_fesd_'), form
