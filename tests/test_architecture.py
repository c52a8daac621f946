"""The import law of docs/architecture.rst, and the public names."""

import ast
from pathlib import Path

import pytest

import pyomo_fesd

PACKAGE = Path(pyomo_fesd.__file__).parent
#: Rooms from the ground up: a room imports only from rooms below its own row.
FLOORS = (
    ('core',),
    ('modeling', 'units', 'smoothing', 'dcs', 'finite_elements', 'mpcc'),
    ('results', 'analysis', 'estimation'),
    ('diagnostics',),
    ('solvers',),
    ('simulation',),
    ('starts', 'sensitivities', 'scenarios', 'integers'),
    ('refinement', 'control'),
)
#: The rooms inside a room, each importing only from those before it.
INNER = {
    'dcs': ('reading', 'forms', 'piecewise'),
    'mpcc': ('compile', 'nlp', 'subproblems', 'algorithm', 'reporting', 'multistart'),
}
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
FILES = sorted(path for path in PACKAGE.rglob('*.py') if path.parent != PACKAGE)


def imports(path):
    """Modules of the package that a file imports from."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            yield node.module or ''
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def imported_rooms(path):
    """The dotted paths below the package that a file imports from, as lists of parts."""
    return [name.split('.')[1:] for name in imports(path) if name.startswith('pyomo_fesd.')]


def test_every_folder_is_a_room_with_a_floor():
    folders = {p.parent.relative_to(PACKAGE).as_posix() for p in FILES}
    inner = {f'{room}/{name}' for room, names in INNER.items() for name in names}
    assert folders == set(FLOOR) | inner


@pytest.mark.parametrize('path', FILES, ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_a_room_is_entered_through_its_door_and_from_above(path):
    room, *inside = path.relative_to(PACKAGE).parent.parts
    for other, *module in imported_rooms(path):
        if other != room:
            assert FLOOR[other] < FLOOR[room], f'{room} imports from {other}, which does not lie below it'
            assert not module, f'{other} is entered at {".".join(module)} and not through its door'
        elif module and room in INNER and module[0] in INNER[room] and module[:1] != inside[:1]:
            order = INNER[room]
            assert not inside or order.index(module[0]) < order.index(inside[0]), f'{inside[0]} imports from {module[0]}'
            assert len(module) == 1, f'{room}.{module[0]} is entered at {module[1]} and not through its door'


def test_no_file_imports_from_the_package_itself():
    for path in FILES:
        modules = [node.module for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
        assert 'pyomo_fesd' not in modules, path


def test_public_names():
    assert sorted(pyomo_fesd.__all__) == [
        'ControlStep',
        'Controller',
        'FesdError',
        'MovingModelInterface',
        'Plant',
        'absolute',
        'at',
        'branch_equations',
        'casadi_ipopt',
        'certify',
        'clip',
        'clock',
        'contact',
        'covariance',
        'decide_integers',
        'element_lengths',
        'friction',
        'maximum',
        'minimum',
        'parmest_solver',
        'physical_time',
        'plot',
        'positive_part',
        'projection',
        'receding_horizon',
        'recollocate',
        'refine',
        'report',
        'sensitivity',
        'signal',
        'simulate',
        'start_from',
        'state_jump',
        'structure',
        'sum_up_rounding',
        'sweep',
        'switches',
        'trajectory',
        'units',
    ]
