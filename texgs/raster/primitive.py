"""What is drawn: surfels, or 3D Gaussians. The number of their scales tells which."""

from __future__ import annotations

from collections.abc import Collection

from torch import Tensor

from texgs.core.errors import ArgumentError, ShapeError


def are_gaussians(scales: Tensor) -> bool:
    """Whether scales [N, 2 or 3] are those of 3D Gaussians."""
    return scales.shape[1] == 3


def check_primitive(scales: Tensor, has_texture: bool, outputs: Collection[str]) -> None:
    """Require scales [N, 2] or [N, 3], and of 3D Gaussians nothing that only surfels have."""
    if scales.ndim != 2 or scales.shape[1] not in (2, 3):
        hint = "2 draw surfels, 3 draw 3D Gaussians"
        raise ShapeError(f"scales: expected [N, 2] or [N, 3], got {list(scales.shape)}; {hint}")
    if not are_gaussians(scales):
        return
    if has_texture:
        raise ArgumentError(
            "texture: expected features for 3D Gaussians (scales [N, 3]), which have no surface; "
            "pass scales [N, 2] to draw surfels"
        )
    if "normal" in outputs:
        raise ArgumentError(
            "outputs: 3D Gaussians (scales [N, 3]) have no normal; leave it out, or pass scales [N, 2] "
            "to draw surfels"
        )
