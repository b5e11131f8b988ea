"""OKLab, a space of colours whose steps look alike (Ottosson 2020, A perceptual color space)."""

import torch
from torch import Tensor

# From linear sRGB to the responses of cones, and from their cube roots to lightness L and the axes a and b.
CONES = (
    (0.4122214708, 0.5363325363, 0.0514459929),
    (0.2119034982, 0.6806995451, 0.1073969566),
    (0.0883024619, 0.2817188376, 0.6299787005),
)
LAB = (
    (0.2104542553, 0.7936177850, -0.0040720468),
    (1.9779984951, -2.4285922050, 0.4505937099),
    (0.0259040371, 0.7827717662, -0.8086757660),
)
DARKEST = 0.01  # lightness below which a colour has no hue


def oklab(rgb: Tensor) -> Tensor:
    """Return lightness L and the axes a and b [..., 3] of sRGB colours [..., 3] in [0, 1]; differentiable."""
    linear = torch.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92)
    cones = linear @ rgb.new_tensor(CONES).T
    return cones.clamp_min(1e-9) ** (1 / 3) @ rgb.new_tensor(LAB).T


def brightness(lab: Tensor) -> Tensor:
    """Return the largest linear channel [...] of lightness, a and b [..., 3]; screens show up to 1."""
    return _linear(lab).amax(-1)


def from_oklab(lab: Tensor) -> Tensor:
    """Return sRGB colours [..., 3] in [0, 1] of lightness, a and b.

    A colour that is too bright for a screen gets darker, as by less light: its hue and saturation stay.
    """
    linear = _linear(lab).clamp_min(0)
    linear = linear / linear.amax(-1, keepdim=True).clamp_min(1)
    return torch.where(
        linear > 0.0031308, 1.055 * linear.clamp_min(1e-9) ** (1 / 2.4) - 0.055, 12.92 * linear
    )


def _linear(lab: Tensor) -> Tensor:
    """Return linear sRGB [..., 3], also what no screen can show."""
    to_roots, to_rgb = (torch.linalg.inv(lab.new_tensor(each)).T for each in (LAB, CONES))
    linear: Tensor = (lab @ to_roots) ** 3 @ to_rgb
    return linear


def chromaticity(rgb: Tensor) -> Tensor:
    """Return a / L and b / L [..., 2] of sRGB colours [..., 3] in [0, 1]: their hue, without light.

    A light scales the linear colour of a matt surface, and so all three of L, a and b alike.
    """
    lab = oklab(rgb)
    return lab[..., 1:] / lab[..., :1].clamp_min(DARKEST)
