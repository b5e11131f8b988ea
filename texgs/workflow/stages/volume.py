"""Stage `volume`: make or read a scalar field, check it, and write the one file that later stages read."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.config.dataset import Volume
from texgs.core.errors import ArgumentError
from texgs.core.memory import GIB, MIB, free_memory
from texgs.core.progress import progress
from texgs.report.results import VolumeResult
from texgs.workflow.inputs import has_volume, without
from texgs.workflow.locate import cached_volume, source_file
from texgs.workflow.stage import Config, Outcome, Rule, Stage, plain, read
from texgs.workflow.stages.settings import OfDataset

if TYPE_CHECKING:
    from texgs.volume.slabs import Source
    from texgs.volume.summaries import Summary

TOLD = ("dims", "dtype", "spacing", "origin", "minimum", "maximum", "voxels")  # in metrics.json, too


@dataclass(kw_only=True)
class Settings(OfDataset):
    """What the stage reads of the configuration."""

    volume: Volume = read(lambda config: without(config.dataset.volume, "obtain"))
    channels: list[str] = read("dataset.channels")


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write volume.nrrd, which ParaView opens too, and volume.json: lattice, ranges and histograms.

    It reads `source`, the volume's file, where it is not generated.
    """
    from texgs.volume.summaries import write_summaries

    volume, target = settings.volume, output / "volume.nrrd"
    channels = [replace(volume, channel=channel) for channel in settings.channels] or [volume]
    fields = [source(channel, inputs.get("source")) for channel in channels]
    shown = partial(progress, title=f"{settings.dataset}: volume", unit="slab")
    summaries = prepared(volume, fields, target, shown)
    if fields[0].note:
        sys.stderr.write(f"{settings.dataset}: {fields[0].note}\n")
    write_summaries(target, summaries, settings.channels)
    ends = min(each.minimum for each in summaries), max(each.maximum for each in summaries)
    whole = replace(summaries[0], minimum=ends[0], maximum=ends[1])
    told, size = {name: plain(getattr(whole, name)) for name in TOLD}, target.stat().st_size
    if size > (free := free_memory()):
        sys.stderr.write(
            f"{settings.dataset}: the volume has {size / GIB:.3g} GiB, but {free / GIB:.3g} GiB of memory "
            "are free: rays would read it from the disk again and again; "
            f"dataset.volume.reduce={2 * volume.reduce} makes it smaller\n"
        )
    return Outcome(VolumeResult(**told, volume_mib=size / MIB))


def prepared(volume: Volume, fields: Sequence[Source], target: Path, shown: Any = None) -> list[Summary]:
    """Write the canonical file of the channels of a field as settings say."""
    from texgs.volume.prepare import prepare_channels

    return prepare_channels(
        *(fields, target),
        crop=volume.crop and tuple(volume.crop),  # type: ignore[arg-type]
        reduce=volume.reduce,
        method=volume.method,
        up=volume.up,
        nan_value=volume.nan_value,
        progress=shown,
    )


def generated(volume: Volume) -> Source:
    """Return the field of a generator, at its time where it changes."""
    from texgs.volume.generate import GENERATORS, RANDOM, SERIES
    from texgs.volume.slabs import ArraySource

    name, last = str(volume.generator), volume.steps - 1
    options: dict[str, Any] = {"seed": volume.seed} if name in RANDOM else {}
    if volume.time > last or (last and name not in SERIES):
        expected = f"a step from 0 to {last}" if name in SERIES else "steps=1"
        raise ArgumentError(
            f"volume: expected {expected} of {name}, got time={volume.time} steps={volume.steps}"
        )
    if name in SERIES:
        options["time"] = volume.time / max(last, 1)
    return ArraySource({**GENERATORS, **SERIES}[name](volume.size, **options), name)


def source(volume: Volume, path: Path | None) -> Source:
    """Return the field of a file, or that of the generator.

    A file that was downloaded is compared with its checksum.
    """
    if path is None:
        return generated(volume)
    from texgs.volume.download import require_whole
    from texgs.volume.sources import open_source

    if volume.url and path == cached_volume(volume):
        require_whole(path, volume.sha256 or "")
    given = {"dims": volume.dims, "spacing": volume.spacing, "origin": volume.origin}
    said: dict[str, Any] = {name: values and tuple(values) for name, values in given.items()}
    said |= {"dtype": volume.dtype, "endian": volume.endian, "skip": volume.skip}
    said |= {"series": volume.series, "variable": volume.variable, "column": volume.column}
    said |= {"image": volume.image, "channel": volume.channel, "time": volume.time}
    return open_source(path, **said)


def inputs(config: Config) -> dict[str, Path]:
    """Return the volume's file, where there is one."""
    path = source_file(config)
    return {} if path is None else {"source": path}


STAGE = Stage(
    "volume",
    order=10,
    help="make or read the volume of a data set, and check it",
    rule=Rule("volume", "{dataset}/volume", ("volume.nrrd", "volume.json"), threads=1),
    inputs=inputs,
    work=work,
    applies=has_volume,
)
