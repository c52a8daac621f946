"""The import law of the design, and the public names."""

import ast
from pathlib import Path

import pytest

import pyomo_fesd

PACKAGE = Path(pyomo_fesd.__file__).parent
ROOMS = ('dcs', 'elements', 'kinks', 'mpcc', 'units')


def imports(path):
    """Modules of the package that a file imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        names = [node.module] if isinstance(node, ast.ImportFrom) else [a.name for a in getattr(node, 'names', [])]
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield from (n for n in names if n and n.startswith('pyomo_fesd.'))


@pytest.mark.parametrize('room', ROOMS)
def test_rooms_import_nothing_from_each_other(room):
    others = tuple(f'pyomo_fesd.{other}' for other in ROOMS if other != room)
    for path in (PACKAGE / room).glob('*.py'):
        assert not [n for n in imports(path) if n.startswith(others)], path


def test_the_march_looks_at_elements_and_nothing_looks_at_the_march():
    """It reads what the elements recorded, and compiles as the solver does; the solver itself it knows by Pyomo's name only."""
    compiles = {f'pyomo_fesd.mpcc.{name}' for name in ('compile', 'phase', 'problem')}
    for path in (PACKAGE / 'march').glob('*.py'):
        others = set(imports(path)) - compiles
        assert not [n for n in others if n.startswith(('pyomo_fesd.dcs', 'pyomo_fesd.mpcc', 'pyomo_fesd.solver'))], path
    others = (p for p in PACKAGE.rglob('*.py') if p.parent.name not in ('march', 'accuracy'))
    assert [p for p in others if any(n.startswith('pyomo_fesd.march') for n in imports(p))] == [PACKAGE / '__init__.py']


def test_accuracy_control_calls_the_transformation_the_solver_and_the_march_as_a_user_does():
    for path in (PACKAGE / 'accuracy').glob('*.py'):
        found = [
            n for n in imports(path) if n.startswith(('pyomo_fesd.dcs', 'pyomo_fesd.mpcc', 'pyomo_fesd.solver', 'pyomo_fesd.march'))
        ]
        assert set(found) <= {'pyomo_fesd.march.simulate'}, path
    others = (p for p in PACKAGE.rglob('*.py') if p.parent.name != 'accuracy')
    assert [p for p in others if any(n.startswith('pyomo_fesd.accuracy') for n in imports(p))] == [PACKAGE / '__init__.py']


def test_only_the_solvers_import_mpcc():
    users = {p.name for p in PACKAGE.glob('*.py') if any(n.startswith('pyomo_fesd.mpcc') for n in imports(p))}
    assert users == {'solver.py', 'casadi_ipopt.py'}


def test_public_names():
    assert sorted(pyomo_fesd.__all__) == [
        'FesdError',
        'absolute',
        'certify',
        'clip',
        'clock',
        'element_lengths',
        'maximum',
        'minimum',
        'physical_time',
        'plot',
        'positive_part',
        'projection',
        'refine',
        'report',
        'simulate',
        'state_jump',
        'structure',
        'switches',
        'trajectory',
        'units',
    ]
