"""Common columns of PLY files of 2DGS and 3DGS: raw geometry and harmonics, one property per number."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np
import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.io import write_atomic
from texgs.core.ply_file import TYPES
from texgs.raster.shading import DEGREES

Told = Mapping[str, object] | None  # comments of a file, by key


def splat_columns(p: Mapping[str, Tensor], normals: Tensor, sh: Tensor) -> dict[str, Tensor]:
    """Return [N] values by property, in the order of 2DGS and 3DGS.

    Harmonics [N, K, 3] after the first become `f_rest`, one channel after the other.
    """
    place = dict(zip("xyz", p["means"].T, strict=True))
    normal = dict(zip(("nx", "ny", "nz"), normals.T, strict=True))
    rest = sh[:, 1:].transpose(1, 2).flatten(1)  # [N, 3 (K - 1)]
    colors = numbered_columns("f_dc", sh[:, 0]) | numbered_columns("f_rest", rest)
    shape = numbered_columns("scale", p["scales"]) | numbered_columns("rot", p["quats"])
    return place | normal | colors | {"opacity": p["opacities"]} | shape


def numbered_columns(name: str, values: Tensor) -> dict[str, Tensor]:
    """Name the columns of [N, k] name_0, name_1, ..."""
    return {f"{name}_{k}": column for k, column in enumerate(values.T)}


def colored_points(places: Tensor, colors: Tensor) -> dict[str, Tensor]:
    """Name the columns of places [N, 3] and colours [N, 3] from 0 to 255."""
    values = (*places.cpu().float().T, *colors.cpu().byte().T)
    return dict(zip(("x", "y", "z", "red", "green", "blue"), values, strict=True))


def write_columns(
    path: str | Path,
    columns: Mapping[str, Tensor],
    faces: np.ndarray | None = None,
    told: Told = None,
) -> Path:
    """Create or replace a binary PLY file of vertices, and of triangles [F, 3] if there are any, in one step.

    Properties are float32, or bytes where columns are. What is told is in comments.
    """
    types = {name: "uchar" if column.dtype == torch.uint8 else "float" for name, column in columns.items()}
    vertices = np.empty(len(columns["x"]), [(name, TYPES[kind]) for name, kind in types.items()])
    for name, column in columns.items():
        vertices[name] = column.detach().numpy()
    header = ["ply", "format binary_little_endian 1.0"]
    header += [f"comment {key}: {json.dumps(value)}" for key, value in (told or {}).items()]
    header += [f"element vertex {len(vertices)}"]
    header += [f"property {kind} {name}" for name, kind in types.items()]
    blocks = [vertices.astype(vertices.dtype.newbyteorder("<"))]
    if faces is not None:
        header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        blocks.append(np.empty(len(faces), [("count", "u1"), ("corners", "<i4", (3,))]))
        blocks[1]["count"], blocks[1]["corners"] = 3, faces

    def write(file: BinaryIO) -> None:
        file.write("\n".join([*header, "end_header", ""]).encode())
        for block in blocks:
            block.tofile(file)

    return write_atomic(path, write)


def take(vertices: np.ndarray, *names: str) -> Tensor:
    """Return properties as columns [N, k] float32."""
    given = vertices.dtype.names or ()
    for name in names:
        if name not in given or vertices.dtype[name].kind not in "iuf":
            raise ArgumentError(f"expected vertices with a number {name} each, got {', '.join(given)}")
    return torch.from_numpy(np.stack([vertices[name].astype(np.float32) for name in names], axis=1))


def take_geometry(vertices: np.ndarray, axes: int) -> dict[str, Tensor]:
    """Return raw means, quaternions, `axes` scales and opacities."""
    scales = take(vertices, *(f"scale_{k}" for k in range(axes)))  # required first
    return {
        "means": take(vertices, "x", "y", "z"),
        "quats": take(vertices, *(f"rot_{k}" for k in range(4))),
        "scales": scales,
        "opacities": take(vertices, "opacity")[:, 0],
    }


def take_harmonics(vertices: np.ndarray) -> Tensor:
    """Return all harmonics [N, K, 3] of the file."""
    dc = take(vertices, "f_dc_0", "f_dc_1", "f_dc_2")[:, None]  # [N, 1, 3]
    n_rest = sum(name.startswith("f_rest_") for name in vertices.dtype.names or ())
    if n_rest % 3 or 1 + n_rest // 3 not in DEGREES:
        raise ArgumentError(f"expected 0, 9, 24 or 45 properties f_rest, got {n_rest}")
    if not n_rest:
        return dc
    rest = take(vertices, *(f"f_rest_{k}" for k in range(n_rest))).unflatten(1, (3, -1))  # [N, 3, K - 1]
    return torch.cat([dc, rest.transpose(1, 2)], dim=1)
