"""What texels must reproduce: edited views at several opacities, as linear equations in bare colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from texgs.core.camera import Camera
from texgs.core.light import Light
from texgs.edit.target_views import light_on
from texgs.fields.splats import geometry
from texgs.fields.surfels.model import Surfels
from texgs.models.guidance import EditViews
from texgs.raster import Options, Texture, rasterize

MARGIN = 11  # pixels around content: a window of SSIM
SOFT = 0.05  # alpha below which colours are rather those of the neighbourhood
NEAR, FAR = 9, 65  # pixels, windows of that neighbourhood
FEW = 0.02  # mean alpha of a window below which it rather has the colour of the larger one


@dataclass(frozen=True, eq=False)
class Exposure:
    """One view at one opacity: how bare colours become an image, and the image wanted. Over black."""

    geometry: tuple[Tensor, Tensor, Tensor]  # means, quats, scales of all surfels
    opacities: Tensor  # [N]
    highlight: Tensor  # [N, 3], 0 for surfels that do not change
    gain: Tensor  # [N], likewise
    camera: Camera  # of the part of the view that shows anything
    cover: Tensor  # [h, w] share of the surfels that change
    wanted: Tensor  # [h, w, 3] what they should add to the image
    options: Options

    @property
    def is_lit(self) -> bool:
        """Whether there are highlights."""
        return bool(self.highlight.any())

    def image(self, colors: Tensor, sizes: Tensor, offsets: Tensor, *, plain: bool = False) -> Tensor:
        """What surfels of bare colours [T, 3] add to the image [h, w, 3]; differentiable in the colours.

        Args:
            colors: of all texels.
            sizes: of the textures, as in the model.
            offsets: of the textures, as in the model.
            plain: without highlights: then it is linear in the colours.
        """
        highlight = torch.zeros_like(self.highlight) if plain else self.highlight
        return rasterize(
            *self.geometry,
            self.opacities,
            self.camera.viewmat,
            self.camera.K,
            self.camera.width,
            self.camera.height,
            texture=Texture(highlight, self.gain, colors, sizes, offsets),
            options=self.options,
        ).color


def expose(
    model: Surfels,
    views: EditViews,
    edited: Tensor,
    light: Light | None,
    opacities: Sequence[float],
    surfels: Tensor | None = None,
) -> list[list[Exposure]]:
    """Equations of all views at all opacities.

    An edited view says which colours surfels should have where they are seen. At another opacity the same
    colours are wanted, at the alpha of that opacity, so that nothing gets darker or paler to make up for it.

    Args:
        model: textured.
        views: as the guidance saw them.
        edited: [V, H, W, 3] over white.
        light: that views were rendered with; None for bare colours.
        opacities: factors on the opacities of the model.
        surfels: [N] which may change; all by default.

    Returns:
        For each factor the exposures of all views.
    """
    own = geometry(model.parameters)
    changing = torch.ones_like(own[3]) if surfels is None else surfels.to(own[3])
    straight = [straight_colors(image, alpha) for image, alpha in zip(edited, views.alphas, strict=True)]
    rows = []
    for factor in opacities:
        scaled = (own[3] * factor).clamp_max(1)
        row = []
        for camera, color in zip(views.cameras, straight, strict=True):
            highlight, gain = light_on(model, camera, light)
            lit = (highlight * changing[:, None], gain * changing)
            row.append(_exposure(own[:3], scaled, lit, changing, camera, color, model.shading.options))
        rows.append(row)
    return rows


@torch.no_grad()
def _exposure(
    surfels: tuple[Tensor, Tensor, Tensor],
    opacities: Tensor,
    lit: tuple[Tensor, Tensor],
    changing: Tensor,
    camera: Camera,
    color: Tensor,
    options: Options,
) -> Exposure:
    cover = rasterize(
        *surfels,
        opacities,
        camera.viewmat,
        camera.K,
        camera.width,
        camera.height,
        features=changing[:, None],
        options=options,
    ).color[..., 0]
    left, top, right, bottom = content(cover)
    part = cover[top:bottom, left:right].clone()
    wanted = color[top:bottom, left:right] * part[..., None]
    # Planar memory, as the rasterizer returns and takes images.
    wanted = wanted.permute(2, 0, 1).contiguous().permute(1, 2, 0)
    return Exposure(surfels, opacities, *lit, camera.crop(left, top, right, bottom), part, wanted, options)


def content(cover: Tensor) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of what is not 0 in an image [H, W], with a margin; never empty."""
    height, width = cover.shape
    columns, rows = (cover > 0).any(dim=0).nonzero(), (cover > 0).any(dim=1).nonzero()
    if not len(columns):
        return 0, 0, 1, 1
    left, right = max(int(columns[0]) - MARGIN, 0), min(int(columns[-1]) + 1 + MARGIN, width)
    return left, max(int(rows[0]) - MARGIN, 0), right, min(int(rows[-1]) + 1 + MARGIN, height)


def straight_colors(image: Tensor, alpha: Tensor) -> Tensor:
    """Colours [H, W, 3] in [0, 1] that an image over white shows where it is not transparent.

    Where alpha is small, and nothing could be divided by it, they go over to the mean of what is around, and
    so they continue beyond the silhouette.

    Args:
        image: [H, W, 3] over white.
        alpha: [H, W].
    """
    own = (image - (1 - alpha[..., None])).clamp_min(0).minimum(alpha[..., None])  # premultiplied
    around = _mean(own, alpha, FAR, _overall(own, alpha))
    around = _mean(own, alpha, NEAR, around)
    return ((own + SOFT * around) / (alpha[..., None] + SOFT)).clamp(0, 1)


def _overall(own: Tensor, alpha: Tensor) -> Tensor:
    """Mean colour [3]."""
    return own.sum(dim=(0, 1)) / alpha.sum().clamp_min(1e-6)


def _mean(own: Tensor, alpha: Tensor, window: int, beyond: Tensor) -> Tensor:
    """Mean colour [H, W, 3] of a window; where it is nearly empty, `beyond`."""
    planes = torch.cat([own, alpha[..., None]], dim=-1).permute(2, 0, 1)[None]
    for size in ((window, 1), (1, window)):  # separable, and zeros beyond the border count as transparent
        planes = avg_pool2d(planes, size, stride=1, padding=(size[0] // 2, size[1] // 2))
    *color, cover = planes[0]
    return (torch.stack(color, dim=-1) + FEW * beyond) / (cover[..., None] + FEW)
