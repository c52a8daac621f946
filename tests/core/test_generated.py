"""Generated blocks, and the names of their contents in reports."""

import pyomo.environ as pyo
import pytest

from pyomo_fesd.core.generated import GENERATED, is_generated, public_name, source_name


def test_a_component_in_a_generated_block_is_generated():
    m = pyo.ConcreteModel()
    m.unit = pyo.Block([1])
    m.unit[1].x = pyo.Var([1])
    block = pyo.Block()
    m.unit[1].add_component(GENERATED + 'dcs', block)
    block.inner = pyo.Block()
    block.inner.nu = pyo.Var([1])
    assert all(map(is_generated, (block, block.inner, block.inner.nu, block.inner.nu[1])))
    assert not any(map(is_generated, (m, m.unit, m.unit[1], m.unit[1].x, m.unit[1].x[1])))


@pytest.mark.parametrize(
    'name, public, source',
    [
        (f'unit[a].{GENERATED}dcs.sgn.nu[*]', 'unit[a].sgn.nu', 'unit[a].sgn'),
        (f'{GENERATED}dcs.sgn.nu[*,k]', 'sgn.nu[k]', 'sgn'),
        ('contact[*]', 'contact', 'contact'),
    ],
)
def test_names_without_time_and_generated_blocks(name, public, source):
    assert (public_name(name), source_name(name)) == (public, source)
