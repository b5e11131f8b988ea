"""Write conf/dataset/NAME.yaml for a volume of your own, with transfer functions from its histogram."""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.compose import compose
from texgs.config.dataset_text import as_yaml, require_read
from texgs.core.errors import ArgumentError
from texgs.core.io import is_there, read_json, write_bytes

if TYPE_CHECKING:
    from texgs.config.schema import Config
    from texgs.volume.transfer import TransferFunction

PROJECT = Path(__file__).parent / "project"  # what a new one has; `gitignore` gets a dot in front


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the file, how to read it, and where transfer functions come from."""
    parser.add_argument("file", type=Path, help="volume, or folder of TIFF or DICOM slices")
    parser.add_argument(
        "overrides",
        nargs="*",
        metavar="KEY=VALUE",
        help="keys of dataset.volume, such as dims=[256,256,128] dtype=uint8 spacing=[1,1,2] up=+z reduce=2",
    )
    parser.add_argument(
        "--series",
        nargs="+",
        default=[],
        metavar="FILE",
        help="steps of a series in time, such as 'step_*.nrrd'; the volume is one of them",
    )
    parser.add_argument("--name", help="of the data set (the file's name)")
    parser.add_argument(
        "--count", type=int, help="number of transfer functions to suggest (as many as the histogram shows)"
    )
    parser.add_argument(
        "--tf",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="transfer functions to take instead: JSON, or ParaView presets",
    )
    parser.add_argument("--force", action="store_true", help="replace a data set of that name")


def run(arguments: argparse.Namespace) -> int:
    """Read the volume, choose TFs, write the file and the plot, and say what comes next."""
    from texgs.config.dataset import BasicTF
    from texgs.config.project import check_name, members, own_folder, shown
    from texgs.volume.tf_files import read_tf
    from texgs.workflow.checks import check_basic_tfs
    from texgs.workflow.execution import ensure
    from texgs.workflow.locate import series_files
    from texgs.workflow.stage_table import STAGES

    name = arguments.name or re.sub(r"[^A-Za-z0-9_]+", "_", arguments.file.name.split(".")[0])
    check_name("--name", name)
    target = own_folder() / "dataset" / f"{name}.yaml"
    if name in members("dataset") and not arguments.force:
        there, do = ("is there", "replace") if target.exists() else ("is a data set of texgs", "hide")
        raise ArgumentError(f"{name}: {there} already; choose another --name, or {do} it with --force")
    if arguments.count is not None and arguments.count < 1:
        raise ArgumentError(f"--count: expected at least 1, got {arguments.count}")
    for path in arguments.tf or ():
        read_tf(path)  # a mistake in it is told before the volume is read
    config = configuration(name, arguments.file, arguments.overrides)
    config = replace(config, dataset=replace(config.dataset, series=[*map(absolute, arguments.series)]))
    series_files(config)
    ensure(STAGES["volume"], config)
    basic = basic_tfs(config, arguments.tf, arguments.count)
    listed = {key: BasicTF(**tf.to_dict()) for key, tf in basic.items()}
    config = replace(config, dataset=replace(config.dataset, basic_tfs=listed))
    ensure(STAGES["transfer"], config)
    text = document(config, ["file", *changed(arguments.overrides)])
    check_basic_tfs(config.dataset)
    require_read(text, config.dataset)
    write_bytes(target, text.encode())
    picture = Path(config.results, name, "transfer", "transfer.png")
    print(f"{shown(target)}: {len(basic)} transfer functions to edit; {picture} shows them")
    print(f"then: texgs run dataset={name} fit=quick")
    return 0


def changed(overrides: list[str]) -> list[str]:
    """Return the names of the keys that were given."""
    return [word.partition("=")[0].lstrip("+").split(".")[0] for word in overrides]


def configuration(name: str, file: Path, overrides: list[str]) -> Config:
    """Return the configuration as it will be with the new data set, but without basic TFs and tracking."""
    from texgs.config.dataset import Dataset, Volume

    path = absolute(file)
    words = [f"dataset.volume.{word}" for word in ("generator=null", *overrides)]
    config = compose(("tracking=none", *words))
    given = {key: getattr(config.dataset.volume, key) for key in changed(overrides)}
    return replace(config, dataset=Dataset(name=name, title=name, volume=Volume(**{**given, "file": path})))


def absolute(file: str | Path) -> str:
    """Return a path as configurations hold it; its last part may be a pattern."""
    path = str(Path(file).parent.resolve() / Path(file).name)
    if "${" in path:
        raise ArgumentError(f"{path}: expected a path without ${{, which stands for another key; rename it")
    if any("\ud800" <= letter <= "\udfff" for letter in path):
        raise ArgumentError(f"{path!r}: expected a path in UTF-8; rename it")
    return path


def basic_tfs(config: Config, files: list[Path] | None, count: int | None) -> dict[str, TransferFunction]:
    """Return TFs from files, or suggested from the volume's histogram."""
    import numpy as np

    from texgs.volume.suggest import looks_like_labels, suggest
    from texgs.volume.tf_files import read_tf
    from texgs.volume.transfer import check_disjoint

    summary = read_json(Path(config.results, config.dataset.name, "volume", "volume.json"))
    low, high = summary["minimum"], summary["maximum"]
    if not files:
        histogram = np.array(summary["histogram"])
        suggested = suggest(histogram, low, high, count)
        if looks_like_labels(histogram) and np.dtype(summary["dtype"]).kind == "f":
            sys.stderr.write(
                f"{config.dataset.name}: values are in {np.count_nonzero(histogram)} of {len(histogram)} "
                f"parts of [{low:g}, {high:g}], and are taken for labels; if one of them stands for missing "
                "samples, write NaN in its place and add nan_value=...\n"
            )
        return {name: tf.rounded(low, high) for name, tf in suggested.items()}
    basic = {f"TF{index + 1:02}": read_tf(path) for index, path in enumerate(files)}
    check_disjoint(basic)
    for path, tf in zip(files, basic.values(), strict=True):
        first, last = tf.support
        if last <= 1 < high:
            raise ArgumentError(
                f"{path}: expected values of the data, which go up to {high:g}, got a TF "
                f"on [{first:g}, {last:g}]; rescale it to the data in ParaView first"
            )
    return basic


def document(config: Config, keys: list[str]) -> str:
    """Return the YAML of a data set, with some keys of its volume; a line per list of points."""
    dataset = asdict(config.dataset)
    names = ("name", "title", "volume", *(["series"] if dataset["series"] else []), "basic_tfs")
    written = {key: dataset[key] for key in names}
    written["volume"] = {key: dataset["volume"][key] for key in keys}
    note = "# Points are [value, opacity] and [value, r, g, b]; the ranges of basic TFs must not overlap.\n"
    return note + as_yaml(written)


def add_init_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the folder."""
    parser.add_argument("folder", type=Path, help="new or empty")


def run_init(arguments: argparse.Namespace) -> int:
    """Start a project: a folder with your own configurations, in which `texgs new` and `texgs run` work."""
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
    for file in sorted(path for path in PROJECT.rglob("*") if path.is_file()):
        name = file.relative_to(PROJECT).as_posix().replace("gitignore", ".gitignore")
        write_bytes(folder / name, file.read_bytes())
    print(f"{folder}: a new project, see {folder / 'README.md'}")
    return 0
