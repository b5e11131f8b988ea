"""Tables of data sets and of scenes: rendering, model size, edits, beside the paper's numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from texgs.report.metrics_files import paper, read
from texgs.report.table import UNPUBLISHED, Cell, Column, Table


def datasets(paths: Iterable[str | Path]) -> Table:
    """Volumes, and how long the volume renderer takes for a frame of a basic TF."""
    columns = (
        Column("data set"),
        Column("samples"),
        Column("volume MiB", 1),
        Column("views px"),
        Column("basic scenes", 0),
        Column("ms / frame", 1),
        Column("MiB (paper)", 1, UNPUBLISHED),
        Column("ms / frame (paper)", 1, UNPUBLISHED),
    )
    published, volumes = paper("datasets"), {}
    views: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for _, metrics in read(paths):
        if metrics["stage"] == "volume":
            volumes[metrics["dataset"]] = metrics["numbers"]
        if metrics["stage"] == "views":
            views[metrics["dataset"]].append(metrics["numbers"])
    rows: list[list[Cell]] = []
    for name, volume in sorted(volumes.items()):
        shown, theirs = views[name], published.get((name,), {})
        times = [numbers["frame_ms"] for numbers in shown if "frame_ms" in numbers]
        rows.append(
            [
                name,
                "x".join(map(str, volume["dims"])),
                volume["volume_mib"],
                f"{shown[0]['width']}x{shown[0]['height']}" if shown else None,
                len(shown),
                sum(times) / len(times) if times else None,
                number(theirs, "volume_mib"),
                number(theirs, "dvr_ms"),
            ]
        )
    return Table(
        "Volume rendering of single basic TFs, on the CPU. The paper: on an RTX 4090.", columns, rows
    )


def rendering(paths: Iterable[str | Path]) -> Table:
    """Time of frames of whole scenes, and of their volumes in the same job."""
    columns = (
        Column("data set"),
        Column("recipe"),
        Column("primitives", 0),
        Column("pixels"),
        Column("threads", 0),
        Column("mean ms", 2),
        Column("max ms", 2),
        Column("volume, mean ms", 1),
        Column("volume / scene", 1),
    )
    rows: list[list[Cell]] = []
    for _, metrics in read(paths):
        if metrics["stage"] == "timing":
            n, volume = metrics["numbers"], metrics["numbers"].get("volume_mean_ms")
            size, ratio = (
                f"{n['width']}x{n['height']}",
                None if volume is None else volume / n["frame_mean_ms"],
            )
            cells = [n["surfels"], size, n["threads"], n["frame_mean_ms"], n["frame_max_ms"], volume, ratio]
            rows.append([metrics["dataset"], label(metrics), *cells])
    caption = (
        "Test path. The paper, means over scenes on an RTX 4090: 11.82 ms at 800x800, 7.21 ms at 512x512."
    )
    return Table(caption, columns, rows)


def model_size(paths: Iterable[str | Path]) -> Table:
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
    found: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    for _, metrics in read(paths):
        if metrics["stage"] == "texture":
            found[metrics["dataset"], label(metrics)].append(metrics["numbers"])
    rows: list[list[Cell]] = []
    for (name, recipe), parts in sorted(found.items()):
        sums = [sum(numbers[key] for numbers in parts) for key in ("surfels", *groups)]
        theirs = [number(published.get((name,), {}), key) for key in groups]
        rows.append([name, recipe, len(parts), *sums, *theirs])
    return Table("Sums over the basic scenes, 32 bits a value.", columns, rows)


def edits(paths: Iterable[str | Path]) -> Table:
    """Edited scenes against the volume with the same edits."""
    columns = (
        Column("data set"),
        Column("recipe"),
        Column("edit"),
        Column("PSNR", 2),
        Column("SSIM", 4),
    )
    rows: list[list[Cell]] = []
    for _, metrics in read(paths):
        if metrics["stage"] == "pse":
            for step in (*metrics["numbers"]["pse"], *metrics["numbers"]["relight"]):
                quality = [step.get("psnr"), step.get("ssim")]
                rows.append([metrics["dataset"], label(metrics), step["title"], *quality])
    return Table("Views around the object; nothing is trained for an edit.", columns, rows)


def label(metrics: dict[str, Any]) -> str:
    """Recipe and variant, as they stand in tables."""
    return "-".join(part for part in (metrics.get("recipe", ""), metrics.get("variant", "")) if part)


def number(line: dict[str, str], key: str) -> float | None:
    """A number of the paper, where it has one."""
    return float(line[key]) if line.get(key) else None


SCENE_TABLES = {"datasets": datasets, "rendering": rendering, "model_size": model_size, "edits": edits}
