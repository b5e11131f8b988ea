"""Write conf/dataset/NAME.yaml for a volume of your own, with transfer functions from its histogram."""

from __future__ import annotations

import argparse
import sys
from contextlib import suppress
from dataclasses import asdict, replace
from math import prod
from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING

from texgs.cli.new_labels import (
    KIND_KEYS,
    as_labels,
    found_in,
    with_chosen,
    without_lists,
)
from texgs.cli.new_tfs import read_volume, with_tfs
from texgs.cli.options import require_only_files
from texgs.config.compose import compose
from texgs.config.dataset_text import as_yaml, plain_tf, require_read
from texgs.config.project import FORBIDDEN_LETTERS, check_name, name_of
from texgs.core.errors import ArgumentError, TexgsError
from texgs.core.io import is_there, write_bytes
from texgs.core.memory import room_for_volume
from texgs.volume.settings import VolumeKeys

if TYPE_CHECKING:
    from texgs.config.dataset import Dataset
    from texgs.config.schema import Config
    from texgs.volume.axes import Channel
    from texgs.volume.slabs import Source

SAMPLE_BYTES = 4  # at most, in a prepared volume
PROJECT = Path(__file__).parent / "project"  # files of a new project; `gitignore` gets a dot in front


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
        "--count",
        type=int,
        help="number of transfer functions to suggest (what the histogram shows, or one for each channel)",
    )
    parser.add_argument(
        "--tf",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="transfer functions to take instead: JSON, or ParaView presets",
    )
    table = "names and colours of labels: a table of ITK-SNAP, FreeSurfer or 3D Slicer"
    parser.add_argument("--names", type=Path, metavar="FILE", help=table)
    parser.add_argument("--force", action="store_true", help="replace a data set of that name")


def run(arguments: argparse.Namespace) -> int:
    """Make a data set of the volume, with all its channels, and say what comes next."""
    from texgs.config.project import members, own_folder, short_path
    from texgs.volume.sources import tells_labels, tells_superior
    from texgs.workflow.locate import series_files

    check_options(arguments)
    name = arguments.name or name_of(arguments.file)
    overrides = [word.removeprefix("dataset.volume.") for word in arguments.overrides]
    overrides, arguments.labels = without_lists(overrides)
    if "up" not in keys_in(overrides) and tells_superior(arguments.file):
        overrides.append("up=+z")
    given = configuration(name, arguments.file, overrides)
    given = replace(given, dataset=replace(given.dataset, series=[*map(absolute, arguments.series)]))
    files, folder = series_files(given), own_folder() / "dataset"
    check_name("--name" if arguments.name else f"{arguments.file.name}: pass --name", name)
    if name in members("dataset") and not arguments.force:
        is_own = (folder / f"{name}.yaml").exists()
        there, do = ("is there", "replace") if is_own else ("is a data set of texgs", "hide")
        raise ArgumentError(f"{name}: {there} already; choose another --name, or {do} it with --force")
    keys = keys_in(overrides)
    has_labels = arguments.names or arguments.labels or tells_labels(arguments.file)
    if has_labels and KIND_KEYS.isdisjoint(keys):
        given = as_labels(given)
    dataset = data_set(given, files, keys, arguments)
    text = document(dataset, keys)
    require_read(text, dataset)
    target = write_bytes(folder / f"{name}.yaml", text.encode())
    count, picture = len(dataset.basic_tfs), Path(given.results, name, "transfer", "transfer.png")
    of = f" of the channels {', '.join(dataset.channels)}" if dataset.channels else ""
    functions = "transfer function" if count == 1 else "transfer functions"
    print(f"{short_path(target)}: {count} {functions}{of} to edit; {picture} shows them")
    print(f"then: texgs run dataset={name} fit=quick")
    return 0


def data_set(config: Config, files: list[Path], keys: list[str], arguments: argparse.Namespace) -> Dataset:
    """Read as much of a volume as memory has room for, and return its data set with TFs."""
    from texgs.edit.series import moments_of
    from texgs.volume.label_choice import has_few_values, holds_labels

    volume = config.dataset.volume
    field = array_of(volume)
    channels = channels_of(volume, field)
    if not channels and (arguments.tf or arguments.count):
        word = "--tf" if arguments.tf else "--count"
        raise ArgumentError(f"{word}: expected none, as each label has a function; labels=[...] chooses some")
    if len(files) == 1 and len(channels) < 2:
        moments_of(files, volume)  # of a file or folder that has several
    found = found_in(config.dataset, arguments.names, next(iter(channels), None) or volume.channel)
    if field and "reduce" not in keys:
        config = with_room(config, field, len(channels), len(arguments.labels or found))
    config = replace(config, dataset=with_chosen(config.dataset, found, arguments.labels, len(channels)))
    known = read_volume(config, channels)
    if len(channels) == 1 and KIND_KEYS.isdisjoint(keys) and has_few_values(known[""]):
        output = Path(config.results, config.dataset.name, "volume")
        if not (files or arguments.tf or arguments.count) and holds_labels(output / "volume.nrrd"):
            rmtree(output)  # of the same samples as values
            return data_set(as_labels(config), files, keys, arguments)
        sys.stderr.write(
            f"{config.dataset.name}: values are as few as those of labels, but read as an image: between two "
            "of them rays see those in between, as thin shells; kind=labels shows labels\n"
        )
    return with_tfs(config, known, channels, arguments)


def check_options(arguments: argparse.Namespace) -> None:
    """Require options that go together and readable files of functions, before a volume is read."""
    from texgs.volume.tf_files import read_tf

    if arguments.count is not None and arguments.count < 1:
        raise ArgumentError(f"--count: expected at least 1, got {arguments.count}")
    if arguments.tf and arguments.count is not None:
        raise ArgumentError("--count: expected none beside --tf, whose files are the functions; leave it out")
    require_only_files([*arguments.series, *map(str, arguments.tf or ())])
    if any(word.removeprefix("dataset.volume.").startswith("file=") for word in arguments.overrides):
        raise ArgumentError(
            f"file=...: expected {arguments.file}, in front, to be the only file; leave it out"
        )
    for path in arguments.tf or ():
        read_tf(path)


def array_of(volume: VolumeKeys) -> Source | None:
    """Return the array of a file of arrays, unread; None of other formats and of mistakes."""
    from texgs.volume.settings import open_field
    from texgs.volume.sources import holds_arrays

    path = Path(volume.file or "")
    if not holds_arrays(path):
        return None
    for channel in (volume.channel or "0", volume.channel):
        with suppress(TexgsError):  # it has no channels; other mistakes are told on reading
            return open_field(replace(volume, channel=channel), path)
    return None


def with_room(config: Config, field: Source, channels: int, labels: int) -> Config:
    """Return a configuration whose channels and masks take at most half of the free memory; say how."""
    from texgs.volume.basic_tfs import MAX_CHANNELS
    from texgs.volume.prepare import bounds_of

    dataset, volume = config.dataset, config.dataset.volume
    samples = prod(end - start for start, end in bounds_of(field.dims, volume.crop))
    masks = min(labels, MAX_CHANNELS - channels)  # of a byte each
    size, factor = samples * (channels * min(field.dtype.itemsize, SAMPLE_BYTES) + masks), 1
    room = max(room_for_volume(), 1)
    while size > room * factor**3:
        factor *= 2
    if factor > 1:
        sys.stderr.write(
            f"{dataset.name}: its samples would take more than half of the memory that is free, so that each "
            f"side is made {factor} times smaller; reduce=1 keeps all\n"
        )
    return replace(config, dataset=replace(dataset, volume=replace(volume, reduce=factor)))


def channels_of(volume: VolumeKeys, field: Source | None) -> dict[str, Channel | None]:
    """Return the channels of a file by label or number; by "" where one is read; none of labels."""
    if volume.kind == "labels":
        return {}
    if field is None or volume.channel or len(field.channels) < 2:
        return {"": None if field is None else field.channel}
    keys = [channel.label for channel in field.channels]
    if "" in keys or len({FORBIDDEN_LETTERS.sub("_", key) for key in keys}) < len(keys):
        keys = [str(number) for number in range(len(keys))]
    return dict(zip(keys, field.channels, strict=True))


def keys_in(overrides: list[str]) -> list[str]:
    """Return the names of the keys that were given."""
    return [word.partition("=")[0].lstrip("+").split(".")[0] for word in overrides]


def configuration(name: str, file: Path, overrides: list[str]) -> Config:
    """Return the configuration of the new data set, without basic TFs and tracking."""
    from texgs.config.dataset import dataset_of

    words = [f"dataset.volume.{word}" for word in ("generator=null", *overrides)]
    config = compose(("tracking=none", *words))
    given = {key: getattr(config.dataset.volume, key) for key in keys_in(overrides)}
    if given.get("labels"):
        given["labels"] = absolute(given["labels"])
    return replace(config, dataset=dataset_of(name, absolute(file), **given))


def absolute(file: str | Path) -> str:
    """Return a path for a configuration; its last part may be a pattern."""
    path = str(Path(file).parent.resolve() / Path(file).name)
    if "${" in path:
        raise ArgumentError(f"{path}: expected a path without ${{, which stands for another key; rename it")
    if any("\ud800" <= letter <= "\udfff" for letter in path):
        do = "rename it" if sys.getfilesystemencoding() == "utf-8" else "set PYTHONUTF8=1"
        raise ArgumentError(f"{path!r}: expected a path that Python reads as UTF-8; {do}")
    return path


def document(dataset: Dataset, keys: list[str]) -> str:
    """Return the YAML of a data set, with some keys of its volume; a line per list of points."""
    values = asdict(dataset)
    names = ("name", "title", "volume", *(["series"] if dataset.series else []), "basic_tfs")
    values["basic_tfs"] = {name: plain_tf(tf) for name, tf in dataset.basic_tfs.items()}
    written = {key: values[key] for key in names}
    volume, default = values["volume"], asdict(VolumeKeys())
    found = [key for key in ("kind", "reduce", "label_numbers") if volume[key] != default[key]]
    written["volume"] = {k: volume[k] for k in ["file", *keys, *found] if volume[k] is not None}
    which = "basic TFs of one channel" if dataset.channels else "basic TFs"
    note = f"# Points are [value, opacity] and [value, r, g, b]; the ranges of {which} must not overlap.\n"
    if dataset.labels:
        note += "# Values of a label are 0 to 255, and from 127.5 on inside it.\n"
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
    names = [path.name for path in folder.iterdir()] if folder.is_dir() else ["a file"]
    if folder.exists() and names:
        got = ", ".join(sorted(names)[:3])
        raise ArgumentError(f"{folder}: expected a new or empty folder, got {got}; choose another name")
    for file in sorted(path for path in PROJECT.rglob("*") if path.is_file()):
        name = file.relative_to(PROJECT).as_posix().replace("gitignore", ".gitignore")
        write_bytes(folder / name, file.read_bytes())
    print(f"{folder}: a new project, see {folder / 'README.md'}")
    return 0
