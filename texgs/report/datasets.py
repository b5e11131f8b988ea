"""Table `datasets`: volumes, their views, and how long the volume renderer takes for a view of a basic TF."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

from texgs.report.means import mean
from texgs.report.metrics_files import Record, of, paper
from texgs.report.published import beside, images, in_order
from texgs.report.results import SheetResult, ViewsResult, VolumeResult
from texgs.report.table import UNPUBLISHED, Cell, Column, Row, Table

COLUMNS = (
    Column("data set"),
    Column("volume, samples"),
    Column("image, pixels"),
    Column("basic scenes", 0),
    Column("volume MiB", 1),
    Column("ms / frame", 1),
    Column("device", None, UNPUBLISHED),
    Column("samples (paper)", None, UNPUBLISHED),
    Column("basic scenes (paper)", 0, UNPUBLISHED),
    Column("MiB (paper)", 1, UNPUBLISHED),
    Column("ms / frame (paper)", 1, UNPUBLISHED),
)
CAPTION = (
    "Times are means over basic scenes of the median view. Where there is no volume, the views are as "
    "published. The paper: ParaView on an RTX 4090, its volumes as 32-bit floats."
)
Views = ViewsResult | SheetResult


def datasets(records: Iterable[Record[Any]]) -> Table:
    """The table of all data sets among some jobs, by the size of their views."""
    records = list(records)
    volumes = {record.dataset: record for record in of(VolumeResult, records)}
    rendered: list[Record[Any]] = [*of(ViewsResult, records)]
    known = {record.dataset for record in rendered}
    published = [record for record in of(SheetResult, records) if record.dataset not in known]
    groups: dict[tuple[str, int, int, str], list[Record[Any]]] = defaultdict(list)
    for record in in_order([*rendered, *published]):
        size = (record.result.width, record.result.height)
        groups[record.dataset, *size, device(record)].append(record)
    return Table(CAPTION, COLUMNS, [row_of(volumes.get(key[0]), group) for key, group in groups.items()])


def device(record: Record[Any]) -> str:
    """What rendered the views; empty where they are as published."""
    return str(record.facts["device"]) if isinstance(record.result, ViewsResult) else ""


def row_of(volume: Record[VolumeResult] | None, views: Sequence[Record[Any]]) -> Row:
    """Views of one size of one data set."""
    first = views[0]
    width, height = first.result.width, first.result.height
    samples = "x".join(map(str, volume.result.dims)) if volume else None
    scenes = len({record.tf for record in views})
    milliseconds = mean([getattr(record.result, "frame_ms", None) for record in views])
    size = volume.result.volume_mib if volume else None
    own: list[Cell] = [samples, f"{width}x{height}", scenes, size, milliseconds, device(first) or None]
    line = None if first.stand_in else paper("datasets").get((first.dataset,))
    theirs: list[Cell] = ["x".join(line[f"volume_{axis}"] for axis in "xyz")] if line else [None]
    theirs += beside(line, ("basic_scenes", "volume_mib"), alike=True)
    theirs += beside(line, ("dvr_ms",), alike=(width, height) == (images().get(first.dataset),) * 2)
    return Row([first.title, *own, *theirs], [each.path for each in (volume, *views) if each])
