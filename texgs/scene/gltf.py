"""Binary glTF files; for splats a mesh of points for each model, with KHR_gaussian_splatting."""

import json
from collections.abc import Mapping, Sequence
from math import isqrt
from pathlib import Path
from struct import pack
from typing import Any

import numpy as np

from texgs.core.io import write_bytes
from texgs.fields.ply_columns import Told
from texgs.raster.shading import Y00
from texgs.scene.clouds import Cloud

EXTENSION = "KHR_gaussian_splatting"
# Colours are as on a screen: pictures of texgs have no gamma of their own either.
KERNEL = {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}
POINTS, FLOAT, VERTICES = 0, 5126, 34962  # a mode, a type of numbers and a target in glTF
TYPES = {(): "SCALAR", (2,): "VEC2", (3,): "VEC3", (4,): "VEC4"}


class Glb:
    """A GLB container that is filled: its data, and what glTF says of them."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.out: dict[str, list[Any]] = {"accessors": [], "bufferViews": []}

    def add(self, packed: bytes, **about: int) -> int:
        """Add data, and return the number of their view."""
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(packed), **about}
        self.out["bufferViews"].append(view)
        self.data += packed + bytes(-len(packed) % 4)
        return len(self.out["bufferViews"]) - 1

    def attributes(self, values: Mapping[str, np.ndarray]) -> dict[str, int]:
        """Add attributes of vertices [N] or [N, C] by name, and return the numbers of their accessors."""
        places = {}
        for name, rows in values.items():
            kind = {"componentType": FLOAT, "type": TYPES[rows.shape[1:]], "count": len(rows)}
            if name == "POSITION":
                kind |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
            view = self.add(rows.astype("<f4").tobytes(), target=VERTICES)
            places[name] = len(self.out["accessors"])
            self.out["accessors"].append({"bufferView": view, **kind})
        return places

    def write(self, path: str | Path, told: Told, description: Mapping[str, Any]) -> Path:
        """Create or replace the file in one step; it shows all nodes of the description."""
        whole = {
            "asset": {"version": "2.0", "generator": "texgs", **({"extras": {**told}} if told else {})},
            "scene": 0,
            "scenes": [{"nodes": [*range(len(description["nodes"]))]}],
            "buffers": [{"byteLength": len(self.data)}],
        }
        text = json.dumps({**whole, **description, **self.out}, allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        parts = ((b"JSON", text), (b"BIN\0", self.data))
        chunks = [pack("<I4s", len(chunk), kind) + chunk for kind, chunk in parts]
        return write_bytes(path, pack("<4sII", b"glTF", 2, 12 + sum(map(len, chunks))) + b"".join(chunks))


def write_gltf(path: str | Path, clouds: Sequence[Cloud], told: Told = None) -> Path:
    """Create or replace a .glb file in one step.

    Each model is a node and a mesh with its name. Programs without the extension show points. Source: the
    kernel `ellipse` of KHR_gaussian_splatting as ratified in 2026: scales and opacities are linear,
    quaternions xyzw.
    """
    glb = Glb()
    nodes, meshes = list[Any](), list[Any]()
    for index, cloud in enumerate(clouds):
        places = glb.attributes(_attributes(cloud))
        primitive = {"mode": POINTS, "attributes": places, "extensions": {EXTENSION: KERNEL}}
        nodes.append({"name": cloud.name, "mesh": index})
        meshes.append({"name": cloud.name, "primitives": [primitive]})
    return glb.write(path, told, {"extensionsUsed": [EXTENSION], "nodes": nodes, "meshes": meshes})


def _attributes(cloud: Cloud) -> dict[str, np.ndarray]:
    """Return the values of each splat by attribute; colours of points are linear light, without gamma."""
    shown = (0.5 + Y00 * cloud.sh[:, 0]).clip(0, 1)
    linear = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    points = {"POSITION": cloud.means, "COLOR_0": np.column_stack([linear, cloud.opacities])}
    quats = np.roll(cloud.quats, -1, axis=1)
    splats = {"ROTATION": quats, "SCALE": cloud.scales, "OPACITY": cloud.opacities}
    for index in range(cloud.sh.shape[1]):
        degree = isqrt(index)
        splats[f"SH_DEGREE_{degree}_COEF_{index - degree**2}"] = cloud.sh[:, index]
    return points | {f"{EXTENSION}:{name}": values for name, values in splats.items()}
