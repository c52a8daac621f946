"""The metadata in setup.cfg, the files of the release and the versions that they name agree with one another."""

import ast
import configparser
import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PICTURE = re.compile(r'!\[[^]]*\]\(([^)]*)\)|<img[^>]* src="([^"]*)"')
LINK = re.compile(r'(?<!!)\[[^]]*\]\(([^)]*)\)')


@pytest.fixture(scope='module')
def settings():
    parser = configparser.ConfigParser()
    parser.read(ROOT / 'setup.cfg')
    return parser


def lines(text):
    return [line for line in text.splitlines() if line]


def python_versions(settings):
    found = re.findall(r'Programming Language :: Python :: (3\.\d+)', settings['metadata']['classifiers'])
    return sorted(found, key=lambda version: int(version.split('.')[1]))


def version():
    """Return ``__version__`` as setuptools reads it: a literal, found without an import of the package."""
    tree = ast.parse((ROOT / 'pyomo_fesd/core/version.py').read_text())
    (value,) = (n.value for n in tree.body if isinstance(n, ast.Assign) and n.targets[0].id == '__version__')
    return ast.literal_eval(value)


def test_the_version_is_a_literal_that_the_changelog_describes():
    assert re.fullmatch(r'\d+\.\d+\.\d+', version())
    assert re.search(rf'^{re.escape(version())}\b.*\n-+$', (ROOT / 'docs/changelog.rst').read_text(), flags=re.M)


def test_every_classifier_is_registered(settings):
    registered = pytest.importorskip('trove_classifiers', reason="needs the extra: pip install -e '.[test]'").classifiers
    assert set(lines(settings['metadata']['classifiers'])) <= registered


def test_the_least_python_is_the_first_of_the_classifiers(settings):
    assert settings['options']['python_requires'] == f'>={python_versions(settings)[0]}'
    minor = python_versions(settings)[0].replace('.', '')
    assert f'target-version = "py{minor}"' in (ROOT / 'pyproject.toml').read_text()


def test_the_workflow_runs_the_gate_on_every_python_of_the_classifiers(settings):
    workflow = (ROOT / '.github/workflows/ci.yml').read_text()
    (matrix,) = re.findall(r'python: \[(.*)\]', workflow)
    assert re.findall(r'[\d.]+', matrix) == python_versions(settings)
    assert re.findall(r'- run: (.*)', workflow) == ['.ci/run']


def test_every_dependency_has_a_lower_bound_and_the_gate_pins_it(settings):
    requirements = lines(settings['options']['install_requires'])
    assert all(re.fullmatch(r'[a-z]+>=[\d.]+', requirement) for requirement in requirements)
    pinned = runpy.run_path(str(ROOT / '.ci/lowest_bounds.py'))['lowest_bounds']()
    assert [p.split('==') for p in pinned] == [r.split('>=') for r in requirements]


def test_ruff_has_one_version(settings):
    (version,) = re.findall(r'^ruff==(.*)$', settings['options.extras_require']['dev'], flags=re.M)
    assert set(re.findall(r'ruff==([\d.]+)', (ROOT / '.pre-commit-config.yaml').read_text())) == {version}


def test_the_package_is_typed(settings):
    assert (ROOT / 'pyomo_fesd/py.typed').exists()
    assert settings['options.package_data']['pyomo_fesd'] == 'py.typed'


@pytest.mark.parametrize('pattern', [PICTURE, LINK], ids=['pictures', 'links'])
def test_the_long_description_has_no_relative_addresses(pattern):
    """A package index shows README.md without the files of the repository beside it."""
    addresses = [''.join(match.groups('')) for match in pattern.finditer((ROOT / 'README.md').read_text())]
    assert [a for a in addresses if not a.startswith('https://')] == []


def test_the_source_distribution_holds_what_the_tests_read():
    manifest = (ROOT / 'MANIFEST.in').read_text()
    for folder in ('.ci', '.github', 'docs', 'examples', 'tests'):
        assert f'graft {folder}\n' in manifest
