"""Write conf/dataset/NAME.yaml for a volume of your own, with TFs suggested from its histogram."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.core.io import write_bytes

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from texgs.volume.transfer import TransferFunction


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The file, how to read it, and where TFs come from."""
    parser.add_argument("file", type=Path, help="volume, or folder of TIFF slices")
    parser.add_argument(
        "overrides",
        nargs="*",
        metavar="KEY=VALUE",
        help="keys of dataset.volume, such as dims=[256,256,128] dtype=uint8 spacing=[1,1,2] up=+z reduce=2",
    )
    parser.add_argument("--name", help="of the data set (the file's name)")
    parser.add_argument(
        "--count", type=int, help="number of basic TFs to suggest (as many as the histogram shows)"
    )
    parser.add_argument(
        "--tf", type=Path, nargs="+", metavar="FILE", help="basic TFs instead: JSON, or ParaView presets"
    )
    parser.add_argument("--force", action="store_true", help="replace a data set of that name")


def run(arguments: argparse.Namespace) -> int:
    """Read the volume, choose TFs, write the file and the plot, and say what comes next."""
    from texgs.cli.stage import ensure
    from texgs.config.compose import FOLDER, check_name
    from texgs.config.schema import BasicTF

    name = arguments.name or re.sub(r"[^A-Za-z0-9_]+", "_", arguments.file.name.split(".")[0])
    check_name("--name", name)
    target = FOLDER / "dataset" / f"{name}.yaml"
    if target.exists() and not arguments.force:
        raise ArgumentError(f"{target}: is there already; choose another --name, or replace it with --force")
    config = configuration(name, arguments.file, arguments.overrides)
    ensure("volume", config)
    basic = basic_tfs(config, arguments.tf, arguments.count)
    config.dataset.basic_tfs = {key: BasicTF([*tf.opacity], [*tf.color]) for key, tf in basic.items()}
    ensure("transfer", config)
    keys = {key: config.dataset.volume[key] for key in ("file", *changed(arguments.overrides))}
    write_bytes(target, document(name, keys, basic).encode())
    picture = Path(config.results, name, "transfer", "transfer.png")
    print(f"{target}: {len(basic)} basic TFs to edit; {picture} shows them")
    print(f"then: snakemake --cores all --config dataset={name}")
    return 0


def changed(overrides: list[str]) -> list[str]:
    """Names of the keys that were given."""
    return [word.partition("=")[0] for word in overrides]


def configuration(name: str, file: Path, overrides: list[str]) -> DictConfig:
    """The configuration as it will be with the new data set, but without basic TFs and tracking.

    Raises:
        ConfigError: if a key is unknown or has the wrong type.
    """
    from omegaconf import OmegaConf

    from texgs.config.compose import compose
    from texgs.config.schema import Dataset

    words = [f"dataset.volume.{word}" for word in overrides]
    blank = "dataset.volume.generator=null"
    config = compose(("tracking=none", blank, *words)).copy()
    OmegaConf.set_readonly(config, False)
    config.dataset.volume.file = str(file.absolute())
    fresh = OmegaConf.merge(
        OmegaConf.structured(Dataset(name=name)), {"title": name, "volume": config.dataset.volume}
    )
    config.dataset = fresh
    return config


def basic_tfs(config: DictConfig, files: list[Path] | None, count: int | None) -> dict[str, TransferFunction]:
    """TFs from files, or suggested from the volume's histogram.

    Raises:
        ArgumentError: if a file is no TF, or two overlap.
    """
    import numpy as np

    from texgs.core.io import read_json
    from texgs.volume.basic_tfs import check_disjoint
    from texgs.volume.suggest import suggest
    from texgs.volume.tf_files import read_tf

    summary = read_json(Path(config.results, config.dataset.name, "volume", "volume.json"))
    if files:
        basic = {f"TF{index + 1:02}": read_tf(path) for index, path in enumerate(files)}
        check_disjoint(basic)
        for path, tf in zip(files, basic.values(), strict=True):
            low, high = tf.support
            if high <= 1 < summary["maximum"]:
                raise ArgumentError(
                    f"{path}: expected values of the data, which go up to {summary['maximum']:g}, got a TF "
                    f"on [{low:g}, {high:g}]; rescale it to the data in ParaView first"
                )
        return basic
    return suggest(np.array(summary["histogram"]), summary["minimum"], summary["maximum"], count)


def document(name: str, volume: dict[str, Any], basic: Mapping[str, TransferFunction]) -> str:
    """The YAML of a data set, a line per list of points."""
    lines = [f"name: {name}", f"title: {name}", "volume:"]
    lines += [f"  {key}: {json.dumps(plain(value))}" for key, value in volume.items()]
    lines += [
        "# Points [value, opacity] and [value, r, g, b]; the ranges of basic TFs must not overlap.",
        "basic_tfs:",
    ]
    for key, tf in basic.items():
        lines.append(f"  {key}:")
        for part, points in tf.to_dict().items():
            rounded = [[float(f"{number:.6g}") for number in point] for point in points]
            lines.append(f"    {part}: {json.dumps(rounded)}")
    return "\n".join(lines) + "\n"


def plain(value: Any) -> Any:
    """A value of the configuration as JSON knows it."""
    return list(value) if hasattr(value, "__iter__") and not isinstance(value, str) else value
