"""Run the notebooks of the documentation, and keep of their outputs what a repository can hold.

`python -m tools.notebooks docs/notebooks/*.ipynb` replaces the files. Pages of scenes, of megabytes, are left
out in favour of their pictures; what programs say on stderr is left out, too.
"""

import argparse
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

LARGEST = 300_000  # letters of an output that stays
SECONDS = 1800  # of one cell


def executed(path: Path, folder: Path, parameters: str = "") -> nbformat.NotebookNode:
    """Return a notebook that was run in a folder; lines take the place of its cell of parameters."""
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        if parameters and "parameters" in cell.metadata.get("tags", []):
            cell.source = parameters
    NotebookClient(notebook, timeout=SECONDS, resources={"metadata": {"path": str(folder)}}).execute()
    return notebook


def small(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """Return a notebook without large outputs, what was said on stderr, and times of cells."""
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        outputs = [each for each in cell.get("outputs", []) if each.get("name") != "stderr"]
        for each in outputs:
            data = each.get("data", {})
            for kind in [kind for kind, text in data.items() if len(text) > LARGEST]:
                del data[kind]
        if "outputs" in cell:
            cell.outputs = outputs
    return notebook


def main() -> None:
    """Run the notebooks and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("notebooks", nargs="+", type=Path)
    for path in parser.parse_args().notebooks:
        with tempfile.TemporaryDirectory() as folder:
            nbformat.write(small(executed(path, Path(folder))), path)
            print(path)


if __name__ == "__main__":
    main()
