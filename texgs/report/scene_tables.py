"""Tables of data sets and whole scenes: `datasets`, `rendering`, `edits` and `steps`."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Any

from texgs.config.compose import ONE_LIGHT
from texgs.report.metrics_files import Record, of
from texgs.report.published import (
    DATA,
    LABEL,
    PAPER_LABEL,
    SCENES,
    are_of_paper,
    cells,
    images,
    in_order,
    mean,
    mean_rows,
    paper,
    volumes,
)
from texgs.report.results import (
    PseResult,
    SheetResult,
    StepsResult,
    TimingResult,
    ViewsResult,
    VolumeResult,
)
from texgs.report.table import SOURCES, UNLIKE_CELL, UNPUBLISHED_CELL, Table, columns


def datasets(records: Iterable[Record[Any]]) -> Table:
    """Return the table of all data sets, with times of the volume renderer by view size."""
    caption = (
        "Times are means over basic scenes of the median view; VTK renders the first metric.vtk_frames test "
        "views. Where there is no volume, the views are as published."
    )
    records = list(records)
    own = {record.dataset: record for record in of(VolumeResult, records)}
    rendered: list[Record[Any]] = [each for each in of(ViewsResult, records) if not is_of_sweep(each)]
    known = {record.dataset for record in rendered}
    given = [record for record in of(SheetResult, records) if record.dataset not in known]
    groups: dict[tuple[str, int, int, str], list[Record[Any]]] = defaultdict(list)
    for record in in_order([*rendered, *given]):
        device = str(record.facts["device"]) if isinstance(record.result, ViewsResult) else ""
        groups[record.dataset, record.result.width, record.result.height, device].append(record)
    rows = [dataset_row(own.get(key[0]), group, key[3]) for key, group in groups.items()]
    return Table(caption, [*columns("datasets").values()], rows)


def is_of_sweep(views: Record[Any]) -> bool:
    """Return whether views belong to a variant of a sweep, which has its own folder."""
    name = views.path.parent.name
    return name.startswith("views-") and name != f"views{ONE_LIGHT}"


def dataset_row(
    volume: Record[VolumeResult] | None, views: Sequence[Record[Any]], device: str
) -> dict[str, Any]:
    """Return the row of views of one size of one data set, rendered by a device or as published."""
    first, width, height = views[0], views[0].result.width, views[0].result.height
    row = {
        DATA: first.title,
        "image, pixels": f"{width}x{height}",
        SCENES.title: len({record.tf for record in views}),
        "ms / frame": mean([getattr(record.result, "frame_ms", None) for record in views]),
        "VTK, ms / frame": mean([getattr(record.result, "vtk_frame_ms", None) for record in views]),
        "device": device or None,
        SOURCES: [each.path for each in (volume, *views) if each],
    }
    if volume:
        row["volume, samples"] = "x".join(map(str, volume.result.dims))
        row["volume MiB"] = volume.result.volume_mib
    if (line := None if first.stand_in else volumes().get(first.dataset)) is not None:
        row["samples (paper)"] = "x".join(f"{line[f'volume_{axis}']:.0f}" for axis in "xyz")
        row["basic scenes (paper)"], row["MiB (paper)"] = line["basic_scenes"], line["volume_mib"]
        row["ms / frame (paper)"] = milliseconds_in_paper(first, width, height)
    return row


def milliseconds_in_paper(record: Record[Any], width: int, height: int) -> Any:
    """Return the paper's time of a frame of a volume, or the mark for another size."""
    time = volumes().get("" if record.stand_in else record.dataset, {}).get("dvr_ms")
    return time if time is None or (width, height) == (images(record.dataset),) * 2 else UNLIKE_CELL


def rendering(records: Iterable[Record[Any]]) -> Table:
    """Return the frame times of whole scenes, and of their volumes in the same job."""
    timings = [record for record in in_order(of(TimingResult, records)) if not record.is_swept]
    rows = [timing_row(record) for record in timings]
    titles = [*columns("rendering")][5:]
    means = mean_rows(rows, (LABEL, "pixels", "device", "threads"), titles)
    if are_of_paper(timings):
        means += [published_time("image", "800x800"), published_time("text", "512x512")]
    return Table("", [*columns("rendering").values()], [*rows, *means])


def timing_row(record: Record[TimingResult]) -> dict[str, Any]:
    """Return the row of the frames of one scene."""
    frames, volume = record.result, record.result.volume_mean_ms
    return cells(
        record,
        counts=not record.stand_in,
        pixels=f"{frames.width}x{frames.height}",
        device=record.facts["device"],
        threads=frames.threads,
        primitives=frames.primitives,
        **{
            "mean ms": frames.frame_mean_ms,
            "max ms": frames.frame_max_ms,
            "volume, mean ms": volume,
            "volume / scene": None if volume is None else volume / frames.frame_mean_ms,
            "volume, ms (paper)": milliseconds_in_paper(record, frames.width, frames.height),
        },
    )


def published_time(driven: str, pixels: str) -> dict[str, Any]:
    """Return the paper's times of its own scenes, from its table of edits by images or by texts."""
    numbers = {"primitives": "primitives", "render_mean_ms": "mean ms", "render_max_ms": "max ms"}
    lines = paper(f"{driven}_npse", {"method": "method"}, numbers).set_index("method")
    labels = {
        DATA: "mean of 4",
        LABEL: f"{PAPER_LABEL}, {driven}-driven",
        "pixels": pixels,
        "device": "RTX 4090",
    }
    others = dict.fromkeys([*columns("rendering")][8:], UNPUBLISHED_CELL)
    return {**labels, **lines.loc["TexGS-VolVis"], **others}


def edits(records: Iterable[Record[Any]]) -> Table:
    """Return edited scenes against the volume with the same edits."""
    shown = columns("edits")
    closeness = [*shown.items()][4:]
    rows = [
        cells(record, edit=step.title, views=record.result.views)
        | {column.title: getattr(step, key) for key, column in closeness}
        for record in in_order(of(PseResult, records))
        if not record.is_swept
        for step in (*record.result.pse, *record.result.relight)
    ]
    return Table("", [*shown.values()], rows)


def steps(records: Iterable[Record[Any]]) -> Table:
    """Return the agreement of the steps of series with their volumes, and the cost of a step."""
    rows = []
    for record in in_order(each for each in of(StepsResult, records) if not each.is_swept):
        result = record.result
        scores = [step.psnr for step in result.compared if step.psnr is not None]
        quality = {
            "s / step": result.step_seconds,
            "MiB / step": result.step_mib,
            "PSNR": mean(scores),
            "PSNR of the worst step": min(scores, default=None),
            "PSNR on the object": mean([step.object_psnr for step in result.compared]),
        }
        counts = {"steps": result.steps, "compared": len(result.compared), "views": result.views}
        rows.append(cells(record, **counts, **quality))
    return Table("", [*columns("steps").values()], rows)
