"""Tables of data sets and of scenes: rendering, model size, edits, beside the paper's numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import Any

from texgs.report.metrics_files import Record, of, paper
from texgs.report.results import FitResult, PseResult, TimingResult, ViewsResult, VolumeResult
from texgs.report.table import UNPUBLISHED, Cell, Column, Row, Table


def datasets(records: Iterable[Record[Any]]) -> Table:
    """Volumes, and how long the volume renderer takes for a frame of a basic TF."""
    columns = (
        Column("data set"),
        Column("samples"),
        Column("volume MiB", 1),
        Column("views px"),
        Column("basic scenes", 0),
        Column("device"),
        Column("ms / frame", 1),
        Column("MiB (paper)", 1, UNPUBLISHED),
        Column("ms / frame (paper)", 1, UNPUBLISHED),
    )
    published = paper("datasets")
    records = list(records)
    volumes = {record.dataset: record for record in of(VolumeResult, records)}
    views: dict[tuple[str, str, str], dict[str | None, Record[ViewsResult]]] = defaultdict(dict)
    for record in of(ViewsResult, records):
        size = f"{record.result.width}x{record.result.height}"
        views[record.dataset, size, record.facts["device"]][record.tf] = record
    rows = []
    for (name, size, device), by_tf in sorted(views.items()):
        volume, theirs = volumes.get(name), published.get((name,), {})
        of_volume: list[Cell] = [None, None]
        if volume is not None:
            of_volume = ["x".join(map(str, volume.result.dims)), volume.result.volume_mib]
        times = [x.result.frame_ms for x in by_tf.values() if x.result.frame_ms is not None]
        mean = sum(times) / len(times) if times else None
        cells = [name, *of_volume, size, len(by_tf), device, mean, *numbers(theirs, "volume_mib", "dvr_ms")]
        rows.append(Row(cells, [each.path for each in (volume, *by_tf.values()) if each is not None]))
    return Table("Volume rendering of single basic TFs. The paper: on an RTX 4090.", columns, rows)


def rendering(records: Iterable[Record[Any]]) -> Table:
    """Time of frames of whole scenes, and of their volumes in the same job."""
    columns = (
        Column("data set"),
        Column("recipe"),
        Column("primitives", 0),
        Column("pixels"),
        Column("device"),
        Column("threads", 0),
        Column("mean ms", 2),
        Column("max ms", 2),
        Column("volume, mean ms", 1),
        Column("volume / scene", 1),
    )
    rows = []
    for record in of(TimingResult, records):
        frames, volume = record.result, record.result.volume_mean_ms
        ratio = None if volume is None else volume / frames.frame_mean_ms
        device = record.facts["device"]
        where = [frames.primitives, f"{frames.width}x{frames.height}", device, frames.threads]
        times = [frames.frame_mean_ms, frames.frame_max_ms, volume, ratio]
        rows.append(Row([record.dataset, record.label, *where, *times], [record.path]))
    caption = (
        "Test path. The paper, means over scenes on an RTX 4090: 11.82 ms at 800x800, 7.21 ms at 512x512."
    )
    return Table(caption, columns, rows)


def model_size(records: Iterable[Record[Any]]) -> Table:
    """Sizes of the models of a data set together, as the paper counts them."""
    groups = ("geometry_mib", "shading_mib", "texture_mib")
    titles = ("geometry MiB", "shading MiB", "texture MiB")
    columns = (
        Column("data set"),
        Column("recipe"),
        Column("basic scenes", 0),
        Column("primitives", 0),
        *(Column(title, 1) for title in titles),
        *(Column(f"{title} (paper)", 1, UNPUBLISHED) for title in titles),
    )
    published = paper("model_size")
    by_recipe: dict[tuple[str, str], list[Record[FitResult]]] = defaultdict(list)
    for record in of(FitResult, records):
        if record.result.sizes:
            by_recipe[record.dataset, record.label].append(record)
    rows = []
    for (name, recipe), parts in sorted(by_recipe.items()):
        sums = [sum(part.result.sizes[group] for part in parts) for group in groups]
        own = [len(parts), sum(part.result.primitives for part in parts), *sums]
        theirs = numbers(published.get((name,), {}), *groups)
        rows.append(Row([name, recipe, *own, *theirs], [part.path for part in parts]))
    return Table(
        "Sums over the basic scenes, 32 bits a value; 16 for harmonics of voxels.",
        columns,
        rows,
    )


def edits(records: Iterable[Record[Any]]) -> Table:
    """Edited scenes against the volume with the same edits."""
    columns = (
        Column("data set"),
        Column("recipe"),
        Column("edit"),
        Column("views", 0),
        Column("PSNR", 2),
        Column("SSIM", 4),
    )
    rows = []
    for record in of(PseResult, records):
        result = record.result
        for step in (*result.pse, *result.relight):
            cells: list[Cell] = [record.dataset, record.label, step.title, result.views, step.psnr, step.ssim]
            rows.append(Row(cells, [record.path]))
    return Table("Views around the object; nothing is trained for an edit.", columns, rows)


def numbers(line: dict[str, str], *keys: str) -> list[float | None]:
    """Numbers of the paper, where it has them."""
    return [float(line[key]) if line.get(key) else None for key in keys]
