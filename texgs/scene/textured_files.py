"""Textured meshes as glTF, with the texture inside, and as OBJ, with material and texture beside it."""

from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.io import write_bytes
from texgs.fields.ply_columns import Told
from texgs.scene.gltf import Glb
from texgs.scene.textured import Textured

UNLIT = "KHR_materials_unlit"
LINEAR, CLAMPED = 9729, 33071  # in glTF; coarser levels of a texture would mix triangles that lie apart


def write_glb(path: Path, model: Textured, *, has_light: bool, told: Told = None) -> Path:
    """Create or replace a .glb file in one step; colours that hold light already are shown as they are."""
    glb = Glb()
    corners = {"POSITION": model.vertices[model.triangles], "NORMAL": model.normals[model.triangles]}
    places = glb.attributes({name: x.reshape(-1, 3) for name, x in corners.items()})
    places |= glb.attributes({"TEXCOORD_0": model.uv.reshape(-1, 2)})
    matte = {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0, "roughnessFactor": 1.0}
    unlit: dict[str, Any] = {"extensions": {UNLIT: {}}} if has_light else {}
    description = {
        "nodes": [{"name": path.stem, "mesh": 0}],
        "meshes": [{"name": path.stem, "primitives": [{"attributes": places, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": matte, "doubleSided": True, **unlit}],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMPED, "wrapT": CLAMPED}],
        "images": [{"bufferView": glb.add(model.png()), "mimeType": "image/png"}],
        **({"extensionsUsed": [UNLIT]} if has_light else {}),
    }
    return glb.write(path, told, description)


def write_obj(path: Path, model: Textured, told: Told = None) -> Path:
    """Create or replace NAME.obj after NAME.mtl and NAME-texture.png."""
    material, texture = path.with_suffix(".mtl"), path.with_name(f"{path.stem}-texture.png")
    write_bytes(texture, model.png())
    words = f"newmtl surface\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {texture.name}\n"
    write_bytes(material, words.encode())
    numbers, count = model.triangles + 1, model.triangles.size
    faces = np.stack([numbers, np.arange(1, count + 1).reshape(-1, 3), numbers], axis=2).reshape(-1, 9)
    flipped = model.uv.reshape(-1, 2) * [1, -1] + [0, 1]  # rows of OBJ go up
    rows = {"v": model.vertices, "vn": model.normals, "vt": flipped}
    lines = [f"# {name}: {value}" for name, value in (told or {}).items()]
    lines += [f"mtllib {material.name}", "usemtl surface"]
    for name, values in rows.items():
        form = name + " %.7g" * values.shape[1] + "\n"
        lines.append((form * len(values)).rstrip() % tuple(values.ravel().tolist()))
    lines.append(("f %d/%d/%d %d/%d/%d %d/%d/%d\n" * len(faces)).rstrip() % tuple(faces.ravel().tolist()))
    return write_bytes(path, ("\n".join(lines) + "\n").encode())
