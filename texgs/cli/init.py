"""Start a project: a folder with configurations of your own, in which `texgs new` and `texgs run` work."""

import argparse
from pathlib import Path

from texgs.core.errors import ArgumentError
from texgs.core.io import is_there, write_bytes

README = """\
# A project of texgs

Run all commands in this folder:

    texgs new VOLUME --name NAME       # writes conf/dataset/NAME.yaml, with suggested transfer functions
    texgs run dataset=NAME fit=quick   # from the volume to results/report.html
    texgs run experiment=demo          # the same with a small generated volume
    texgs views --help                 # all data sets, recipes and keys

`conf/` holds what is yours. A file there comes before the file of texgs with the same name:

    conf/dataset/NAME.yaml       a volume and its transfer functions    dataset=NAME
    conf/edit/NAME.yaml          a new look                             edit=NAME
    conf/experiment/NAME.yaml    values of any keys; see example.yaml   experiment=NAME

`texgs run` makes its own files in `results/` again. Before you remove the folder, copy what only you have:
`results/study`, `results/mlflow.db`, and scenes and looks that you saved there.
"""
EXAMPLE = """\
# @package _global_
# Values that belong together: texgs run experiment=example
defaults:
  - override /dataset: turbulence # a file of conf/dataset: yours, or one of texgs
  - override /views: small
  - override /fit: demo
edits: [gold] # files of conf/edit
"""
FILES = {
    "README.md": README,
    "conf/dataset/README.md": "Data sets: `texgs new VOLUME --name NAME` writes NAME.yaml here.\n",
    "conf/edit/README.md": "New looks: NAME.yaml is chosen with `edit=NAME`.\n",
    "conf/experiment/example.yaml": EXAMPLE,
    ".gitignore": "/results/\n/.snakemake/\n",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The folder."""
    parser.add_argument("folder", type=Path, help="new or empty")


def run(arguments: argparse.Namespace) -> int:
    """Write the files of a project, unless it is one already."""
    folder: Path = arguments.folder
    if is_there(folder / "conf" / "dataset"):
        print(f"{folder}: is a project already")
        return 0
    if folder.exists() and not folder.is_dir():
        raise ArgumentError(f"{folder}: expected a new or empty folder, got a file; choose another name")
    if folder.is_dir() and (names := sorted(path.name for path in folder.iterdir())):
        raise ArgumentError(
            f"{folder}: expected a new or empty folder, got one with {', '.join(names[:3])}; choose another"
        )
    for name, text in FILES.items():
        write_bytes(folder / name, text.encode())
    print(f"{folder}: a new project, see {folder / 'README.md'}")
    return 0
