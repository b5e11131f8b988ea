"""Kinds of exports of a scene for other programs, and their options."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.core.names import EXPORTS

MODEL_KINDS = ("release", "compact")  # kinds for a single model
CLOUD_KINDS = ("usd", "gltf", "spz")  # kinds for whole scenes, with their light
MESH_KINDS = ("mesh", "textured")
FILE_SPACE_KINDS = (
    "points",
    *MESH_KINDS,
    "vtp",
    "gltf",
)  # kinds in the space of the volume's file by default
OPTIONS = {  # options that only some kinds support
    "volume": ("html",),
    "steps": ("html",),
    "opacity": ("points",),
    "voxel": MESH_KINDS,
    "faces": ("textured",),
    "texture": ("textured",),
    "views": (*MESH_KINDS, "compact"),
    "size": (*MESH_KINDS, "compact"),
    "drop_unseen": ("compact",),
    "space": ("points", *MESH_KINDS, "vtp", *CLOUD_KINDS),
}
ENDINGS = list(dict.fromkeys(ending for endings in EXPORTS.values() for ending in endings))


@dataclass(frozen=True)
class Export:
    """Options of an export."""

    kind: str | None = key(
        None,
        "3dgs or 2dgs for viewers of Gaussians, release as the paper's code has them, points with colours, "
        "mesh with colours of vertices, textured, a mesh with a texture as glTF or OBJ, vtp, polygons for "
        "ParaView, compact, html, a page that shows and edits the scene, or with light in the colours usd "
        "(OpenUSD), gltf (KHR_gaussian_splatting) or spz; default by the end",
        choices=tuple(EXPORTS),
    )
    model: str | None = key(
        None,
        "one model of a scene, with the textures that it has there; other edits of it only in html, usd, "
        "gltf and spz",
    )
    volume: float | None = key(
        None,
        "html: with the volume of the scene in so many MB, to show any transfer function, the volume beside "
        "the scene, and faces of cuts",
        above=0,
    )
    steps: str = key(
        "all", "html: steps of a series that the page holds: all, one, the scene's, or a number N, each N-th"
    )
    opacity: float = key(0.0, "points: leave out surfels with less opacity; default none, as many are faint")
    voxel: float = key(1 / 256, "edge of a cell of a mesh", "world units", above=0)
    faces: int = key(100_000, "most triangles of a textured mesh", least=4)
    texture: int = key(2048, "side of its texture, a power of two", "texels", least=64, most=16384)
    views: int = key(92, "number of views that a mesh is made from", least=1)
    size: int = key(512, "of these views", "pixels", least=1)
    drop_unseen: bool = key(False, "compact: no texture for surfels that none of the views sees")
    space: Literal["file", "world"] | None = key(
        None,
        "coordinates: those of the volume's file, such as a patient's mm (default of points, meshes, vtp and "
        "gltf), or of the world, in which the volume is centred and its longest side is 1",
    )
    device: str = key("cpu", "where to compute", choices=("cpu", "cuda"))

    def kind_of(self, path: Path) -> str:
        """Return the kind of a file by its suffix; require options that match."""
        by_ending = (kind for kind in EXPORTS if path.suffix in EXPORTS[kind])
        kind = self.kind or next(by_ending, None)
        expected = ENDINGS if kind is None else EXPORTS[kind]
        if kind is None or path.suffix not in expected:
            raise ArgumentError(f"expected a file that ends in {' or '.join(expected)}, got {path}")
        if kind in MODEL_KINDS and self.model is None:
            raise ArgumentError(f"kind {kind}: expected one model, got a scene; export its models one by one")
        for name, kinds in OPTIONS.items():
            if kind not in kinds and getattr(self, name) != getattr(Export, name):
                raise ArgumentError(f"{name}: expected kind {' or '.join(kinds)}, got {kind}; leave it out")
        if self.texture & (self.texture - 1):
            raise ArgumentError(f"texture: expected a power of two, such as 2048, got {self.texture}")
        return kind
