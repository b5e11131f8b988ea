"""Tables of data sets and of scenes: rendering, model size, edits, beside the paper's numbers."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from texgs.report.metrics_files import paper, read
from texgs.report.table import UNPUBLISHED, Column, Row, Table


def datasets(paths: Iterable[str | Path]) -> Table:
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
    volumes: dict[str, tuple[Path, dict[str, Any]]] = {}
    views: dict[tuple[str, str, str], dict[str, tuple[Path, float | None]]] = defaultdict(dict)
    for path, metrics in read(paths):
        n = metrics["numbers"]
        if metrics["stage"] == "volume":
            volumes[metrics["dataset"]] = (path, n)
        if metrics["stage"] == "views":
            size = f"{n['width']}x{n['height']}"
            views[metrics["dataset"], size, metrics["device"]][metrics["tf"]] = (path, n.get("frame_ms"))
    rows = []
    for (name, size, device), by_tf in sorted(views.items()):
        of, volume = volumes.get(name, (None, None))
        theirs = published.get((name,), {})
        sources = [path for path in (of, *(path for path, _ in by_tf.values())) if path]
        times = [ms for _, ms in by_tf.values() if ms is not None]
        of_volume = ["x".join(map(str, volume["dims"])), volume["volume_mib"]] if volume else [None, None]
        mean = sum(times) / len(times) if times else None
        cells = [name, *of_volume, size, len(by_tf), device, mean, *numbers(theirs, "volume_mib", "dvr_ms")]
        rows.append(Row(cells, sources))
    return Table("Volume rendering of single basic TFs. The paper: on an RTX 4090.", columns, rows)


def rendering(paths: Iterable[str | Path]) -> Table:
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
    for path, metrics in read(paths):
        if metrics["stage"] == "timing":
            n, volume = metrics["numbers"], metrics["numbers"].get("volume_mean_ms")
            ratio = None if volume is None else volume / n["frame_mean_ms"]
            where = [n["primitives"], f"{n['width']}x{n['height']}", metrics["device"], n["threads"]]
            times = [n["frame_mean_ms"], n["frame_max_ms"], volume, ratio]
            rows.append(Row([metrics["dataset"], label(metrics), *where, *times], [path]))
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
    found: dict[tuple[str, str], list[tuple[Path, dict[str, Any]]]] = defaultdict(list)
    for path, metrics in read(paths):
        if "total_mib" in metrics["numbers"]:
            found[metrics["dataset"], label(metrics)].append((path, metrics["numbers"]))
    rows = []
    for (name, recipe), parts in sorted(found.items()):
        sums = [sum(each[key] for _, each in parts) for key in ("primitives", *groups)]
        theirs = numbers(published.get((name,), {}), *groups)
        rows.append(Row([name, recipe, len(parts), *sums, *theirs], [path for path, _ in parts]))
    return Table("Sums over the basic scenes, 32 bits a value.", columns, rows)


def edits(paths: Iterable[str | Path]) -> Table:
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
    for path, metrics in read(paths):
        if metrics["stage"] == "pse":
            for step in (*metrics["numbers"]["pse"], *metrics["numbers"]["relight"]):
                quality = [metrics["numbers"]["views"], step.get("psnr"), step.get("ssim")]
                rows.append(Row([metrics["dataset"], label(metrics), step["title"], *quality], [path]))
    return Table("Views around the object; nothing is trained for an edit.", columns, rows)


def label(metrics: Mapping[str, Any]) -> str:
    """Recipe, variant and a seed other than 0, as they stand in tables."""
    seed = f"s{metrics['seed']}" if metrics.get("seed") else ""
    return "-".join(part for part in (metrics.get("recipe", ""), metrics.get("variant", ""), seed) if part)


def numbers(line: dict[str, str], *keys: str) -> list[float | None]:
    """Numbers of the paper, where it has them."""
    return [float(line[key]) if line.get(key) else None for key in keys]


SCENE_TABLES = {"datasets": datasets, "rendering": rendering, "model_size": model_size, "edits": edits}
