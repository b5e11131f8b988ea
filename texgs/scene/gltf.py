"""Binary glTF files: a mesh of points for each model, with the extension KHR_gaussian_splatting."""

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
TYPES = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4"}


def write_gltf(path: str | Path, clouds: Sequence[Cloud], told: Told = None) -> Path:
    """Create or replace a .glb file in one step.

    Each model is a node and a mesh with its name. Programs without the extension show points. Source: the
    kernel `ellipse` of KHR_gaussian_splatting as ratified in 2026: scales and opacities are linear,
    quaternions xyzw.
    """
    data = bytearray()
    out: dict[str, list[Any]] = {name: [] for name in ("nodes", "meshes", "accessors", "bufferViews")}
    for cloud in clouds:
        places = {}
        for name, values in _attributes(cloud).items():
            packed = values.astype("<f4").tobytes()
            view = {"buffer": 0, "byteOffset": len(data), "byteLength": len(packed), "target": VERTICES}
            kind = {"componentType": FLOAT, "type": TYPES[values.shape[1:]], "count": len(values)}
            low, high = values.min(axis=0), values.max(axis=0)
            bounds = {"min": low.tolist(), "max": high.tolist()} if name == "POSITION" else {}
            places[name] = len(out["accessors"])
            out["accessors"].append({"bufferView": len(out["bufferViews"]), **kind, **bounds})
            out["bufferViews"].append(view)
            data += packed
        primitive = {"mode": POINTS, "attributes": places, "extensions": {EXTENSION: KERNEL}}
        out["nodes"].append({"name": cloud.name, "mesh": len(out["meshes"])})
        out["meshes"].append({"name": cloud.name, "primitives": [primitive]})
    description = {
        "asset": {"version": "2.0", "generator": "texgs", **({"extras": {**told}} if told else {})},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [*range(len(clouds))]}],
        "buffers": [{"byteLength": len(data)}],
    }
    return write_bytes(path, _binary(description | out, bytes(data)))


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


def _binary(description: Mapping[str, object], data: bytes) -> bytes:
    """Return a GLB container: a header, the description and the data, whose length is a multiple of 4."""
    text = json.dumps(description, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    chunks = [pack("<I4s", len(chunk), kind) + chunk for kind, chunk in ((b"JSON", text), (b"BIN\0", data))]
    return pack("<4sII", b"glTF", 2, 12 + sum(map(len, chunks))) + b"".join(chunks)
