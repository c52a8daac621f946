"""The notebooks run, from their first cell to the last; their own assertions hold."""

from importlib.util import find_spec
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[1] / 'docs' / 'notebooks'
EXTRA = "needs the extra: pip install -e '.[notebooks]'"
#: Notebook -> package that it needs besides.
NEEDS = {'first_steps': 'pyomo_fesd', 'flowsheet': 'idaes'}


def test_every_notebook_is_run():
    assert {path.stem for path in NOTEBOOKS.glob('*.ipynb')} == set(NEEDS)


@pytest.mark.parametrize('name', NEEDS)
def test_runs(name, monkeypatch):
    nbclient, nbformat = pytest.importorskip('nbclient', reason=EXTRA), pytest.importorskip('nbformat', reason=EXTRA)
    pytest.importorskip('ipykernel', reason=EXTRA)
    if find_spec(NEEDS[name]) is None:
        pytest.skip(f"needs {NEEDS[name]}")
    # the kernel imports the package of this repository
    monkeypatch.setenv('PYTHONPATH', str(NOTEBOOKS.parents[1]))
    notebook = nbformat.read(NOTEBOOKS / f'{name}.ipynb', as_version=4)
    assert not any(cell.get('outputs') for cell in notebook.cells), "outputs are not committed"
    nbclient.NotebookClient(notebook, timeout=300, resources={'metadata': {'path': str(NOTEBOOKS)}}).execute()
    kinds = [set(output.get('data', ())) for cell in notebook.cells for output in cell.get('outputs', ())]
    assert any('image/png' in kind for kind in kinds)
    texts = [output.get('text', '') for cell in notebook.cells for output in cell.get('outputs', ())]
    assert any('nothing to' in text or 'B-stationary' in text for text in texts)
