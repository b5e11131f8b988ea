"""The tables of an experiment, by their names."""

from collections.abc import Callable, Iterable
from typing import Any

from texgs.report.fitting import fitting
from texgs.report.looks import looks
from texgs.report.meshes import meshes
from texgs.report.metrics_files import Record
from texgs.report.scene_tables import datasets, edits, model_size, rendering
from texgs.report.table import Table

TABLES: dict[str, Callable[[Iterable[Record[Any]]], Table]] = {
    "fitting": fitting,
    "datasets": datasets,
    "rendering": rendering,
    "model_size": model_size,
    "edits": edits,
    "looks": looks,
    "meshes": meshes,
}
