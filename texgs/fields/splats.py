"""Common base of surfels and 3D Gaussians: raw parameters by name, and their extent on screen."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from math import ceil, floor
from typing import Any, Protocol, Self

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.field import Role
from texgs.raster import Options, Render, Texture, native, rasterize
from texgs.raster.shading import Y00
from texgs.raster.types import are_gaussians
from texgs.volume.images import Images, PixelBox, Target

GEOMETRY = ("means", "quats", "scales", "opacities")
REACH = 3.34  # standard deviations at which opacity 1 falls to 1/255, the threshold of drawing
native.declare("texgs_screen_bounds", "n i ppp f p")


class Shading(Protocol):
    """Converts raw parameters of surfels or 3D Gaussians to arguments of the rasterizer."""

    @property
    def options(self) -> Options:
        """Options of the rasterizer."""

    def colors(self, parameters: Mapping[str, Tensor], camera: Camera, light: Light) -> Tensor | Texture:
        """Return colours [N, 3] in a view, or a texture; differentiable."""


@dataclass(frozen=True, eq=False)
class Splats:
    """Raw parameters by name, all float32 on one device, and their shading."""

    parameters: Mapping[str, Tensor]
    shading: Shading
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.parameters["means"])

    @property
    def device(self) -> torch.device:
        """The device of the tensors."""
        return self.parameters["means"].device

    def to(self, device: torch.device | str) -> Self:
        """Return the same model on another device."""
        return replace(self, parameters={name: x.to(device) for name, x in self.parameters.items()})

    def tensors(self, role: Role) -> dict[str, Tensor]:
        """Return the parameters of geometry, or all others: colour, material and texture."""
        is_geometry = role == "geometry"
        return {name: x for name, x in self.parameters.items() if (name in GEOMETRY) == is_geometry}

    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        *,
        background: Tensor | None = None,
        outputs: Collection[str] = (),
        opacity: Tensor | None = None,
        depth_range: Tensor | None = None,
    ) -> Render:
        """Render one view, see `Field` and `Composed`.

        `opacity` [N] are factors on opacities, which stay at most 1.
        """
        colored = self.shading.colors(self.parameters, camera, light)
        kind = "texture" if isinstance(colored, Texture) else "features"
        background = torch.ones_like(camera.viewmat[0, :3]) if background is None else background
        shown = {kind: colored, "background": background, "depth_range": depth_range, "outputs": outputs}
        return self.rasterized(camera, opacity, **shown)

    def rasterized(self, camera: Camera, opacity: float | Tensor | None = None, **shown: Any) -> Render:
        """Rasterize features or a texture of the splats; see `rasterize`.

        `opacity` is a factor on the opacities of all, or of each [N]; these stay at most 1.
        """
        means, quats, scales, opacities = geometry(self.parameters)
        if opacity is not None:
            opacities = (opacities * opacity).clamp_max(1)
        return rasterize(
            *(means, quats, scales, opacities),
            *(camera.viewmat, camera.K, camera.width, camera.height),
            options=self.shading.options,
            **shown,
        )


def geometry(parameters: Mapping[str, Tensor]) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return means, quaternions, standard deviations and opacities for the rasterizer; differentiable."""
    p = parameters
    return p["means"], p["quats"], p["scales"].exp(), p["opacities"].sigmoid()


def zeroth(colors: Tensor) -> Tensor:
    """Return coefficients [N, 1, 3] that show a colour [N, 3] from everywhere."""
    return ((colors - 0.5) / Y00)[:, None]


def base_color(sh: Tensor) -> Tensor:
    """Return the colour [N, 3] without the direction: c_ind of the paper's section Relightable 2DGS."""
    return (0.5 + Y00 * sh[:, 0]).clamp_min(0)


def split(sh: Tensor) -> dict[str, Tensor]:
    """Split harmonics into `sh` [N, 1, 3] and `sh_rest` [N, K - 1, 3], if any; their rates differ."""
    return {"sh": sh[:, :1]} | ({"sh_rest": sh[:, 1:]} if sh.shape[1] > 1 else {})


def join(parameters: Mapping[str, Tensor], degree: int | None = None) -> dict[str, Tensor]:
    """Join `sh` and `sh_rest` again, up to a degree."""
    joined = dict(parameters)
    if "sh_rest" in parameters:
        count = parameters["sh_rest"].shape[1] if degree is None else (degree + 1) ** 2 - 1
        joined["sh"] = torch.cat([parameters["sh"], joined.pop("sh_rest")[:, :count]], dim=1)
    return joined


@torch.no_grad()
def screen_box(parameters: Mapping[str, Tensor], options: Options, camera: Camera) -> PixelBox:
    """Return a box around the projected bounding spheres of all splats. Waits for a GPU once.

    It is the whole image where a sphere reaches behind the camera, or a value is not finite.
    """
    means, scales = parameters["means"].contiguous(), parameters["scales"].contiguous()
    if not len(means):
        return PixelBox(camera.width // 2, camera.height // 2, camera.width // 2, camera.height // 2)
    bounds, viewmat = means.new_empty(5), camera.viewmat.to(means.device).contiguous()
    spheres = (*scales.shape, means, scales, viewmat)
    native.call("texgs_screen_bounds", *spheres, REACH, bounds, device=means.device)
    nearest, left, right, top, bottom = bounds.tolist()
    if nearest <= 0:
        return PixelBox(0, 0, camera.width, camera.height)
    (fx, _, cx), (_, fy, cy), _ = camera.K.tolist()
    variance = options.dilation if are_gaussians(scales) else 1 / max(options.low_pass, 1e-6)
    disc = REACH * variance**0.5  # of the low-pass filter, pixels
    return PixelBox(
        floor(fx * left + cx - disc),
        floor(fy * top + cy - disc),
        ceil(fx * right + cx + disc),
        ceil(fy * bottom + cy + disc),
    )


def visible_part(images: Images, index: int, parameters: Mapping[str, Tensor], options: Options) -> Target:
    """Crop a training view to the part where it or the splats are visible, on the splats' device."""
    around = screen_box(parameters, options, images.cameras[index])
    return images.target(index, parameters["means"].device, around)
