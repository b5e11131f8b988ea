"""The notebooks of the documentation run with small data, and what is left of them needs no kernel."""

import os
import re
import sys
from pathlib import Path

import nbformat
import pytest
from nbconvert import HTMLExporter

from tools.notebooks import LARGEST, executed, small

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SMALL = {
    "sweep": "size, iterations, folder = 32, 20, 'results'",
    "style_and_compare": "samples, size, recipe, style = 24, 64, 'demo', 'preview'",
    "volume_to_scene": "samples, size, recipe = 24, 48, 'demo'",
}
RECIPE = (
    "defaults: [default]\nname: {}\nseeds: {{count: 400}}\n"
    "shading: {{iterations: 60, densify: {{stop: 40, every: 20}}}}\ntexture: {{sweeps: 1}}\n"
)
# In place of the files of these names: few views and iterations.
FILES = {
    "views/default": "train: {kind: icosphere, frequency: 1}\ntest: {kind: spiral, count: 12}\nrelit: 3\n",
    "sweep/views": "name: views\nvariants:\n  few: [views.test.count=6]\n  more: [views.train.frequency=2]\n",
    **{f"fit/{name}": RECIPE.format(name) for name in ("demo", "quick")},
}


@pytest.mark.docs
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs(path, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    for name, text in FILES.items():
        file = tmp_path / "conf" / f"{name}.yaml"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    notebook = executed(path, tmp_path, SMALL[path.stem])
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert not [output for output in outputs if output.output_type == "error"]
    pages = [output.data for output in outputs if "srcdoc" in output.get("data", {}).get("text/html", "")]
    assert bool(pages) == (path.stem != "sweep")
    if pages:
        html, _ = HTMLExporter().from_notebook_node(notebook)
        assert html.count(' srcdoc="') == len(pages)
    assert all(len(text) <= LARGEST for cell in small(notebook).cells for text in texts(cell))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_file_has_pictures_and_nothing_of_a_machine(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    kinds = [
        kind for cell in notebook.cells for each in cell.get("outputs", []) for kind in each.get("data", {})
    ]
    assert {"image/png", "image/jpeg"} & set(kinds), "run python -m tools.notebooks on it"
    assert not re.search(r"/(tmp|home|root|work)/", path.read_text(encoding="utf-8"))
    assert all(cell.execution_count for cell in notebook.cells if cell.cell_type == "code")


def texts(cell):
    """What the outputs of a cell hold."""
    return [text for output in cell.get("outputs", []) for text in output.get("data", {}).values()]
