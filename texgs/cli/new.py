"""Write conf/dataset/NAME.yaml for a volume of your own, with transfer functions from its histogram."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Mapping
from dataclasses import asdict, replace
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.config.compose import compose
from texgs.config.dataset_text import as_yaml, plain_tf, require_read
from texgs.config.project import check_name
from texgs.core.errors import ArgumentError, ConfigError, TexgsError
from texgs.core.io import is_there, write_bytes
from texgs.core.memory import room_for_volume

if TYPE_CHECKING:
    from texgs.config.dataset import BasicTF, Dataset, Volume
    from texgs.config.schema import Config
    from texgs.volume.axes import Channel
    from texgs.volume.slabs import Source
    from texgs.volume.transfer import TransferFunction

NO_NAME = re.compile(r"[^A-Za-z0-9_]+")  # what a name of a data set cannot have
LARGEST_SAMPLE = 4  # bytes of one in a prepared volume
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
    parser.add_argument("--force", action="store_true", help="replace a data set of that name")


def run(arguments: argparse.Namespace) -> int:
    """Make a data set of the volume, with all its channels, and say what comes next."""
    from texgs.config.project import members, own_folder, shown
    from texgs.volume.tf_files import read_tf
    from texgs.workflow.locate import series_files

    if arguments.count is not None and arguments.count < 1:
        raise ArgumentError(f"--count: expected at least 1, got {arguments.count}")
    for path in arguments.tf or ():
        read_tf(path)  # a mistake in it is told before the volume is read
    name = arguments.name or NO_NAME.sub("_", arguments.file.name.split(".")[0])
    given = configuration(name, arguments.file, arguments.overrides)
    given = replace(given, dataset=replace(given.dataset, series=[*map(absolute, arguments.series)]))
    series_files(given)
    folder = own_folder() / "dataset"
    check_name("--name", name)
    if name in members("dataset") and not arguments.force:
        is_own = (folder / f"{name}.yaml").exists()
        there, do = ("is there", "replace") if is_own else ("is a data set of texgs", "hide")
        raise ArgumentError(f"{name}: {there} already; choose another --name, or {do} it with --force")
    field, keys = array_of(given.dataset.volume), changed(arguments.overrides)
    channels = channels_of(given.dataset.volume, field)
    if field and "reduce" not in keys:
        given = reduced(given, field, len(channels))
        keys += ["reduce"] if given.dataset.volume.reduce > 1 else []
    dataset = with_tfs(given, channels, arguments)
    text = document(dataset, ["file", *keys])
    require_read(text, dataset)
    target = write_bytes(folder / f"{name}.yaml", text.encode())
    count, picture = len(dataset.basic_tfs), Path(given.results, name, "transfer", "transfer.png")
    of = f" of the channels {', '.join(channels)}" if dataset.channels else ""
    print(f"{shown(target)}: {count} transfer functions{of} to edit; {picture} shows them")
    print(f"then: texgs run dataset={name} fit=quick")
    return 0


def array_of(volume: Volume) -> Source | None:
    """Return the array in a file of arrays; nothing of it is read. None of other formats, and of mistakes."""
    from texgs.volume.sources import holds_arrays
    from texgs.workflow.stages.volume import source

    path = Path(volume.file or "")
    if not holds_arrays(path):
        return None
    for channel in (volume.channel or "0", volume.channel):
        try:
            return source(replace(volume, channel=channel), path)
        except TexgsError:  # it has no channels; what else is wrong with it is told when it is read
            pass
    return None


def reduced(config: Config, field: Source, count: int) -> Config:
    """Return a configuration with which so many channels take half of the free memory at most; tell it."""
    from texgs.volume.prepare import bounds_of

    dataset, volume = config.dataset, config.dataset.volume
    samples = prod(end - start for start, end in bounds_of(field.dims, volume.crop))
    size, factor = count * samples * min(field.dtype.itemsize, LARGEST_SAMPLE), 1
    room = max(room_for_volume(), 1)
    while size > room * factor**3:
        factor *= 2
    if factor > 1:
        sys.stderr.write(
            f"{dataset.name}: its samples would take more than half of the memory that is free, so that each "
            f"side is made {factor} times smaller; reduce=1 keeps all\n"
        )
    return replace(config, dataset=replace(dataset, volume=replace(volume, reduce=factor)))


def channels_of(volume: Volume, field: Source | None) -> dict[str, Channel | None]:
    """Return what the file says of channels by their labels or numbers; of the one to read, by ""."""
    if field is None or volume.channel or len(field.channels) < 2:
        return {"": None if field is None else field.channel}
    keys = [channel.label for channel in field.channels]
    if "" in keys or len({NO_NAME.sub("_", key) for key in keys}) < len(keys):
        keys = [str(number) for number in range(len(keys))]
    return dict(zip(keys, field.channels, strict=True))


def with_tfs(config: Config, channels: dict[str, Channel | None], arguments: argparse.Namespace) -> Dataset:
    """Read the volume, choose TFs of its channels, draw them, and return the data set."""
    from texgs.config.dataset import BasicTF
    from texgs.volume.summaries import read_summaries
    from texgs.workflow.checks import check_basic_tfs, check_channels
    from texgs.workflow.execution import ensure
    from texgs.workflow.stage_table import STAGES

    dataset = config.dataset
    if len(channels) > 1:
        dataset = replace(dataset, basic_tfs={key: BasicTF(channel=key) for key in channels})
        check_channels(dataset)
    ensure(STAGES["volume"], replace(config, dataset=dataset))
    known = read_summaries(Path(config.results, dataset.name, "volume", "volume.nrrd"))
    if len(channels) > 1:
        listed = of_each(known, channels, arguments)
    else:
        basic = basic_tfs(dataset.name, known[""], channels[""], arguments.tf, arguments.count)
        listed = {key: BasicTF(**tf.to_dict()) for key, tf in basic.items()}
    dataset = replace(dataset, basic_tfs=listed)
    ensure(STAGES["transfer"], replace(config, dataset=dataset))
    check_basic_tfs(dataset)
    return dataset


def of_each(
    known: Mapping[str, Any], channels: Mapping[str, Channel | None], arguments: argparse.Namespace
) -> dict[str, BasicTF]:
    """Return TFs of all channels, named by their labels: one of each, unless a count says otherwise."""
    from texgs.config.dataset import BasicTF
    from texgs.volume.suggest import COLORS, windowed

    files = arguments.tf
    if files and len(files) != len(channels):
        raise ArgumentError(
            f"--tf: expected a file for each of the channels {', '.join(channels)}, got {len(files)}"
        )
    listed, names = {}, tf_names(list(channels))
    for number, (key, channel) in enumerate(channels.items()):
        has_look = channel and windowed(channel, known[key]["minimum"], known[key]["maximum"])
        count = arguments.count or (None if has_look else 1)
        basic = basic_tfs(key, known[key], channel, files and files[number : number + 1], count)
        for name, tf in basic.items():
            if len(basic) == 1 and count and not files:
                tf = tf.with_points(tf.opacity, [(tf.support[0], *COLORS[number % len(COLORS)])])
            whole = names[number] if len(basic) == 1 else f"{names[number]}_{name}"
            listed[whole] = BasicTF(**tf.to_dict(), channel=key)
    return listed


def tf_names(labels: list[str]) -> list[str]:
    """Return names of TFs like the labels of channels, or with their numbers where these cannot be names."""
    names = [NO_NAME.sub("_", label) for label in labels]
    names = [name if name[:1].isalpha() else f"channel_{name}" for name in names]
    try:
        for name in names:
            check_name("dataset.basic_tfs", name)
    except ConfigError:
        names = []
    return names if len(set(names)) == len(labels) else [f"channel_{k}" for k in range(len(labels))]


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


def basic_tfs(
    of: str, summary: Mapping[str, Any], channel: Channel | None, files: list[Path] | None, count: int | None
) -> dict[str, TransferFunction]:
    """Return TFs from files, or suggested for a channel or from the histogram in a summary."""
    import numpy as np

    from texgs.volume.suggest import looks_like_labels, suggest
    from texgs.volume.tf_files import read_tf
    from texgs.volume.transfer import check_disjoint

    low, high = summary["minimum"], summary["maximum"]
    if not files:
        histogram = np.array(summary["histogram"])
        suggested = suggest(histogram, low, high, count, channel)
        if looks_like_labels(histogram) and np.dtype(summary["dtype"]).kind == "f":
            sys.stderr.write(
                f"{of}: values are in {np.count_nonzero(histogram)} of {len(histogram)} "
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


def document(dataset: Dataset, keys: list[str]) -> str:
    """Return the YAML of a data set, with some keys of its volume; a line per list of points."""
    values = asdict(dataset)
    names = ("name", "title", "volume", *(["series"] if dataset.series else []), "basic_tfs")
    values["basic_tfs"] = {name: plain_tf(tf) for name, tf in dataset.basic_tfs.items()}
    written = {key: values[key] for key in names}
    written["volume"] = {key: value for key in keys if (value := values["volume"][key]) is not None}
    which = "basic TFs of one channel" if dataset.channels else "basic TFs"
    note = f"# Points are [value, opacity] and [value, r, g, b]; the ranges of {which} must not overlap.\n"
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
