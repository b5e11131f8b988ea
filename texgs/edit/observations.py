"""Edited views as linear equations in the bare colours of texels, at several opacities."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import torch
from torch import Tensor
from torch.nn.functional import pad

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import material
from texgs.fields.surfels.texels import bare_colors
from texgs.models.guidance import EditViews
from texgs.raster import Render, Texture
from texgs.raster.losses import depth_to_normal, planar

MARGIN = 11  # pixels around content: a window of SSIM
SOFT_ALPHA = 0.05  # alpha below which colours blend into those of the neighbourhood
NEAR_WINDOW, FAR_WINDOW = 9, 65  # pixels, sides of the neighbourhood's windows
MIN_WINDOW_ALPHA = 0.02  # mean alpha below which the larger window's colour counts
Target = Literal["colors", "images"]


def edit_views(
    renders: Iterable[Render], cameras: Sequence[Camera], conditions: Tensor | None, level: float | None
) -> EditViews:
    """Return the views that a guidance edits: renders over white with depth.

    Points lie at the mean depth. Fields without normals get normals of the surface through these points.
    Edits stay close to the conditions [V, H, W, 3], by default to the renders. The level is of noise.
    """
    images, alphas, points, normals = [], [], [], []
    for camera, seen in zip(cameras, renders, strict=True):
        assert seen.depth is not None
        images.append(seen.color.clamp(0, 1))
        alphas.append(seen.alpha)
        points.append(camera.unproject(seen.depth))
        normal = seen.normal
        if normal is None:
            is_seen = (seen.alpha > 0)[..., None]
            normal = depth_to_normal(seen.depth, camera.viewmat, camera.K) * is_seen
        normals.append(normal)
    shown, alpha, places, facing = map(torch.stack, (images, alphas, points, normals))
    conditions = shown if conditions is None else conditions
    return EditViews(shown, conditions, alpha, places, facing, list(cameras), level)


@torch.no_grad()
def render_views(
    model: Surfels, cameras: Sequence[Camera], light: Light | None, opacity: float = 1.0
) -> EditViews:
    """Render a textured model for a guidance, with cameras of one size; without a light, its bare colours.

    Opacities are those of the model times a factor.
    """
    sizes = {(camera.width, camera.height) for camera in cameras}
    if len(sizes) != 1:
        raise ArgumentError(f"cameras: expected at least one, all of one size, got sizes {sorted(sizes)}")
    p, colors = model.parameters, bare_colors(model)
    white = torch.ones_like(colors[0])
    renders = (
        model.rasterized(
            *(camera, opacity),
            texture=Texture(*light_on(model, camera, light), colors, p["sizes"], p["offsets"]),
            background=white,
            outputs=("depth", "normal"),
        )
        for camera in cameras
    )
    return edit_views(renders, cameras, None, None)


def join_views(parts: Sequence[EditViews]) -> EditViews:
    """Concatenate views of several models."""
    if len(parts) == 1:
        return parts[0]
    shown, conditions, alphas, points, normals = (
        torch.cat([getattr(each, name) for each in parts])
        for name in ("images", "conditions", "alphas", "points", "normals")
    )
    cameras = [camera for each in parts for camera in each.cameras]
    return EditViews(shown, conditions, alphas, points, normals, cameras)


def light_on(model: Surfels, camera: Camera, light: Light | None) -> tuple[Tensor, Tensor]:
    """Return highlight [N, 3] and gain [N]: a fragment of bare colour c looks like highlight + gain * c.

    The model is relightable; without a light, colours are unchanged.
    """
    p, shading = model.parameters, model.shading
    black = torch.zeros_like(p["means"])
    if light is None:
        return black, torch.ones_like(p["opacities"])
    return shading.lit(black, material(p, shading.material).values(), p, camera, light)


@dataclass(frozen=True, eq=False)
class LinearObservation:
    """One view at one opacity, over black: the map from bare colours to an image, and its target."""

    model: Surfels
    opacity: float  # factor on the opacities of surfels
    texture: Texture  # highlights and gains, both 0 for fixed surfels
    camera: Camera  # crop to the visible part of the view
    rest: Tensor  # [h, w, 1 or 3] contribution of fixed surfels
    wanted: Tensor  # [h, w, 3] target for the contribution of the others

    @property
    def is_lit(self) -> bool:
        """Return whether there are highlights."""
        return bool(self.texture.base.any())

    def image(self, colors: Tensor, *, plain: bool = False) -> Tensor:
        """Return the contribution [h, w, 3] of bare colours [T, 3] to the image; differentiable.

        With `plain`, highlights are left out and the result is linear in the colours.
        """
        texture = replace(self.texture, texels=colors)
        if plain:
            texture = replace(texture, base=torch.zeros_like(texture.base))
        return self.model.rasterized(self.camera, self.opacity, texture=texture).color


def observe(
    model: Surfels,
    views: EditViews,
    edited: Tensor,
    light: Light | None,
    opacities: Sequence[float],
    surfels: Tensor | None = None,
    *,
    target: Target = "colors",
) -> list[list[LinearObservation]]:
    """Return the equations of all views, for each opacity.

    An edited view says which colours surfels should have where they are seen. At another opacity the same
    colours are wanted, at the alpha of that opacity, so that nothing gets darker or paler to make up for it;
    the rest is white. With the target `images` the edited view itself is wanted at each opacity, as in the
    paper; the rest is white and surfels that stay.

    Views are as the guidance saw them, with this light or bare colours, and [V, H, W, 3] over white as it
    edited them. Opacities are factors on those of the textured model, of which all surfels [N] may change,
    or some.
    """
    own = model.parameters["opacities"]
    changing = torch.ones_like(own) if surfels is None else surfels.to(own)
    bare = bare_colors(model) if target == "images" else None
    goals = edited if target == "images" else map(straight_colors, edited, views.alphas)
    wanted = list(zip(views.cameras, goals, strict=True))
    return [
        [_observation(model, opacity, changing, camera, light, goal, bare) for camera, goal in wanted]
        for opacity in opacities
    ]


@torch.no_grad()
def _observation(
    model: Surfels,
    opacity: float,
    changing: Tensor,
    camera: Camera,
    light: Light | None,
    goal: Tensor,
    bare: Tensor | None,
) -> LinearObservation:
    """Return one equation with target colours [H, W, 3], or a whole image given the bare colours [T, 3]."""
    p = model.parameters
    highlight, gain = light_on(model, camera, light)
    lit = highlight * changing[:, None], gain * changing
    texture = Texture(*lit, p["texels"], p["sizes"], p["offsets"])
    cover = model.rasterized(camera, opacity, features=changing[:, None]).color
    if bare is None:
        rest, wanted = 1 - cover, goal * cover
    else:
        stay, white = 1 - changing, torch.ones_like(goal[0, 0])
        others = replace(texture, base=highlight * stay[:, None], gain=gain * stay, texels=bare)
        rest = model.rasterized(camera, opacity, texture=others, background=white).color
        wanted = goal - rest
    left, top, right, bottom = content(cover[..., 0])
    rest, wanted = (planar(x[top:bottom, left:right]).permute(1, 2, 0) for x in (rest, wanted))
    crop = camera.crop(left, top, right, bottom)
    return LinearObservation(model, opacity, texture, crop, rest, wanted)


def content(cover: Tensor) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of the nonzero part of [H, W] with a margin; never empty."""
    height, width = cover.shape
    columns, rows = (cover > 0).any(dim=0).nonzero(), (cover > 0).any(dim=1).nonzero()
    if not len(columns):
        return 0, 0, 1, 1
    left, right = max(int(columns[0]) - MARGIN, 0), min(int(columns[-1]) + 1 + MARGIN, width)
    return left, max(int(rows[0]) - MARGIN, 0), right, min(int(rows[-1]) + 1 + MARGIN, height)


def straight_colors(image: Tensor, alpha: Tensor) -> Tensor:
    """Return the straight colours [H, W, 3] in [0, 1] of an image over white with alpha [H, W].

    Where alpha is too small to divide by, they blend into the mean of the neighbourhood, and so continue
    beyond the silhouette.
    """
    own = (image - (1 - alpha[..., None])).clamp_min(0).minimum(alpha[..., None])  # premultiplied
    overall = own.sum(dim=(0, 1)) / alpha.sum().clamp_min(1e-6)
    around = _mean(own, alpha, NEAR_WINDOW, _mean(own, alpha, FAR_WINDOW, overall))
    return ((own + SOFT_ALPHA * around) / (alpha[..., None] + SOFT_ALPHA)).clamp(0, 1)


def _mean(own: Tensor, alpha: Tensor, window: int, beyond: Tensor) -> Tensor:
    """Return the mean colour [H, W, 3] of a window, or `beyond` where the window is nearly empty."""
    planes = torch.cat([own, alpha[..., None]], dim=-1).permute(2, 0, 1)
    for _ in range(2):  # separable, and zeros beyond the border count as transparent
        sums = pad(planes, (window // 2 + 1, window // 2)).cumsum(dim=-1, dtype=torch.float64)
        planes = ((sums[..., window:] - sums[..., :-window]) / window).to(planes).mT
    *color, cover = planes
    return (torch.stack(color, dim=-1) + MIN_WINDOW_ALPHA * beyond) / (cover[..., None] + MIN_WINDOW_ALPHA)
