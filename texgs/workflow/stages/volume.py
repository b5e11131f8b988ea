"""Stage `volume`: make or read a scalar field, check it, and write the one file that later stages read."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.memory import GIB, MIB, free_memory
from texgs.core.progress import progress
from texgs.report.results import VolumeResult
from texgs.volume.settings import VolumeKeys, open_field, open_masks, prepare_fields
from texgs.workflow.inputs import has_volume, without
from texgs.workflow.locate import labels_file, source_file
from texgs.workflow.stage import Config, Outcome, Rule, Stage, plain_values, read
from texgs.workflow.stages.settings import OfDataset

if TYPE_CHECKING:
    from texgs.volume.slabs import Source

TOLD = ("dims", "dtype", "spacing", "origin", "minimum", "maximum", "voxels")  # in metrics.json, too


@dataclass(kw_only=True)
class Settings(OfDataset):
    """What the stage reads of the configuration."""

    volume: VolumeKeys = read(lambda config: without(config.dataset.volume, "obtain"))
    channels: list[str] = read("dataset.channels")
    labels: list[str] = read("dataset.labels")
    prepared: list[str] = read("dataset.prepared")


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write volume.nrrd, which ParaView opens too, and volume.json: lattice, ranges and histograms.

    It reads `source`, the volume's file, where it is not generated, and `labels`, a file of labels beside it.
    """
    from texgs.volume.summaries import write_summaries

    volume, target = settings.volume, output / "volume.nrrd"
    channels = [replace(volume, channel=channel) for channel in settings.channels] or [volume]
    fields: list[Source] = []
    if volume.kind == "image":
        fields = [open_field(channel, inputs.get("source")) for channel in channels]
    if settings.labels:
        fields += open_masks(volume, inputs.get("labels") or inputs["source"], settings.labels, *fields[:1])
    shown = partial(progress, title=f"{settings.dataset}: volume", unit="slab")
    summaries = prepare_fields(volume, fields, target, shown)
    if fields[0].note:
        sys.stderr.write(f"{settings.dataset}: {fields[0].note}\n")
    write_summaries(target, summaries, settings.prepared)
    ends = min(each.minimum for each in summaries), max(each.maximum for each in summaries)
    whole = replace(summaries[0], minimum=ends[0], maximum=ends[1])
    told, size = {name: plain_values(getattr(whole, name)) for name in TOLD}, target.stat().st_size
    if size > (free := free_memory()):
        sys.stderr.write(
            f"{settings.dataset}: the volume has {size / GIB:.3g} GiB, but {free / GIB:.3g} GiB of memory "
            "are free: rays would read it from the disk again and again; "
            f"dataset.volume.reduce={2 * volume.reduce} makes it smaller\n"
        )
    return Outcome(VolumeResult(**told, volume_mib=size / MIB))


def inputs(config: Config) -> dict[str, Path]:
    """Return the volume's file, where there is one, and that of its labels."""
    files = {"source": source_file(config), "labels": labels_file(config)}
    return {name: path for name, path in files.items() if path is not None}


STAGE = Stage(
    "volume",
    order=10,
    help="make or read the volume of a data set, and check it",
    rule=Rule("volume", "{dataset}/volume", ("volume.nrrd", "volume.json"), threads=1, swept=True),
    inputs=inputs,
    work=work,
    applies=has_volume,
)
