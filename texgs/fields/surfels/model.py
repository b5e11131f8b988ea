"""A basic model: raw parameters of surfels, and their conversion to geometry, material and colour."""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.fields.field import sizes_in_mib
from texgs.fields.splats import GEOMETRY, Splats
from texgs.fields.surfels.shading import ShadingModel, seen_normals
from texgs.raster import Render
from texgs.raster.shading import MATERIAL

SHAPES = {"means": "N 3", "quats": "N 4", "scales": "N 2", "opacities": "N", "sh": "N K 3", "colors": "N 3"}
SHAPES |= {"normals": "N 4", "palette": "3", "texels": "T 3", "sizes": "N 2", "offsets": "N"}
TEXTURE_TENSORS = ("palette", "texels", "sizes", "offsets")
# Tensors that the paper counts, and tensors that we store; each is in one group.
COUNTED_TENSORS = {"geometry": GEOMETRY, "shading": ("normals", *MATERIAL), "texture": ("texels",)}
STORED_TENSORS = {
    "geometry": GEOMETRY,
    "shading": ("sh", "colors", "normals", *MATERIAL),
    "texture": TEXTURE_TENSORS,
}
RELEASE_BYTES = 100  # bytes of a surfel without texels in files of the authors' release


@dataclass(frozen=True, eq=False)
class Surfels(Splats):
    """Raw parameters by name, all float32 on one device.

    - geometry: `means` [N, 3] world units, `quats` [N, 4] wxyz of any length, `scales` [N, 2] natural
      logarithm, `opacities` [N] logit;
    - colour: `sh` [N, K, 3] before shading is known, `colors` [N, 3] (c_ind) with shading;
    - normals of their own, which surfels need not have: `normals` [N, 4], quaternions whose third axis light
      sees in place of that of `quats`;
    - material: `ambient`, `diffuse`, `specular`, `shininess`, raw, [N] or one for all [1];
    - texture: `palette` [3], `texels` [T, 3], `sizes` [N, 2] int32, `offsets` [N] int64; c_ind is then
      palette + colors + texel.

    Raises:
        ShapeError, ArgumentError: if a tensor is missing or of another shape.
    """

    kind: ClassVar[str] = "surfels"

    shading: ShadingModel = field(default_factory=ShadingModel)

    def __post_init__(self) -> None:
        given = self.parameters
        missing = [name for name in GEOMETRY if name not in given]
        if missing or not ({"sh", "colors"} & set(given)):
            raise ArgumentError(
                f"model: expected {', '.join(GEOMETRY)} and sh or colors, got {', '.join(given)}"
            )
        n = check.shape("means", given["means"], "N 3")["N"]
        for name, spec in SHAPES.items():
            if name in given:
                check.shape(name, given[name], spec, N=n)
        for name in MATERIAL:
            if name in given and given[name].shape not in ((n,), (1,)):
                raise ArgumentError(f"{name}: expected [{n}] or [1], got {list(given[name].shape)}")

    def rasterized(self, camera: Camera, opacity: float | Tensor | None = None, **shown: Any) -> Render:
        """Rasterize, see `Splats`; the image has the normals used for shading."""
        render = super().rasterized(camera, opacity, **shown)
        if render.normal is None or "normals" not in self.parameters:
            return render
        normals, part = seen_normals(self.parameters, camera), shown.get("depth_range")
        seen = super().rasterized(camera, opacity, features=normals, depth_range=part)
        return replace(render, normal=seen.color)

    def sizes(self) -> dict[str, float]:
        """Return sizes in MiB, see `Field.sizes`.

        The paper's breakdown counts 10 floats of geometry per surfel, 4 of material (or 4 in all where
        surfels share one) and 3 per texel, and 4 of normals of their own. `stored_` counts the bytes of all
        tensors: colours and harmonics as shading, palette and layout as texture. `files_mib` are the files of
        the authors' release: 20 floats and 5 numbers of the layout for a surfel, beside its texels.
        """
        counted, stored = (
            {
                group: sum(x.nbytes for x in map(self.parameters.get, names) if x is not None)
                for group, names in by.items()
            }
            for by in (COUNTED_TENSORS, STORED_TENSORS)
        )
        return sizes_in_mib(counted, stored, RELEASE_BYTES * len(self) + counted["texture"])

    @property
    def stage(self) -> Literal["surfels", "shading", "texture"]:
        """The last phase of the model's fit."""
        if "texels" in self.parameters:
            return "texture"
        return "shading" if "ambient" in self.parameters else "surfels"
