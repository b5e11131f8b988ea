"""Table `meshes`: surfaces of fits against isosurfaces of their volumes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from texgs.report.metrics_files import Record, of
from texgs.report.published import in_order
from texgs.report.results import MeshResult
from texgs.report.table import Column, Row, Table

COLUMNS = (
    Column("data set"),
    Column("TF"),
    Column("recipe"),
    Column("Chamfer", 5),
    Column("mesh to surface", 5),
    Column("surface to mesh", 5),
    Column("F-score", 3),
    Column("tolerance", 3),
    Column("normals, degrees", 1),
    Column("triangles", 0),
    Column("seconds", 1),
)
CAPTION = (
    "Meshes fused from depth, against what training views see of the isosurface. Lengths in world units: the "
    "longest side of a volume is 1. The paper shows this comparison as a picture only."
)


def meshes(records: Iterable[Record[Any]]) -> Table:
    """The table of all meshes among some jobs."""
    rows = []
    for record in in_order(of(MeshResult, records)):
        r = record.result
        measured = [r.chamfer, r.accuracy, r.completeness, r.f_score, r.tolerance, r.normal_angle]
        cells = [record.title, record.tf, record.label, *measured, r.triangles, r.mesh_seconds]
        rows.append(Row(cells, [record.path]))
    return Table(CAPTION, COLUMNS, rows)
